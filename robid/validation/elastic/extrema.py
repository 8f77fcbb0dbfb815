"""Extrema of the motors' own responses: resonances and antiresonances, each paired with the model's."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from scipy.signal import find_peaks

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.fit.elastic.problem import Problem
from robid.frf.frf import Frf
from robid.robot.response import response
from robid.validation.elastic.fitted import FittedModel
from robid.validation.elastic.local_model import Kind, interpolated_mode, parabola_mode, rational_mode

_MIN_PROMINENCE = np.log(1.1)
_NOISE_FACTOR = 8.0  # the range of noise alone over some hundred lines is 6 to 7 deviations
MATCH = 0.15
_GRID = 601
KINDS: tuple[Kind, Kind] = ("resonance", "antiresonance")
_ESTIMATORS = (rational_mode, interpolated_mode, parabola_mode)
_Lines: TypeAlias = tuple[FloatArray, ComplexArray, FloatArray, int]


@dataclass(frozen=True)
class ExtremumPair:
    """A measured extremum and the model's counterpart, NaN where there is none."""

    measured_hz: float
    std_hz: float
    model_hz: float
    root: complex


@dataclass(frozen=True)
class Element:
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


class Elements:
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
        variance = frf.element_variance()
        # What is interpolated is as unsure as it is large.
        variance = np.where(np.isfinite(variance), variance, np.abs(fitted.measured) ** 2)
        self._variance = variance / np.abs(hold) ** 2
        self._dense_hz = np.geomspace(frf.frequency_hz[0], frf.frequency_hz[-1], _GRID)
        self._dense = np.abs(response(model, plain, self._dense_hz, None).sampled)

    def at(self, configuration: int, output: int, motor: int) -> Element:
        """Returns one element."""
        at = (configuration, slice(None), output, motor)
        curves = self._measured[at], self._variance[at], self._continuous[at]
        return Element(self._frequency_hz, *curves, self._dense_hz, self._dense[at])


def pair_extrema(element: Element, kind: Kind) -> list[ExtremumPair]:
    """Measured extrema of one kind with their counterparts in the model, both by the same estimator."""
    dense_hz = element.dense_hz[_extrema(element.dense, np.zeros(element.dense.size), kind)]
    pairs = []
    for index in _extrema(np.abs(element.measured), np.sqrt(0.5 * element.variance), kind).tolist():
        near = dense_hz[np.abs(dense_hz / element.frequency_hz[index] - 1) <= MATCH]
        pairs.append(_pair(element, kind, index, near))
    return pairs


def _pair(element: Element, kind: Kind, index: int, near_hz: FloatArray) -> ExtremumPair:
    """Refines both by the best estimator that serves both, on the same lines where the model allows it."""
    lines = _model_lines(element.frequency_hz, near_hz, index)
    tried = ((estimate, estimate(*element.measured_at(index), kind)) for estimate in _ESTIMATORS)
    served = [(estimate, found) for estimate, found in tried if found is not None]
    for line in lines:
        for estimate, found in served:
            counterpart = estimate(*element.modelled_at(line), kind)
            if counterpart is not None and abs(counterpart.frequency_hz / found.frequency_hz - 1) <= MATCH:
                return ExtremumPair(found.frequency_hz, found.std_hz, counterpart.frequency_hz, counterpart.root)
    best = served[0][1]
    return ExtremumPair(best.frequency_hz, best.std_hz, np.nan, complex(np.nan, np.nan))


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
    elements = Elements(fitted, frf)
    measured = np.full((frf.response.shape[0], len(channels)), np.nan)
    modelled = measured.copy()
    for index, name in np.ndenumerate(np.array(channels)):
        place = frf.output_names.index(str(name)), frf.input_names.index(str(name))
        for configuration in range(len(measured)):
            pairs = pair_extrema(elements.at(configuration, *place), "resonance")
            if pairs:
                first = min(pairs, key=lambda pair: pair.measured_hz)
                measured[configuration, *index] = first.measured_hz
                modelled[configuration, *index] = first.model_hz
    return measured, modelled


def own_resonance_errors(problem: Problem, internal: FloatArray) -> FloatArray:
    """Relative frequency errors of a model at every measured resonance of the motors' own responses.

    Args:
        problem: Measured responses and the linearised robot.
        internal (n_param,): Internal parameters of the model.

    Returns:
        Errors (n_resonance,), in the table's order; infinite where the model has no resonance near.
    """
    pairs = _own_pairs(FittedModel(problem, internal, 0), ("resonance",))
    errors = np.array([abs(pair.model_hz / pair.measured_hz - 1) for pair in pairs])
    return np.asarray(np.where(np.isfinite(errors), errors, np.inf))


def resonance_shifts(fitted: FittedModel) -> FloatArray:
    """Relative distances (n_pair,) of a model's resonances and antiresonances from the measured ones.

    Those that the model has no counterpart of are left out.
    """
    pairs = _own_pairs(fitted, KINDS)
    shifts = np.array([abs(pair.model_hz / pair.measured_hz - 1) for pair in pairs if pair.measured_hz > 0])
    return np.asarray(shifts[np.isfinite(shifts)])


def _own_pairs(fitted: FittedModel, kinds: tuple[Kind, ...]) -> list[ExtremumPair]:
    """Extrema of the motors' own responses in all configurations, in the table's order but for their kinds."""
    frf = fitted.problem.frf
    elements = Elements(fitted, frf)
    return [
        pair
        for configuration in range(frf.response.shape[0])
        for motor, name in enumerate(frf.input_names)
        if name in frf.output_names
        for kind in kinds
        for pair in pair_extrema(elements.at(configuration, frf.output_names.index(name), motor), kind)
    ]
