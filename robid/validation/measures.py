"""What a model is held to on data that its fit never saw: absolute figures, each with its limit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.validation.doubt import plain
from robid.validation.fitted import FittedModel

COST_RATIO_LIMIT = 1.5
_MEDIAN_LIMIT_DB = 1.0
_MEDIAN_LIMIT_DEG = 7.0
_RESONANCE_LIMIT = 0.03


@dataclass(frozen=True)
class Measures:
    """What a model is held to, as in `Validation`."""

    error_ratio: FloatArray
    motor_error_db: float
    motor_error_deg: float
    resonance_shift: float | None
    resonances: int

    def failures(self) -> tuple[str, ...]:
        """What is beyond its limit, a clause each."""
        ratio, found = float(self.error_ratio.max()), []
        if ratio > COST_RATIO_LIMIT:
            place = f" in configuration {int(np.argmax(self.error_ratio)) + 1}" if len(self.error_ratio) > 1 else ""
            found.append(
                f"the error{place} of the validation costs {plain(ratio)} times what noise and the assumed model error "
                f"allow, limit {COST_RATIO_LIMIT:g}"
            )
        limits = (
            ("a motor's own response is off by", self.motor_error_db, _MEDIAN_LIMIT_DB, "dB in the median"),
            ("a motor's own response is off by", self.motor_error_deg, _MEDIAN_LIMIT_DEG, "degrees in the median"),
            ("resonances are off by", 100 * (self.resonance_shift or 0.0), 100 * _RESONANCE_LIMIT, "% in the median"),
        )
        return (
            *found,
            *(f"{what} {plain(value)} {unit}, limit {limit:g}" for what, value, limit, unit in limits if value > limit),
        )


def error_ratios(fitted: FittedModel, modelled: ComplexArray, assumed: float) -> FloatArray:
    """Mean squared relative error of each configuration (n_conf,) over noise and an assumed relative model error.

    The weights of the fit choose the elements that count, but not how much: so all fits are held to the same.
    """
    problem = fitted.problem
    used = problem.weight > 0
    error = np.abs(np.log(np.where(used, fitted.measured / modelled, 1.0))) ** 2
    allowed = problem.frf.element_variance() / np.abs(modelled) ** 2 + assumed**2
    sums: FloatArray = np.where(used, error / allowed, 0.0).sum(axis=(1, 2, 3))
    return np.asarray(sums / used.sum(axis=(1, 2, 3)))


@dataclass(frozen=True)
class OwnErrors:
    """Errors of the motors' own responses; NaN where an element has no weight.

    Attributes:
        decibel (n_conf, n_freq, n_in): Of the magnitude [dB].
        degrees (n_conf, n_freq, n_in): Of the phase [deg].
    """

    decibel: FloatArray
    degrees: FloatArray

    @property
    def by_configuration(self) -> FloatArray:
        """Median magnitude error (n_conf, n_in) over the lines [dB]; NaN for a motor without any."""
        return _median(self.decibel)

    def by_motor(self, errors: FloatArray) -> FloatArray:
        """Median (n_in,) over lines and configurations; NaN for a motor without any."""
        return np.asarray(_median(errors.reshape(1, -1, errors.shape[-1]))[0])


def own_errors(fitted: FittedModel, modelled: ComplexArray) -> OwnErrors:
    """Errors of the motors' own responses."""
    own = np.arange(modelled.shape[3])
    ratio = fitted.measured[..., own, own] / modelled[..., own, own]
    used = fitted.problem.weight[..., own, own] > 0
    decibel = np.where(used, np.abs(20 * np.log10(np.abs(ratio))), np.nan)
    return OwnErrors(decibel, np.where(used, np.abs(np.angle(ratio, deg=True)), np.nan))


def _median(error: FloatArray) -> FloatArray:
    """Median over the lines (n_conf, n_in); NaN for a motor whose lines all lack weight."""
    empty: BoolArray = np.all(np.isnan(error), axis=1)
    filled = np.where(np.expand_dims(empty, 1), 0.0, error)
    return np.asarray(np.where(empty, np.nan, np.nanmedian(filled, axis=1)))
