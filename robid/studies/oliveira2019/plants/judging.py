"""Estimated transfer functions held against true ones: responses in the band, poles, zeros and undershoot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray

_JUDGED_BELOW = 0.005  # predicted relative deviation
_REAL = 1e-9


@dataclass(frozen=True)
class RootValue:
    """A number that says where a pole or a zero lies.

    Attributes:
        name: What it is, as in `pole2.damping`.
        kind: `pole` or `zero`.
        what: `rate` of a real one, `frequency` or `damping` of a pair.
        size_rad_s: Distance of the pole or zero from the origin [rad/s].
        value: The number.
        relative_std: Its predicted standard deviation over it.
    """

    name: str
    kind: str
    what: str
    size_rad_s: float
    value: float
    relative_std: float


@dataclass(frozen=True)
class RootError:
    """How far such a number is from the true one.

    Attributes:
        name: What it is.
        value: The estimate.
        truth: The true number of its kind that lies nearest.
        percent: Distance over the truth [%].
        deviations: Distance over the predicted standard deviation.
    """

    name: str
    value: float
    truth: float
    percent: float
    deviations: float


def band_errors(found: ComplexArray, true: ComplexArray) -> tuple[float, float]:
    """Returns the largest error of magnitudes [%] and of phases [degrees] of a response (n_freq,)."""
    ratio = found / true
    return float(100 * np.max(np.abs(np.abs(ratio) - 1))), float(np.max(np.abs(np.degrees(np.angle(ratio)))))


def root_values(polynomial: tuple[float, ...]) -> list[tuple[str, float, float]]:
    """Returns what says where the roots of a polynomial lie: `rate`, `frequency` or `damping`, size, value."""
    values: list[tuple[str, float, float]] = []
    for root in np.roots(polynomial):
        size = float(abs(root))
        if abs(root.imag) <= _REAL * size:
            values.append(("rate", size, float(-root.real)))
        elif root.imag > 0:
            values += [("frequency", size, size), ("damping", size, float(-root.real) / size)]
    return values


def judge_roots(
    found: list[RootValue],
    numerator: tuple[float, ...],
    denominator: tuple[float, ...],
    band_rad_s: tuple[float, float],
) -> list[RootError]:
    """Judges the poles and zeros inside a band that are said to be well known.

    Args:
        found: The estimates.
        numerator: The true numerator, highest power first.
        denominator: The true denominator.
        band_rad_s: Ends of the band [rad/s].
    """
    true = {"zero": root_values(numerator), "pole": root_values(denominator)}
    low, high = band_rad_s
    errors = []
    for one in found:
        if not (low <= one.size_rad_s <= high and one.relative_std < _JUDGED_BELOW):
            continue
        known = [entry for entry in true[one.kind] if entry[0] == one.what]
        if not known:  # a pair where there are real ones, or the other way round
            errors.append(RootError(one.name, one.value, np.nan, np.inf, np.inf))
            continue
        truth = min(known, key=lambda entry: abs(np.log(entry[1] / one.size_rad_s)))[2]
        off = abs(one.value - truth)
        deviation = one.relative_std * abs(one.value)
        errors.append(RootError(one.name, one.value, truth, 100 * off / abs(truth), off / deviation))
    return errors


def undershoot(step: FloatArray) -> tuple[int, float]:
    """Returns where a step response (n_time,) is lowest and how far it is below zero there, 0 if nowhere."""
    lowest = int(np.argmin(step))
    return lowest, float(max(0.0, -step[lowest]))
