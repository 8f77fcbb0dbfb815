"""What is kept of an identified channel, and how it is held against the true one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import ComplexArray, FloatArray, Quantity

CONFIDENCE = 0.97  # Level of the paper's bounds


@dataclass(frozen=True)
class Tried:
    """One structure that was tried."""

    poles: int
    zeros: int
    delay_samples: int
    bic: float  # Bayesian information criterion
    whiteness_p: float  # Chance of white residuals to look as correlated
    chosen: bool  # Whether it was taken


@dataclass(frozen=True)
class Quality:
    """Table 2's measures on the validation."""

    r2: float  # Coefficient of determination
    nrmse: float  # Normalised root mean square error, 1 where all is explained
    fpe: float  # Akaike's final prediction error, in the paper's units squared [mm^2 or degrees^2]


@dataclass(frozen=True)
class Identified:
    """One channel, identified from one seed's noise."""

    numerator: Annotated[FloatArray, Quantity("rad/s, powers", "power", "Estimate, highest power of s first")]
    denominator: Annotated[FloatArray, Quantity("rad/s, powers", "power", "As the numerator")]
    covariance: Annotated[
        FloatArray, Quantity("SI", "parameter parameter", "Of the coefficients, the first below left out")
    ]
    delay_samples: int  # Estimated delay
    reason: str  # Why this structure
    status: str  # How the fit ended
    roots: Annotated[tuple[RootValue, ...], Quantity("as named", "root", "Poles and zeros")]
    undetermined: Annotated[
        tuple[str, ...], Quantity("1", "sentence", "What the data do not determine, a sentence each")
    ]
    tried: Annotated[tuple[Tried, ...], Quantity("as named", "structure", "The structures that were tried")]
    quality: Quality  # On the validation
    frequency_hz: Annotated[FloatArray, Quantity("Hz", "frequency", "Frequencies of the responses")]
    response: Annotated[ComplexArray, Quantity("1", "frequency", "From samples to samples: hold, average and delay")]
    continuous: Annotated[ComplexArray, Quantity("1", "frequency", "Of its transfer function, with the delay")]
    relative_std: Annotated[FloatArray, Quantity("1", "frequency", "Predicted relative deviation of the magnitude")]
    phase_std: Annotated[FloatArray, Quantity("rad", "frequency", "Predicted deviation of the phase")]
    etfe_hz: Annotated[FloatArray, Quantity("Hz", "etfe", "Frequencies of the empirical response")]
    etfe: Annotated[ComplexArray, Quantity("1", "etfe", "Empirical response")]
    etfe_radius: Annotated[FloatArray, Quantity("1", "etfe", "Its confidence radius")]
    command: Annotated[FloatArray, Quantity("m or rad", "sample", "The validation's chirp", compact=True)]
    measured: Annotated[FloatArray, Quantity("m or rad", "sample", "Mean of the repeats", compact=True)]
    simulated: Annotated[FloatArray, Quantity("m or rad", "sample", "What the estimate says", compact=True)]
    bound: Annotated[
        FloatArray, Quantity("m or rad", "sample", "Half width of its interval of `CONFIDENCE`", compact=True)
    ]
    step_s: Annotated[FloatArray, Quantity("s", "step", "Times since a unit step of the command: every sample")]
    step: Annotated[FloatArray, Quantity("1", "step", "What the estimate answers, without the moving average")]
    step_std: Annotated[FloatArray, Quantity("1", "step", "Its predicted deviation")]


_JUDGED_BELOW = 0.005  # predicted relative deviation
_REAL = 1e-9
_KNOWN = 0.2  # predicted relative deviation beyond which a number is as good as unknown
_SAME, _CANCELLED = 0.1, 0.05  # relative distance
_WORDS = {"rate": "of rate", "frequency": "pair of natural frequency"}


@dataclass(frozen=True)
class RootValue:
    """A number that says where a pole or a zero lies."""

    name: str  # What it is, as in `pole2.damping`
    kind: str  # `pole` or `zero`
    what: str  # `rate` of a real one, `frequency` or `damping` of a pair
    size_rad_s: float  # Distance of the pole or zero from the origin [rad/s]
    value: float
    relative_std: float  # Its predicted standard deviation over it


@dataclass(frozen=True)
class RootError:
    """How far such a number is from the true one."""

    name: str  # What it is
    value: float  # The estimate
    truth: float  # The true number of its kind that lies nearest
    percent: float  # Distance over the truth [%]
    deviations: float  # Distance over the predicted standard deviation


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
    """Judges the poles and zeros inside a band [rad/s] that are said to be well known.

    True numerator and denominator have the highest power first.
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


def undetermined_roots(
    found: Sequence[RootValue], numerator: tuple[float, ...], denominator: tuple[float, ...], nyquist_rad_s: float
) -> tuple[str, ...]:
    """Names the true poles and zeros that the estimate does not show, each with what hides it.

    True numerator and denominator have the highest power first; Nyquist's is half the sampling rate [rad/s].
    """
    true = {"zero": root_values(numerator), "pole": root_values(denominator)}
    told = []
    for kind, other in (("pole", "zero"), ("zero", "pole")):
        for what, size, value in true[kind]:
            estimates = [one for one in found if (one.kind, one.what) == (kind, what) and one.relative_std < _KNOWN]
            if what not in _WORDS or any(abs(one.value / value - 1) < _SAME for one in estimates):
                continue
            cause = "the data do not tell it from a simpler structure"
            if size > nyquist_rad_s:
                cause = f"it lies above the Nyquist frequency of {nyquist_rad_s:.4g} rad/s"
            elif any(one[0] == what and abs(one[2] / value - 1) < _CANCELLED for one in true[other]):
                cause = f"a {other} nearly cancels it"
            told.append(f"the true {kind} {_WORDS[what]} {value:.4g} rad/s is not determined: {cause}")
    return tuple(told)


def undershoot(step: FloatArray) -> tuple[int, float]:
    """Returns where a step response (n_time,) is lowest and how far it is below zero there, 0 if nowhere."""
    lowest = int(np.argmin(step))
    return lowest, float(max(0.0, -step[lowest]))
