"""Resonances and antiresonances of the motors' own responses, measured against the model."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.signal import find_peaks
from scipy.stats import norm, t

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.fit.options import ElasticOptions
from robid.fit.problem import Problem
from robid.fit.solution import Solution
from robid.frf.frf import Frf
from robid.robot.description import Robot
from robid.robot.response import response
from robid.validation.fitted import FittedModel, fitted_model
from robid.validation.local_model import Kind, interpolated_mode, parabola_mode, rational_mode
from robid.validation.modes import Modes, damping_ratio, frequency_std, poles, zeros

_MIN_PROMINENCE = np.log(1.1)
_NOISE_FACTOR = 8.0  # the range of noise alone over some hundred lines is 6 to 7 deviations
_MATCH = 0.15
_GRID = 601
_KINDS: tuple[Kind, Kind] = ("resonance", "antiresonance")
_ESTIMATORS = (rational_mode, interpolated_mode, parabola_mode)
_Lines: TypeAlias = tuple[FloatArray, ComplexArray, FloatArray, int]


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
    pair: _Pair
    reach_hz: float
    mode: _Mode


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

    def measured_at(self, line: int) -> _Lines:
        """What a local estimator takes of the measurement."""
        return self.frequency_hz, self.measured, self.variance, line

    def modelled_at(self, line: int) -> _Lines:
        """The same of the model."""
        return self.frequency_hz, self.modelled, self.variance, line


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
    tail = 0.5 + 0.5 * options.confidence
    factor, own_factor = float(norm.ppf(tail)), float(t.ppf(tail, solution.fewest_degrees_of_freedom))
    covariance = _own_covariance(solution, fitted)
    elements = _Elements(fitted, frf)
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
                for kind in _KINDS
                for pair in _pairs(element, kind)
            ]
            rows += sorted(found, key=lambda row: row.pair.measured_hz)
    return _table(rows)


class _Elements:
    """Every element of a response, hold and delay removed, beside the fitted model's."""

    def __init__(self, fitted: FittedModel, frf: Frf) -> None:
        model, parameters = fitted.linear
        plain = replace(parameters, delay=np.zeros(1))
        self._frequency_hz = frf.frequency_hz
        self._continuous = response(model, plain, frf.frequency_hz, None).sampled
        sampled = response(model, parameters, frf.frequency_hz, frf.hold_period_s)
        hold = sampled.hold[:, None, None]
        aliases = sampled.sampled - hold * self._continuous
        self._measured = (fitted.measured - aliases) / hold
        self._variance = frf.element_variance() / np.abs(hold) ** 2
        self._dense_hz = np.geomspace(frf.frequency_hz[0], frf.frequency_hz[-1], _GRID)
        self._dense = np.abs(response(model, plain, self._dense_hz, None).sampled)

    def at(self, configuration: int, output: int, motor: int) -> _Element:
        """Returns one element."""
        at = (configuration, slice(None), output, motor)
        curves = self._measured[at], self._variance[at], self._continuous[at]
        return _Element(self._frequency_hz, *curves, self._dense_hz, self._dense[at])


def _own_covariance(solution: Solution, fitted: FittedModel) -> FloatArray:
    """The solution's covariance in the order of the fitted model; what only this campaign has is known there."""
    names = fitted.problem.parameters.names
    known = np.array([name in solution.names for name in names])
    order = [solution.names.index(name) for name in names if name in solution.names]
    covariance = np.zeros((len(names), len(names)))
    covariance[np.ix_(known, known)] = solution.covariance[np.ix_(order, order)]
    return covariance


def _own_modes(
    fitted: FittedModel, covariance: FloatArray, modes: Modes, configuration: int, factor: float
) -> list[_Mode]:
    reach = factor * frequency_std(fitted, covariance, modes, configuration)
    columns = modes.roots, np.abs(modes.roots) / (2 * np.pi), reach, damping_ratio(modes.roots)
    return [_Mode(*row) for row in zip(*(column.tolist() for column in columns), strict=True)]


def _nearest(modes: list[_Mode], pair: _Pair) -> _Mode:
    """The mode next to the root that the model's local refinement found, if any is near."""
    if not modes or not np.isfinite(pair.model_hz):
        return _Mode()
    nearest = min(modes, key=lambda mode: abs(mode.root - pair.root))
    return nearest if abs(nearest.frequency_hz / pair.model_hz - 1) <= _MATCH else _Mode()


