"""Peaks and dips of a measured response: which stand out of its noise, and where between the lines they lie."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np
from scipy.signal import find_peaks

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.frf.frf import Frf
from robid.frf.local_model import (
    Estimator,
    Kind,
    LocalMode,
    half_width,
    interpolated_mode,
    jackknife_variance,
    leaving_out,
    parabola_mode,
    rational_mode,
)

KINDS: tuple[Kind, Kind] = ("resonance", "antiresonance")
RATIONAL: tuple[Estimator, ...] = (rational_mode, *(partial(rational_mode, half_width_lines=n) for n in (5, 8, 12)))
"""Local models of the form of a mechanical response, the narrowest first."""
_THROUGH_THREE: tuple[Estimator, ...] = (interpolated_mode, parabola_mode)
_MIN_PROMINENCE = np.log(1.1)
_NOISE_FACTOR = 8.0  # the range of noise alone over some hundred lines is 6 to 7 deviations
_SURE = 0.2  # deviation of a root, in line spacings, that needs no further lines
_BETWEEN_LINES = 0.2  # deviation of a reading beside other modes, in line spacings: springs of a simulated KR300
_Lines: TypeAlias = tuple[FloatArray, ComplexArray, FloatArray, int]


@dataclass(frozen=True)
class Measured:
    """One element of a measured response in one configuration, the hold removed."""

    frequency_hz: FloatArray  # (n_freq,) Frequencies [Hz]
    measured: ComplexArray  # (n_freq,) The measurement
    variance: FloatArray  # (n_freq,) Its variance
    freedom: FloatArray  # (n_freq,) Real degrees of freedom of that
    errors: ComplexArray | None = None  # (n_real, n_freq) What each realization adds to the measurement, if any

    def measured_at(self, line: int) -> _Lines:
        """What a local estimator takes of the measurement."""
        return self.frequency_hz, self.measured, self.variance, line


@dataclass(frozen=True)
class Peak:
    """A peak or dip of one element, and the pole or zero that a local model has there."""

    configuration: int  # index of the configuration
    output: str  # name of the output
    input: str  # name of the input
    kind: Kind  # whether it is a peak or a dip
    peak_hz: float  # where the magnitude is largest, or smallest [Hz]
    peak_half_hz: float  # half width of its interval [Hz]
    damping: float  # damping ratio of the local model's pole or zero; NaN where the lines show the magnitude alone
    magnitude: float  # magnitude at the nearest line, in the response's unit


def measured_extrema(element: Measured, kind: Kind) -> list[int]:
    """Indices of the lines at which an element has peaks or dips that stand out of its noise."""
    found: list[int] = extrema(np.abs(element.measured), np.sqrt(0.5 * element.variance), kind).tolist()
    return found


def extrema(magnitude: FloatArray, noise: FloatArray, kind: Kind) -> IntArray:
    """Indices of local extrema of a magnitude (n_freq,) that stand out of its noise (n_freq,) by their prominence.

    The prominence counts as a difference of magnitudes, so that a dip down to the noise floor counts in full.
    """
    sign = 1.0 if kind == "resonance" else -1.0
    found, properties = find_peaks(sign * np.log(magnitude), prominence=_MIN_PROMINENCE)
    base = magnitude[found] * np.exp(-sign * properties["prominences"])
    return np.asarray(found[np.abs(magnitude[found] - base) > _NOISE_FACTOR * noise[found]])


def local_modes(element: Measured, index: int, kind: Kind) -> list[tuple[Estimator, LocalMode]]:
    """What local models find, the best first: of rational ones the narrowest that is sure enough, or the surest."""

    def found_by(estimators: tuple[Estimator, ...]) -> list[tuple[Estimator, LocalMode]]:
        tried = ((estimate, estimate(*element.measured_at(index), kind)) for estimate in estimators)
        return [(estimate, found) for estimate, found in tried if found is not None]

    rational = found_by(RATIONAL)
    enough = _SURE * _spacing(element, index)
    sure = [each for each in rational if each[1].std_hz <= enough]
    best = sure[:1] or sorted(rational, key=lambda each: each[1].std_hz)[:1]
    return [*best, *found_by(_THROUGH_THREE)]


def _spacing(element: Measured, index: int) -> float:
    """Mean distance of a line from its neighbours [Hz]."""
    return 0.5 * float(element.frequency_hz[index + 1] - element.frequency_hz[index - 1])


def reading_hz(element: Measured, index: int, chosen: Estimator, served: list[tuple[Estimator, LocalMode]]) -> float:
    """Deviation of a reading through three lines [Hz]: what two such readings differ by, at most what lines tell.

    Lines that are of the form of a mechanical response leave nothing to read between them.
    """
    if chosen in RATIONAL:
        return 0.0
    gap = _spacing(element, index) / float(np.sqrt(12))
    through_three = [found.peak_hz for estimate, found in served if estimate in _THROUGH_THREE]
    return min(gap, float(np.ptp(through_three))) if len(through_three) > 1 else gap


def realization_variance(
    element: Measured, estimate: Estimator, line: int, kind: Kind
) -> tuple[tuple[float, float], float] | None:
    """Variances of a peak and its root as realizations scatter [Hz^2], with their freedom; None without two of them."""
    errors = element.errors
    if errors is None or len(errors) < 2:
        return None
    lines = element.frequency_hz, element.measured, element.variance
    peak, root = jackknife_variance(leaving_out(estimate, *lines, errors, line, kind)).tolist()
    return (peak, root), len(errors) - 1.0


def peaks_of(frf: Frf, confidence: float = 0.95) -> tuple[Peak, ...]:
    """Tabulates the peaks and dips of a measured response without a model.

    Of the elements whose output belongs to their input, as the acceleration of the motor whose torque is the input, or
    of all where none does. The hold is removed; a delay is not, which moves no peak. Intervals hold the larger of what
    the covariance gives and what leaving out each realization changes, and the reading between the lines: beside other
    modes no local model has the response's form, so that it is off by a share of the lines' spacing.

    Args:
        frf: The response.
        confidence: Level of the intervals.

    Returns:
        The peaks, ordered by configuration, element and frequency.
    """
    found: list[Peak] = []
    for output, given, configuration, element in _elements(frf):
        rows = (
            _peak(element, line, kind, (configuration, frf.output_names[output], frf.input_names[given]), confidence)
            for kind in KINDS
            for line in measured_extrema(element, kind)
        )
        found += sorted((row for row in rows if row is not None), key=lambda row: row.peak_hz)
    return tuple(sorted(found, key=lambda row: row.configuration))


def _elements(frf: Frf) -> Iterator[tuple[int, int, int, Measured]]:
    """Yields output, input, configuration and lines of the elements to look at."""
    pairs = [
        (frf.output_names.index(name), place) for place, name in enumerate(frf.input_names) if name in frf.output_names
    ]
    every = [(output, given) for output in range(len(frf.output_names)) for given in range(len(frf.input_names))]
    hz, period = frf.frequency_hz, frf.hold_period_s
    # What a zero-order hold does to a response below half the sampling rate; images above it are far away.
    hold = np.ones(hz.size, complex) if period is None else np.sinc(hz * period) * np.exp(-1j * np.pi * hz * period)
    variance, own = frf.element_variance(), frf.degrees_of_freedom
    for output, given in pairs or every:
        for configuration in range(len(frf.response)):
            at = (configuration, slice(None), output, given)
            known = np.isfinite(variance[at]) & np.isfinite(frf.response[at]) & (np.abs(frf.response[at]) > 0)
            errors = None if frf.realization_error is None else frf.realization_error[configuration, ..., output, given]
            yield (
                output,
                given,
                configuration,
                Measured(
                    frequency_hz=hz[known],
                    measured=(frf.response[at] / hold)[known],
                    variance=(variance[at] / np.abs(hold) ** 2)[known],
                    freedom=np.full(int(known.sum()), 2 * own if own > 0 else np.inf),
                    errors=None if errors is None else (errors / hold)[:, known],
                ),
            )


def _peak(element: Measured, line: int, kind: Kind, where: tuple[int, str, str], confidence: float) -> Peak | None:
    served = local_modes(element, line, kind)
    if not served:
        return None
    estimate, mode = served[0]
    # Reading between the lines, and noise.
    variance = mode.peak_std_hz**2 + (_BETWEEN_LINES * _spacing(element, line)) ** 2
    scatter = realization_variance(element, estimate, line, kind)
    further = [] if scatter is None else [(scatter[0][0], scatter[1])]
    half = half_width((variance, float(element.freedom[line])), further, confidence)
    damping = -mode.root.real / abs(mode.root) if mode.is_root else float("nan")
    return Peak(*where, kind, mode.peak_hz, half, damping, float(np.abs(element.measured[line])))
