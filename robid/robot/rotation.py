"""Rotation matrices from angles."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from robid.arrays import FloatArray


def turn_about(axis: Literal["x", "y", "z"], angle_deg: float) -> FloatArray:
    """Returns the matrix (3, 3) of a turn about a coordinate axis by an angle [deg]."""
    half = math.radians(angle_deg) / 2
    # From the quaternion, digit by digit as scipy.spatial.transform.Rotation has it, which takes long to import.
    sine, cosine = math.sin(half), math.cos(half)
    along = "xyz".index(axis)
    first, second = (along + 1) % 3, (along + 2) % 3
    matrix = np.zeros((3, 3))
    matrix[along, along] = sine * sine + cosine * cosine
    matrix[first, first] = matrix[second, second] = cosine * cosine - sine * sine
    matrix[second, first] = 2 * sine * cosine
    matrix[first, second] = -matrix[second, first]
    return matrix


def roll_pitch_yaw(angles_deg: tuple[float, float, float]) -> FloatArray:
    """Returns the matrix (3, 3) of turns about the fixed x, then y, then z axis [deg]."""
    roll, pitch, yaw = angles_deg
    return np.asarray(turn_about("z", yaw) @ turn_about("y", pitch) @ turn_about("x", roll))