def _pairs(element: _Element, kind: Kind) -> list[_Pair]:
    """Measured extrema of one kind with their counterparts in the model, both by the same estimator."""
    dense_hz = element.dense_hz[_extrema(element.dense, np.zeros(element.dense.size), kind)]
    pairs = []
    for index in _extrema(np.abs(element.measured), np.sqrt(0.5 * element.variance), kind).tolist():
        near = dense_hz[np.abs(dense_hz / element.frequency_hz[index] - 1) <= _MATCH]
        pairs.append(_pair(element, kind, index, near))
    return pairs


def _pair(element: _Element, kind: Kind, index: int, near_hz: FloatArray) -> _Pair:
    """Refines both by the best estimator that serves both, on the same lines where the model allows it."""
    lines = _model_lines(element.frequency_hz, near_hz, index)
    tried = ((estimate, estimate(*element.measured_at(index), kind)) for estimate in _ESTIMATORS)
    served = [(estimate, found) for estimate, found in tried if found is not None]
    for line in lines:
        for estimate, found in served:
            counterpart = estimate(*element.modelled_at(line), kind)
            if counterpart is not None and abs(counterpart.frequency_hz / found.frequency_hz - 1) <= _MATCH:
                return _Pair(found.frequency_hz, found.std_hz, counterpart.frequency_hz, counterpart.root)
    best = served[0][1]
    return _Pair(best.frequency_hz, best.std_hz, np.nan, complex(np.nan, np.nan))


def _model_lines(frequency_hz: FloatArray, near_hz: FloatArray, index: int) -> list[int]:
    """Lines around which to look for the model's counterpart: the measured one, then those next to its extrema."""
    if near_hz.size == 0:
        return []
    nearest_hz = near_hz[np.argmin(np.abs(near_hz - frequency_hz[index]))]
    inner = np.arange(1, frequency_hz.size - 1)
    by_distance = inner[np.argsort(np.abs(frequency_hz[inner] - nearest_hz))]
    return list(dict.fromkeys([index, *by_distance[:2].tolist()]))


def _extrema(magnitude: FloatArray, noise: FloatArray, kind: Kind) -> IntArray:
    """Indices of local extrema of a magnitude that stand out of its noise by their prominence.

    The prominence counts as a difference of magnitudes, so that a dip down to the noise floor counts in full.
    """
    sign = 1.0 if kind == "resonance" else -1.0
    found, properties = find_peaks(sign * np.log(magnitude), prominence=_MIN_PROMINENCE)
    base = magnitude[found] * np.exp(-sign * properties["prominences"])
    return np.asarray(found[np.abs(magnitude[found] - base) > _NOISE_FACTOR * noise[found]])


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


def first_resonances(fitted: FittedModel, channels: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
    """Finds the lowest resonance of some motors' own responses.

    Args:
        fitted: A fitted model and the responses it is held against.
        channels: Names of the motors.

    Returns:
        Measured frequencies (n_conf, n_channel), NaN where nothing stands out, and the model's, NaN where it has none
        near [Hz].
    """
    frf = fitted.problem.frf
    elements = _Elements(fitted, frf)
    measured = np.full((frf.response.shape[0], len(channels)), np.nan)
    modelled = measured.copy()
    for index, name in np.ndenumerate(np.array(channels)):
        place = frf.output_names.index(str(name)), frf.input_names.index(str(name))
        for configuration in range(len(measured)):
            pairs = _pairs(elements.at(configuration, *place), "resonance")
            if pairs:
                first = min(pairs, key=lambda pair: pair.measured_hz)
                measured[configuration, *index] = first.measured_hz
                modelled[configuration, *index] = first.model_hz
    return measured, modelled


def resonance_errors(problem: Problem, internal: FloatArray) -> FloatArray:
    """Relative frequency errors of a model at every measured resonance of the motors' own responses.

    Args:
        problem: Measured responses and the linearised robot.
        internal (n_param,): Internal parameters of the model.

    Returns:
        Errors (n_resonance,), in the table's order; infinite where the model has no resonance near.
    """
    frf = problem.frf
    elements = _Elements(FittedModel(problem, internal, 0), frf)
    pairs = [
        pair
        for configuration in range(frf.response.shape[0])
        for motor, name in enumerate(frf.input_names)
        if name in frf.output_names
        for pair in _pairs(elements.at(configuration, frf.output_names.index(name), motor), "resonance")
    ]
    errors = np.array([abs(pair.model_hz / pair.measured_hz - 1) for pair in pairs])
    return np.asarray(np.where(np.isfinite(errors), errors, np.inf))
