"""Information of candidate configurations under assumed noise."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.robot.derivatives import jacobian
from robid.robot.description import Robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import ElasticParameters, nominal_parameters, response

KINDS = ("stiffness", "damping", "viscous", "delay")
"""Kinds of parameters that a frequency response tells about; the last two are nuisance."""


def candidate_information(
    robot: Robot,
    configurations: FloatArray,
    frequency_hz: FloatArray,
    sampling_period_s: float,
    delay_s: float,
    relative_error: float,
) -> tuple[FloatArray, tuple[str, ...]]:
    """Information matrices about springs and dampers, viscous friction and delay as nuisance.

    Args:
        robot: Nominal robot.
        configurations (n_conf, n_joint): Candidates [rad].
        frequency_hz (n_freq,): Excited frequencies [Hz].
        sampling_period_s: Sampling period [s].
        delay_s: Delay from recorded to applied torque [s].
        relative_error: Assumed relative standard deviation of each response element.

    Returns:
        Matrices (n_conf, n_param, n_param) for log-parameters, the nuisance parameters eliminated in each
        configuration, and the parameters' names.

    Source:
        Zimmermann et al. (2023), eq. 4-5 with `Lambda = relative_error^2` of the log response.
    """
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configurations))
    nominal = nominal_parameters(robot, linear, delay_s)
    result = response(linear, nominal, frequency_hz, sampling_period_s)
    plain = jacobian(linear, nominal, result, KINDS, sampling_period_s) / result.sampled[..., None]
    slopes = log_slopes(nominal, sampling_period_s)
    rows = (plain * slopes).reshape(len(configurations), -1, slopes.size) / relative_error
    information = 2 * np.real(rows.conj().swapaxes(1, 2) @ rows)
    count = 2 * len(robot.springs)
    names = tuple(f"{spring.name}.{kind}" for kind in KINDS[:2] for spring in robot.springs)
    return _eliminate(information, count), names


def log_slopes(nominal: ElasticParameters, sampling_period_s: float) -> FloatArray:
    """Scale (n_param,) of each parameter of `KINDS`: its value, or for the nuisance what is natural to it."""
    return np.concatenate(
        [nominal.stiffness, nominal.damping, 2 * np.pi * nominal.motor_inertia, np.array([sampling_period_s])]
    )


def _eliminate(information: FloatArray, count: int) -> FloatArray:
    kept, mixed, other = information[:, :count, :count], information[:, :count, count:], information[:, count:, count:]
    return np.asarray(kept - mixed @ np.linalg.solve(other, mixed.swapaxes(1, 2)))
