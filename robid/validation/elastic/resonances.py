"""Resonances and antiresonances of the motors' own responses, measured against the model."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

from robid.arrays import FloatArray, IntArray
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.solution import ElasticSolution
from robid.frf.frf import Frf
from robid.robot.description import Robot
from robid.validation.elastic.extrema import KINDS, MATCH, Elements, ExtremumPair, pair_extrema
from robid.validation.elastic.fitted import FittedModel, fitted_model
from robid.validation.elastic.local_model import Kind
from robid.validation.elastic.modes import Modes, damping_ratio, frequency_std, poles, zeros


@dataclass(frozen=True)
class ResonanceTable:
    """Resonances and antiresonances, one per row.

    Attributes:
        configuration (n_row,): Index of the configuration.
        channel: Name of the motor.
        kind: `resonance` or `antiresonance`.
        measured_hz (n_row,): Measured frequency [Hz].
        lower_hz (n_row,): Lower end of its interval [Hz].
        upper_hz (n_row,): Upper end of its interval [Hz].
        model_hz (n_row,): The model's frequency, found as the measured one; NaN where it has none near [Hz].
        mode_hz (n_row,): The model's own pole or zero there; NaN where there is none near [Hz].
        mode_lower_hz (n_row,): Lower end of its interval, from the parameters' covariance [Hz].
        mode_upper_hz (n_row,): Upper end of its interval [Hz].
        damping (n_row,): Its damping ratio.
    """

    configuration: IntArray
    channel: tuple[str, ...]
    kind: tuple[str, ...]
    measured_hz: FloatArray
    lower_hz: FloatArray
    upper_hz: FloatArray
    model_hz: FloatArray
    mode_hz: FloatArray
    mode_lower_hz: FloatArray
    mode_upper_hz: FloatArray
    damping: FloatArray


@dataclass(frozen=True)
class _Mode:
    """A pole or zero of the fitted model."""

    root: complex = complex(np.nan, np.nan)
    frequency_hz: float = np.nan
    reach_hz: float = np.nan
    damping: float = np.nan


@dataclass(frozen=True)
class _Row:
    configuration: int
    channel: str
    kind: Kind
    pair: ExtremumPair
    reach_hz: float
    mode: _Mode


def tabulate_resonances(
    robot: Robot, solution: ElasticSolution, frf: Frf, options: ElasticOptions, delay_s: float
) -> ResonanceTable:
    """Finds resonances and antiresonances of each motor's own response and their counterparts in the model.

    Extrema of the measured magnitude that stand out of the noise are refined by a local rational model; so are
    the model's, on the same lines, so that what the neighbouring modes add to both cancels. The interval holds
    the response's noise, not what the local model leaves out.

    Args:
        robot: The robot file that the fit started from.
        solution: What the fit found.
        frf: Frequency responses, of the fit or of another campaign.
        options: Options of the fit; `confidence` is the level of the intervals.
        delay_s: Nominal delay of the fit, hold excluded [s].

    Returns:
        The table, ordered by configuration, motor and frequency.

    Raises:
        DataError: If the data and the model do not belong together.
    """
    fitted = fitted_model(robot, solution, frf, options, delay_s)
    tail = 0.5 + 0.5 * options.confidence
    factor, own_factor = float(norm.ppf(tail)), float(t.ppf(tail, solution.estimate.fewest_degrees_of_freedom))
    covariance = _own_covariance(solution, fitted)
    elements = Elements(fitted, frf)
    rows = []
    for configuration in range(frf.response.shape[0]):
        free = _own_modes(fitted, covariance, poles(*fitted.linear, configuration), configuration, own_factor)
        for motor, name in enumerate(frf.input_names):
            if name not in frf.output_names:
                continue
            locked = zeros(*fitted.linear, configuration, motor)
            own = {
                "resonance": free,
                "antiresonance": _own_modes(fitted, covariance, locked, configuration, own_factor),
            }
            element = elements.at(configuration, frf.output_names.index(name), motor)
            found = [
                _Row(configuration, name, kind, pair, factor * pair.std_hz, _nearest(own[kind], pair))
                for kind in KINDS
                for pair in pair_extrema(element, kind)
            ]
            rows += sorted(found, key=lambda row: row.pair.measured_hz)
    return _table(rows)


def _own_covariance(solution: ElasticSolution, fitted: FittedModel) -> FloatArray:
    """The solution's covariance in the order of the fitted model; what only this campaign has is known there."""
    names = fitted.problem.parameters.names
    known = np.array([name in solution.estimate.names for name in names])
    order = [solution.estimate.names.index(name) for name in names if name in solution.estimate.names]
    covariance = np.zeros((len(names), len(names)))
    covariance[np.ix_(known, known)] = solution.internal.covariance[np.ix_(order, order)]
    return covariance


def _own_modes(
    fitted: FittedModel, covariance: FloatArray, modes: Modes, configuration: int, factor: float
) -> list[_Mode]:
    reach = factor * frequency_std(fitted, covariance, modes, configuration)
    columns = modes.roots, np.abs(modes.roots) / (2 * np.pi), reach, damping_ratio(modes.roots)
    return [_Mode(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]


def _nearest(modes: list[_Mode], pair: ExtremumPair) -> _Mode:
    """The mode next to the root that the model's local refinement found, if any is near."""
    if not modes or not np.isfinite(pair.model_hz):
        return _Mode()
    nearest = min(modes, key=lambda mode: abs(mode.root - pair.root))
    return nearest if abs(nearest.frequency_hz / pair.model_hz - 1) <= MATCH else _Mode()


def _table(rows: list[_Row]) -> ResonanceTable:
    measured = np.array([row.pair.measured_hz for row in rows])
    mode, mode_reach = (np.array([getattr(row.mode, key) for row in rows]) for key in ("frequency_hz", "reach_hz"))
    reach = np.array([row.reach_hz for row in rows])
    return ResonanceTable(
        configuration=np.array([row.configuration for row in rows], dtype=int),
        channel=tuple(row.channel for row in rows),
        kind=tuple(row.kind for row in rows),
        measured_hz=measured,
        lower_hz=measured - reach,
        upper_hz=measured + reach,
        model_hz=np.array([row.pair.model_hz for row in rows]),
        mode_hz=mode,
        mode_lower_hz=mode - mode_reach,
        mode_upper_hz=mode + mode_reach,
        damping=np.array([row.mode.damping for row in rows]),
    )
