"""Bristles that slip early and late lose alike: where a fit that ended on one side would go on from the other."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.problem import Problem
from robid.robot.spring_laws import BristleTable

_TORQUES = np.geomspace(0.01, 30, 60)  # over that at which bristles slip at the swing
_SOFTEST = 0.5  # of a spring
_LITTLE = 0.02  # of the largest loss: nothing to be on a side of


def other_side(problem: Problem, internal: FloatArray, number: int) -> FloatArray | None:
    """Returns a start (n_param,) where a hysteresis loses alike on the other side of the largest loss, if there is one.

    The gear's spring is as much softer or stiffer as bristles that stick more or less ask for.

    Args:
        problem: The problem.
        internal (n_param,): Its minimum.
        number: Which of the hystereses that `problem.model.effects` has.
    """
    effects, parameters = problem.model.effects, problem.parameters
    if effects is None or effects.slipping_names[number] not in parameters.names:
        return None
    name, bristle = effects.slipping_names[number], effects.bristles[number]
    omega = 2 * np.pi * problem.frf.frequency_hz
    torque = float(parameters.parameters(internal).doubt[effects.slipping[number, 0]])
    other = _other(bristle, torque, omega)
    if other is None:
        return None
    start, index = internal.copy(), parameters.names.index(name)
    start[index] += (other - torque) / parameters.scale[index]
    spring = name.replace(".hysteresis", ".stiffness")
    if spring in parameters.names:
        own = parameters.names.index(spring)
        stuck, there = (float(bristle.added(each, omega).real.mean()) for each in (torque, other))
        start[own] += np.log(max(1 + (stuck - there) / parameters.values(internal)[own], _SOFTEST))
    return np.clip(start, parameters.lower, parameters.upper)


def _other(bristle: BristleTable, torque: float, omega: FloatArray) -> float | None:
    """Torque on the other side of the largest loss that loses alike; None where there is hardly any loss."""
    tried = bristle.stiffness * bristle.swing * _TORQUES
    losses = np.array([bristle.added(each, omega).imag.mean() for each in tried])
    loss, peak = float(bristle.added(torque, omega).imag.mean()), int(np.argmax(losses))
    if torque <= 0 or loss < _LITTLE * losses[peak]:
        return None
    side = slice(peak, None) if torque < tried[peak] else slice(0, peak + 1)
    return float(tried[side][np.argmin(np.abs(losses[side] - loss))])
