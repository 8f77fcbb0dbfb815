"""Information of candidate configurations under assumed noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.design.configurations.options import ALONG
from robid.design.configurations.parameters_of_interest import choose_parameters, eliminated, natural_scales
from robid.robot.derivatives import jacobian
from robid.robot.description import Robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.parameters import FREE, OF_SPRINGS, RESPONSE_NUISANCE
from robid.robot.response import ElasticParameters, nominal_parameters, response

KINDS = (*OF_SPRINGS, *(kind for kind in RESPONSE_NUISANCE if kind in FREE))
"""Kinds of parameters that an excitation is shaped for; the last two are nuisance."""


def candidate_information(
    robot: Robot,
    configurations: FloatArray,
    frequency_hz: FloatArray,
    sampling_period_s: float,
    delay_s: float,
    relative_error: float,
    *,
    kinds: Sequence[str] = OF_SPRINGS,
    nuisance: Sequence[str] = ALONG,
    fixed: Sequence[str] = (),
    weights: FloatArray | None = None,
) -> tuple[FloatArray, tuple[str, ...]]:
    """Information matrices about log-parameters, the nuisance parameters eliminated in each configuration.

    What the robot file knows of motor inertias that are estimated along counts in each.

    Args:
        robot: Nominal robot.
        configurations (n_conf, n_joint): Candidates [rad].
        frequency_hz (n_freq,): Excited frequencies [Hz].
        sampling_period_s: Sampling period [s].
        delay_s: Delay from recorded to applied torque [s].
        relative_error: Assumed relative standard deviation of each response element.
        kinds: Kinds of parameters that the design is about.
        nuisance: Kinds that are estimated along.
        fixed: Names of single parameters that are known.
        weights (n_freq, n_out, n_in): Design weights, 1 for full importance.

    Returns:
        Matrices (n_conf, n_param, n_param) and the parameters' names.

    Raises:
        SettingsError: If a kind cannot be designed for, or a fixed name is unknown.

    Source:
        Zimmermann et al. (2023), eq. 4-5 with `Lambda = relative_error^2` of the log response.
    """
    wanted = choose_parameters(robot, kinds, nuisance, fixed)
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configurations))
    nominal = nominal_parameters(robot, linear, delay_s)
    result = response(linear, nominal, frequency_hz, sampling_period_s)
    plain = jacobian(linear, nominal, result, wanted.kinds)[..., wanted.columns]
    relative = plain * wanted.scales(nominal, sampling_period_s) / result.sampled[..., None]
    if weights is not None:
        relative = relative * np.sqrt(weights)[..., None]
    rows = relative.reshape(len(configurations), -1, relative.shape[-1]) / relative_error
    information = 2 * np.real(rows.conj().swapaxes(1, 2) @ rows)
    matrices = [eliminated([each], wanted.precision, len(wanted.names))[0] for each in information]
    return np.array(matrices), wanted.names


def log_slopes(nominal: ElasticParameters, sampling_period_s: float) -> FloatArray:
    """Scale (n_param,) of each parameter of `KINDS`: its value, or for the nuisance what is natural to it."""
    return natural_scales(nominal, sampling_period_s, KINDS)
