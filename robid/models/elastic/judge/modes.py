"""Modes of a fitted elastic arm: how it moves at each, and which springs the elastic energy is in."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.elastic.fit.solution import fitted_robot
from robid.models.elastic.judge.fitted import FittedModel, Modes, damping_ratio, poles
from robid.robot.linearize import LinearModel, solve_statics
from robid.robot.model import build_model
from robid.robot.points import arm_points
from robid.robot.response import ElasticParameters, at_rest

BESIDE_BAND = 1.25
"""Factor by which modes may lie below or above the measured band."""


@dataclass(frozen=True)
class ArmModes:
    """Modes of an arm in one configuration, motors free, by rising frequency."""

    frequency_hz: FloatArray  # (n_mode,) Undamped natural frequencies [Hz]
    damping: FloatArray  # (n_mode,) Damping ratios
    energy: FloatArray  # (n_mode, n_spring) Share of each spring in the elastic energy; they sum to 1
    points_m: FloatArray  # (n_point, 3) Points along the arm at rest, then the ends of two axes of its tool [m]
    # (n_mode, n_point, 3) How these move, as complex amplitudes: the largest displacement is 1, and real where it is
    shape: ComplexArray
    length_m: float  # Length of the line along the arm [m]


def arm_modes(fitted: FittedModel) -> tuple[ArmModes, ...]:
    """Finds the modes of a fitted model in and a little around the band of its response, in every configuration.

    Raises:
        DataError: If the fitted robot finds no rest.
    """
    frf, robot = fitted.problem.frf, fitted_robot(fitted.robot, fitted.solution.estimate)
    elastic = build_model(robot, balanced=True)
    points = arm_points(elastic, solve_statics(elastic, frf.configurations).position)
    low, high = frf.frequency_hz.min() / BESIDE_BAND, frf.frequency_hz.max() * BESIDE_BAND
    found = []
    for configuration, length in enumerate(points.length_m.tolist()):
        modes = _within(poles(*fitted.linear, configuration), low, high)
        energy = energy_shares(*fitted.linear, configuration, modes)
        shape = displacements(points.moves[configuration], modes.shapes)
        hertz = np.abs(modes.roots) / (2 * np.pi)
        place = points.position_m[configuration]
        found.append(ArmModes(hertz, damping_ratio(modes.roots), energy, place, shape, length))
    return tuple(found)


def _within(modes: Modes, low_hz: float, high_hz: float) -> Modes:
    hertz = np.abs(modes.roots) / (2 * np.pi)
    kept = (hertz >= low_hz) & (hertz <= high_hz)
    return Modes(modes.roots[kept], modes.shapes[:, kept], modes.slopes[kept])


def energy_shares(model: LinearModel, parameters: ElasticParameters, configuration: int, modes: Modes) -> FloatArray:
    """Share (n_mode, n_spring) of each spring in the elastic energy of modes, mean over a cycle.

    A spring of stiffness `k` whose deflection has the complex amplitude `x` stores `k |x|^2 / 4`; what gravity does is
    no spring's.
    """
    moving, springs = at_rest(model, parameters)
    stiffness = np.broadcast_to(springs.stiffness[configuration], (modes.roots.size, springs.stiffness.shape[1]))
    if moving.effects is not None:
        # Bristles beside a gear store at each mode's own frequency what their complex stiffness has of a spring.
        added = moving.effects.stiffness(parameters.doubt, np.abs(modes.roots))[configuration]
        stiffness = stiffness + added.real
    energy = stiffness * np.abs(modes.shapes[model.n_motor :].T) ** 2
    return np.asarray(energy / np.maximum(energy.sum(axis=1, keepdims=True), np.finfo(float).tiny))


def displacements(moves: FloatArray, shapes: ComplexArray) -> ComplexArray:
    """Shapes of modes as displacements (n_mode, n_point, 3) of points, the largest of each mode of size 1.

    Args:
        moves (n_point, 3, n): Jacobians of the points by the coordinates of the shapes.
        shapes (n, n_mode): Shapes.

    Returns:
        Complex amplitudes `u`: a point is at `Re(u exp(j w t))` from rest. The phase, which a shape leaves open, is
        that in which the largest component is real.
    """
    found = np.einsum("pxn,nm->mpx", moves, shapes)
    for row, shape in enumerate(found):
        size = float(np.linalg.norm(shape, axis=1).max(initial=0.0))
        if size > 0:
            largest = shape.flat[np.argmax(np.abs(shape))]
            found[row] = shape * (abs(largest) / largest / size)
    return np.asarray(found)
