"""Models of where a joint and its link are."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from pydantic import Field

from robid.arrays import FloatArray
from robid.robot.rotation import turn_about
from robid.settings.base import Assumed, Vector

Matrix: TypeAlias = tuple[Vector, Vector, Vector]


class Dh(Assumed):
    """Standard Denavit-Hartenberg parameters: Rz(q + offset) Tz(d) Tx(a) Rx(alpha); prismatic, q is added to d."""

    d_m: float = Field(default=0.0, description="Translation along the joint axis [m].")
    a_m: float = Field(default=0.0, description="Translation along the turned x axis [m].")
    alpha_deg: float = Field(default=0.0, description="Turn about the turned x axis [deg].")
    offset_deg: float = Field(default=0.0, description="Joint angle of the DH frame at zero robot angle [deg].")

    def link_frame(self) -> tuple[FloatArray, FloatArray]:
        """Returns position (3,) [m] and orientation (3, 3) of the DH frame at the link's end in the joint frame."""
        return np.array([self.a_m, 0.0, self.d_m]), turn_about("x", self.alpha_deg)

    def joint_frame(self) -> tuple[FloatArray, FloatArray]:
        """Returns position (3,) [m] and orientation (3, 3) of the joint frame in the previous link's frame."""
        return np.zeros(3), turn_about("z", self.offset_deg)


class Frame(Assumed):
    """A joint's frame, its axis along z, in the previous joint's frame at zero angle; links are given in it."""

    position_m: Vector = Field(default=(0.0, 0.0, 0.0), description="Origin [m].")
    rotation: Matrix = Field(
        default=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), description="Orientation, row by row."
    )

    def joint_frame(self) -> tuple[FloatArray, FloatArray]:
        """Returns position (3,) [m] and orientation (3, 3) of the joint frame in the previous link's frame."""
        return np.array(self.position_m), np.array(self.rotation)

    def link_frame(self) -> tuple[FloatArray, FloatArray]:
        """Returns position (3,) [m] and orientation (3, 3) of the link's frame in the joint frame: the same frame."""
        return np.zeros(3), np.eye(3)
