"""Resonances and antiresonances of the motors' own responses, measured against the model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.signal import find_peaks
from scipy.stats import norm

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.fit.options import ElasticOptions
from robid.fit.solution import Solution
from robid.frf.frf import Frf
from robid.robot.description import Robot
from robid.robot.linearize import LinearModel
from robid.robot.response import ElasticParameters, response
from robid.validation.fitted import fitted_model
from robid.validation.local_model import Kind, interpolated_mode, parabola_mode, rational_mode
from robid.validation.modes import damping_ratio, poles, zeros

_MIN_PROMINENCE = np.log(1.1)
_NOISE_FACTOR = 8.0  # the range of noise alone over some hundred lines is 6 to 7 deviations
_MATCH = 0.15
_GRID = 601
_KINDS: tuple[Kind, Kind] = ("resonance", "antiresonance")


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
        damping (n_row,): Damping ratio of the model's pole or zero; NaN where there is none near.
    """

    configuration: IntArray
    channel: tuple[str, ...]
    kind: tuple[str, ...]
    measured_hz: FloatArray
    lower_hz: FloatArray
    upper_hz: FloatArray
    model_hz: FloatArray
    damping: FloatArray


@dataclass(frozen=True)
class _Row:
    configuration: int
    channel: str
    kind: str
    measured_hz: float
    reach_hz: float
    model_hz: float
    damping: float


@dataclass(frozen=True)
class _Pair:
    measured_hz: float
    std_hz: float
    model_hz: float
    root: complex


@dataclass(frozen=True)
class _Element:
    """One motor's own response in one configuration, hold and delay removed."""

    frequency_hz: FloatArray
    measured: ComplexArray
    variance: FloatArray
    modelled: ComplexArray
    dense_hz: FloatArray
    dense: FloatArray


def tabulate_resonances(
    robot: Robot, solution: Solution, frf: Frf, options: ElasticOptions, delay_s: float
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
    model, parameters = fitted.problem.model, fitted.parameters
    plain = replace(parameters, delay=np.zeros(1))
    continuous = response(model, plain, frf.frequency_hz, None).sampled
    sampled = response(model, parameters, frf.frequency_hz, frf.hold_period_s)
    hold = sampled.hold[:, None, None]
    aliases = sampled.sampled - hold * continuous
    measured = (fitted.measured - aliases) / hold
    variance = frf.element_variance() / np.abs(hold) ** 2
    dense_hz = np.geomspace(frf.frequency_hz[0], frf.frequency_hz[-1], _GRID)
    dense = np.abs(response(model, plain, dense_hz, None).sampled)
    factor = float(norm.ppf(0.5 + 0.5 * options.confidence))
    rows = []
    for configuration in range(frf.response.shape[0]):
        for motor, name in enumerate(frf.input_names):
            if name not in frf.output_names:
                continue
            at = (configuration, slice(None), frf.output_names.index(name), motor)
            element = _Element(frf.frequency_hz, measured[at], variance[at], continuous[at], dense_hz, dense[at])
            rows += _element_rows(element, model, parameters, configuration, motor, name, factor)
    return _table(rows)


def _element_rows(
    element: _Element,
    model: LinearModel,
    parameters: ElasticParameters,
    configuration: int,
    motor: int,
    name: str,
    factor: float,
) -> list[_Row]:
    rows = []
    modes = {
        "resonance": poles(model, parameters, configuration),
        "antiresonance": zeros(model, parameters, configuration, motor),
    }
    for kind in _KINDS:
        for found in _pairs(element, kind):
            damping = np.nan
            if np.isfinite(found.model_hz) and modes[kind].size:
                nearest = modes[kind][np.argmin(np.abs(modes[kind] - found.root))]
                damping = float(damping_ratio(nearest))
            reach = factor * found.std_hz
            rows.append(_Row(configuration, name, kind, found.measured_hz, reach, found.model_hz, damping))
    return sorted(rows, key=lambda row: row.measured_hz)


def _pairs(element: _Element, kind: Kind) -> list[_Pair]:
    """Measured extrema of one kind with their counterparts in the model, both by the same estimator."""
    sign = 1.0 if kind == "resonance" else -1.0
    level = sign * np.log(np.abs(element.modelled))
    dense_hz = element.dense_hz[_extrema(element.dense, np.zeros(element.dense.size), kind)]
    pairs = []
    for index in _extrema(np.abs(element.measured), np.sqrt(0.5 * element.variance), kind).tolist():
        near = dense_hz[np.abs(dense_hz / element.frequency_hz[index] - 1) <= _MATCH]
        pairs.append(_pair(element, kind, index, _nearest_line(element.frequency_hz, level, near, index)))
    return pairs


def _pair(element: _Element, kind: Kind, index: int, model_index: int | None) -> _Pair:
    """Refines both by the best estimator that serves both."""
    measured = element.frequency_hz, element.measured, element.variance, index
    modelled = element.frequency_hz, element.modelled, element.variance, model_index or 0
    for estimate in (rational_mode, interpolated_mode):
        found = estimate(*measured, kind)
        if found is not None and model_index is None:
            return _Pair(found.frequency_hz, found.std_hz, np.nan, 0j)
        counterpart = None if model_index is None else estimate(*modelled, kind)
        if found is not None and counterpart is not None:
            return _Pair(found.frequency_hz, found.std_hz, counterpart.frequency_hz, counterpart.root)
    vertex = parabola_mode(*measured)
    if model_index is None:
        return _Pair(vertex.frequency_hz, vertex.std_hz, np.nan, 0j)
    counterpart = parabola_mode(*modelled)
    return _Pair(vertex.frequency_hz, vertex.std_hz, counterpart.frequency_hz, counterpart.root)


def _nearest_line(frequency_hz: FloatArray, level: FloatArray, dense_hz: FloatArray, index: int) -> int | None:
    """Line of the model's extremum nearest to a measured one, preferably the same; None without candidates."""
    if dense_hz.size == 0:
        return None
    nearest_hz = dense_hz[np.argmin(np.abs(dense_hz - frequency_hz[index]))]
    line = int(np.argmin(np.abs(frequency_hz - nearest_hz)))
    inside = range(max(1, line - 1), min(frequency_hz.size - 1, line + 2))
    return max(inside, key=lambda candidate: level[candidate])


def _extrema(magnitude: FloatArray, noise: FloatArray, kind: Kind) -> IntArray:
    """Indices of local extrema of a magnitude that stand out of its noise by their prominence.

    The prominence counts as a difference of magnitudes, so that a dip down to the noise floor counts in full.
    """
    sign = 1.0 if kind == "resonance" else -1.0
    found, properties = find_peaks(sign * np.log(magnitude), prominence=_MIN_PROMINENCE)
    base = magnitude[found] * np.exp(-sign * properties["prominences"])
    return np.asarray(found[np.abs(magnitude[found] - base) > _NOISE_FACTOR * noise[found]])


def _table(rows: list[_Row]) -> ResonanceTable:
    measured = np.array([row.measured_hz for row in rows])
    reach = np.array([row.reach_hz for row in rows])
    return ResonanceTable(
        configuration=np.array([row.configuration for row in rows], dtype=int),
        channel=tuple(row.channel for row in rows),
        kind=tuple(row.kind for row in rows),
        measured_hz=measured,
        lower_hz=measured - reach,
        upper_hz=measured + reach,
        model_hz=np.array([row.model_hz for row in rows]),
        damping=np.array([row.damping for row in rows]),
    )
