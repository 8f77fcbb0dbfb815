"""Extrema of the motors' own responses: resonances and antiresonances, each paired with the model's."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.frf.extrema import KINDS, Measured, extrema, local_modes, measured_extrema, reading_hz
from robid.frf.frf import Frf
from robid.frf.local_model import LINE_SCATTER_FREEDOM, Estimator, Kind, LocalMode, line_scatter
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.judge.fitted import ModelAt
from robid.robot.response import response

MATCH = 0.15
_GRID = 601
_Lines: TypeAlias = tuple[FloatArray, ComplexArray, FloatArray, int]


@dataclass(frozen=True)
class ExtremumPair:
    """A measured extremum and the model's counterpart, both by the same local model."""

    line: int  # Index of the line with the extremum
    estimate: Estimator  # The local model
    measured: LocalMode  # What it finds in the measurement
    model: LocalMode | None  # What it finds in the model, or None
    reading_hz: float  # Deviation of what a local model through three lines reads between them [Hz]

    @property
    def measured_hz(self) -> float:
        """Measured frequency [Hz]."""
        return self.measured.frequency_hz

    @property
    def model_hz(self) -> float:
        """The model's; NaN where it has none [Hz]."""
        return np.nan if self.model is None else self.model.frequency_hz

    @property
    def root(self) -> complex:
        """The model's pole or zero as the local model finds it; NaN where it has none [rad/s]."""
        return complex(np.nan, np.nan) if self.model is None else self.model.root


@dataclass(frozen=True, kw_only=True)
class Element(Measured):
    """One motor's own response in one configuration, hold and delay removed, beside the model's."""

    modelled: ComplexArray  # (n_freq,) The model
    dense_hz: FloatArray  # (n_dense,) Further frequencies [Hz]
    dense: FloatArray  # (n_dense,) The model's magnitude there

    def modelled_at(self, line: int) -> _Lines:
        """The same as `measured_at` of the model."""
        return self.frequency_hz, self.modelled, self.variance, line


class Elements:
    """Every element of a response, hold and delay removed, beside the fitted model's.

    Args:
        fitted: The fitted model.
        frf: The response.
        scattering: Whether lines of a response without realizations vary at least as much as they scatter about what
            is smooth; so they do where a table tells resonances from the bumps of a distortion.
    """

    def __init__(self, fitted: ModelAt, frf: Frf, *, scattering: bool = False) -> None:
        """Computes both responses."""
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
        own = 2 * frf.degrees_of_freedom if frf.degrees_of_freedom > 0 else np.inf
        self._freedom = np.full(variance.shape, own)
        if scattering and frf.total_covariance is None:
            seen = line_scatter(self._measured, self._continuous) * np.abs(self._measured) ** 2
            self._freedom[seen > self._variance] = LINE_SCATTER_FREEDOM
            self._variance = np.maximum(self._variance, seen)
        self._errors = None if frf.realization_error is None else frf.realization_error / hold
        self._dense_hz = np.geomspace(frf.frequency_hz[0], frf.frequency_hz[-1], _GRID)
        self._dense = np.abs(response(model, plain, self._dense_hz, None).sampled)

    def at(self, configuration: int, output: int, motor: int) -> Element:
        """Returns one element."""
        at = (configuration, slice(None), output, motor)
        return Element(
            self._frequency_hz,
            self._measured[at],
            self._variance[at],
            self._freedom[at],
            None if self._errors is None else self._errors[configuration, :, :, output, motor],
            modelled=self._continuous[at],
            dense_hz=self._dense_hz,
            dense=self._dense[at],
        )


def pair_extrema(element: Element, kind: Kind) -> list[ExtremumPair]:
    """Measured extrema of one kind with their counterparts in the model, both by the same estimator."""
    dense_hz = element.dense_hz[extrema(element.dense, np.zeros(element.dense.size), kind)]
    pairs = []
    for index in measured_extrema(element, kind):
        near = dense_hz[np.abs(dense_hz / element.frequency_hz[index] - 1) <= MATCH]
        pairs.append(_pair(element, kind, index, near))
    return pairs


def _pair(element: Element, kind: Kind, index: int, near_hz: FloatArray) -> ExtremumPair:
    """Refines both by the best estimator that serves both, on the same lines where the model allows it."""
    lines = _model_lines(element.frequency_hz, near_hz, index)
    served = local_modes(element, index, kind)
    for estimate, found in served:
        for line in lines:
            counterpart = estimate(*element.modelled_at(line), kind)
            if counterpart is not None and abs(counterpart.frequency_hz / found.frequency_hz - 1) <= MATCH:
                return ExtremumPair(index, estimate, found, counterpart, reading_hz(element, index, estimate, served))
    return ExtremumPair(index, *served[0], None, reading_hz(element, index, served[0][0], served))


def _model_lines(frequency_hz: FloatArray, near_hz: FloatArray, index: int) -> list[int]:
    """Lines around which to look for the model's counterpart: the measured one, then those next to its extrema."""
    if near_hz.size == 0:
        return []
    nearest_hz = near_hz[np.argmin(np.abs(near_hz - frequency_hz[index]))]
    inner = np.arange(1, frequency_hz.size - 1)
    by_distance = inner[np.argsort(np.abs(frequency_hz[inner] - nearest_hz))]
    return list(dict.fromkeys([index, *by_distance[:2].tolist()]))


def first_resonances(fitted: ModelAt, channels: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
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
    pairs = _own_pairs(ModelAt(problem, internal), ("resonance",))
    errors = np.array([abs(pair.model_hz / pair.measured_hz - 1) for pair in pairs])
    return np.asarray(np.where(np.isfinite(errors), errors, np.inf))


def resonance_shifts(fitted: ModelAt) -> FloatArray:
    """Relative distances (n_pair,) of a model's resonances and antiresonances from the measured ones.

    Those that the model has no counterpart of are left out.
    """
    pairs = _own_pairs(fitted, KINDS)
    shifts = np.array([abs(pair.model_hz / pair.measured_hz - 1) for pair in pairs if pair.measured_hz > 0])
    return np.asarray(shifts[np.isfinite(shifts)])


def _own_pairs(fitted: ModelAt, kinds: tuple[Kind, ...]) -> list[ExtremumPair]:
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
