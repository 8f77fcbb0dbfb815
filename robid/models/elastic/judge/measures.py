"""What a model is held to on its fit's own data and on data that the fit never saw: absolute figures, with limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.models.elastic.judge.extrema import resonance_shifts
from robid.models.elastic.judge.fitted import FittedModel
from robid.results.doubt import Doubt, two_digits

COST_RATIO_LIMIT = 1.5
_MEDIAN_LIMIT_DB = 1.0
_MEDIAN_LIMIT_DEG = 7.0
_RESONANCE_LIMIT = 0.03
_MIN_ASSUMED = 0.02


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
        return self.cost_failures("the validation") + tuple(told for told, _ in self._misses())

    def cost_failures(self, data: str) -> tuple[str, ...]:
        """Whether the error of these data costs too much, at most one clause."""
        ratio = float(self.error_ratio.max())
        if ratio <= COST_RATIO_LIMIT:
            return ()
        place = f" in configuration {int(np.argmax(self.error_ratio)) + 1}" if len(self.error_ratio) > 1 else ""
        return (
            f"the error{place} of {data} costs {two_digits(ratio)} times what noise and the assumed model error "
            f"allow, limit {COST_RATIO_LIMIT:g}",
        )

    def doubts(self, data: str) -> tuple[Doubt, ...]:
        """A decisive doubt where responses or resonances of these data are missed, whatever noise they have."""
        misses = self._misses()
        told = f"in {data}, {' and '.join(clause for clause, _ in misses)}"
        return (Doubt("model", told, decisive=True, strength=max(far for _, far in misses)),) if misses else ()

    def _misses(self) -> list[tuple[str, float]]:
        """What of responses and resonances is beyond its limit, a clause each, and how many times the limit it is."""
        limits = (
            ("a motor's own response is off by", self.motor_error_db, _MEDIAN_LIMIT_DB, "dB in the median"),
            ("a motor's own response is off by", self.motor_error_deg, _MEDIAN_LIMIT_DEG, "degrees in the median"),
            ("resonances are off by", 100 * (self.resonance_shift or 0.0), 100 * _RESONANCE_LIMIT, "% in the median"),
        )
        return [
            (f"{what} {two_digits(value)} {unit}, limit {limit:g}", value / limit)
            for what, value, limit, unit in limits
            if value > limit
        ]


def measure(fitted: FittedModel, modelled: ComplexArray, model_error: float) -> Measures:
    """Measures a fitted model against the responses that it is set against.

    Args:
        fitted: The model and the responses.
        modelled (n_conf, n_freq, n_out, n_in): Its own response there.
        model_error: Relative model error that the weights declare; at least 2 % are assumed.
    """
    own, shifts = own_errors(fitted, modelled), resonance_shifts(fitted)
    return Measures(
        error_ratio=error_ratios(fitted, modelled, max(model_error, _MIN_ASSUMED)),
        motor_error_db=float(np.nanmax(own.by_motor(own.decibel), initial=0.0)),
        motor_error_deg=float(np.nanmax(own.by_motor(own.degrees), initial=0.0)),
        resonance_shift=float(np.median(shifts)) if shifts.size else None,
        resonances=int(shifts.size),
    )


def error_ratios(fitted: FittedModel, modelled: ComplexArray, assumed: float) -> FloatArray:
    """Mean squared relative error of each configuration (n_conf,) over noise and an assumed relative model error.

    The weights of the fit choose the elements that count, but not how much: so all fits are held to the same.
    """
    problem = fitted.problem
    used = problem.weight > 0
    shown = np.where(used, modelled, 1.0)
    error = np.abs(np.log(np.where(used, fitted.measured, 1.0) / shown)) ** 2
    allowed = problem.frf.element_variance() / np.abs(shown) ** 2 + assumed**2
    sums: FloatArray = np.where(used, error / allowed, 0.0).sum(axis=(1, 2, 3))
    return np.asarray(sums / np.maximum(used.sum(axis=(1, 2, 3)), 1))


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
    frf = fitted.problem.frf
    seen = np.array([name in frf.output_names for name in frf.input_names])
    own, motors = (
        [frf.output_names.index(name) if name in frf.output_names else 0 for name in frf.input_names],
        np.arange(seen.size),
    )
    ratio = fitted.measured[..., own, motors] / modelled[..., own, motors]
    used = (fitted.problem.weight[..., own, motors] > 0) & seen
    decibel = np.where(used, np.abs(20 * np.log10(np.abs(ratio))), np.nan)
    return OwnErrors(decibel, np.where(used, np.abs(np.angle(ratio, deg=True)), np.nan))


def _median(error: FloatArray) -> FloatArray:
    """Median over the lines (n_conf, n_in); NaN for a motor whose lines all lack weight."""
    empty: BoolArray = np.all(np.isnan(error), axis=1)
    filled = np.where(np.expand_dims(empty, 1), 0.0, error)
    return np.asarray(np.where(empty, np.nan, np.nanmedian(filled, axis=1)))
