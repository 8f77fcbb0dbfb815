"""What a model is held to, absolute figures with limits, and the grades of fits and validations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.clusters.evidence import group_clusters
from robid.models.elastic.fit.intervals import FEWEST_CLUSTERS
from robid.models.elastic.fit.model_error import ModelError
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.extrema import resonance_shifts
from robid.models.elastic.judge.fitted import FittedModel
from robid.results.finding import Finding, two_digits
from robid.results.grade import Grade, grade_alone, grade_held, undetermined_names

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
        where = f" in configuration {int(np.argmax(self.error_ratio)) + 1}" if len(self.error_ratio) > 1 else ""
        return (
            f"the error{where} of {data} costs {two_digits(ratio)} times what noise and the assumed model error "
            f"allow, limit {COST_RATIO_LIMIT:g}",
        )

    def findings(self, data: str) -> tuple[Finding, ...]:
        """A decisive finding where responses or resonances of these data are missed, whatever noise they have."""
        misses = self._misses()
        told = f"in {data}, {' and '.join(clause for clause, _ in misses)}"
        return (Finding("model", told, decisive=True, strength=max(far for _, far in misses)),) if misses else ()

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
    measured = np.where(used, fitted.measured, 1.0)
    # What never moved is off by as much as numbers hold.
    error = np.abs(np.log(np.where(measured == 0, np.finfo(float).tiny, measured) / shown)) ** 2
    allowed = problem.frf.element_variance() / np.abs(shown) ** 2 + assumed**2
    sums: FloatArray = np.where(used, error / allowed, 0.0).sum(axis=(1, 2, 3))
    return np.asarray(sums / np.maximum(used.sum(axis=(1, 2, 3)), 1))


@dataclass(frozen=True)
class OwnErrors:
    """Errors of the motors' own responses; NaN where an element has no weight."""

    decibel: FloatArray  # (n_conf, n_freq, n_in) Of the magnitude [dB]
    degrees: FloatArray  # (n_conf, n_freq, n_in) Of the phase [deg]

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
    # A motor that never moved is off by as much as numbers hold.
    size = np.maximum(np.abs(ratio), np.finfo(float).tiny)
    decibel = np.where(used, np.abs(20 * np.log10(size)), np.nan)
    return OwnErrors(decibel, np.where(used, np.abs(np.angle(ratio, deg=True)), np.nan))


def _median(error: FloatArray) -> FloatArray:
    """Median over the lines (n_conf, n_in); NaN for a motor whose lines all lack weight."""
    empty: BoolArray = np.all(np.isnan(error), axis=1)
    filled = np.where(np.expand_dims(empty, 1), 0.0, error)
    return np.asarray(np.where(empty, np.nan, np.nanmedian(filled, axis=1)))


FLOOR = 0.001  # relative errors below move no spring by more than its interval
_EXPECTED, _SIGNIFICANT = 0.05, 3.0  # share of a right model's elements beyond their band, and deviations of it
_MISFIT_LIMIT = 1.5
_DROPPED_LIMIT = 0.5
_WIDE = 1.0


def grade_fit(solution: ElasticSolution, findings: Sequence[Finding], failures: Sequence[str] = ()) -> Grade:
    """Grades a fit that was held against nothing but its own data: it predicts at best.

    Args:
        solution: What the fit found.
        findings: Findings about its data, its parameters and its residual, the first to blame first.
        failures: What of its own data is beyond the limits of a validation, a clause each.
    """
    return grade_alone((*_unusable(solution, findings), *failures), _doubtful(solution, findings), findings)


def grade_validation(solution: ElasticSolution, findings: Sequence[Finding], failures: Sequence[str]) -> Grade:
    """Grades a fit that was held against data that it never saw; arguments as of `grade_fit`."""
    unusable = (*_unusable(solution, findings), *failures)
    return grade_held(unusable, _doubtful(solution, findings), findings, undetermined_names(solution.estimate))


def _unusable(solution: ElasticSolution, findings: Sequence[Finding]) -> tuple[str, ...]:
    """Why a fit must not be used, whatever it was held against."""
    found = [finding.message for finding in findings if finding.decisive]
    if solution.estimate.status != "converged":
        found.append("the fit has not converged")
    share = solution.costs.dropped / solution.costs.told
    if share > _DROPPED_LIMIT:
        found.append(f"{share:.0%} of the response lies below 10 dB")
    springs = np.array([kind == "stiffness" for kind in solution.estimate.kinds])
    chosen = springs if springs.any() else np.ones(springs.size, bool)
    half = (
        0.5
        * (solution.estimate.upper - solution.estimate.lower)[chosen]
        / np.maximum(np.abs(solution.estimate.value[chosen]), 1e-300)
    )
    if not (half < _WIDE).any():
        found.append(f"no {'spring' if springs.any() else 'parameter'} is known to better than its own size")
    return tuple(found)


def _doubtful(solution: ElasticSolution, findings: Sequence[Finding]) -> tuple[str, ...]:
    """Why single parameters may be off by more than their intervals say."""
    found = [finding.message for finding in findings if not finding.decisive and finding.strength > 1]
    if solution.misfit > _MISFIT_LIMIT:
        found.append(
            f"the residual costs {two_digits(solution.misfit)} times what noise and the assumed model error allow"
        )
    alone = _known_alone(solution)
    few = _too_few(len(group_clusters(solution.responses.configurations)))
    if few:
        found.append(few)
    elif alone:
        found.append(f"a single cluster of configurations determines {', '.join(alone)}: the others do not test it")
    error = solution.model_error
    if error is not None:
        above, correlated = telling_shares(error)
        if above > share_limit(error.count):
            found.append(
                f"the residuals of {above:.0%} of the response's elements are beyond their covariance and those of "
                f"{correlated:.0%} correlated over frequency, by more than {FLOOR:.1%} of the response"
            )
    return tuple(found)


def _too_few(clusters: int) -> str:
    """Why so few clusters do not show what parameters differ by between them, with how many more do."""
    missing = FEWEST_CLUSTERS - clusters
    if missing <= 0:
        return ""
    measured = (
        "all was measured in a single cluster of configurations"
        if clusters == 1
        else f"all was measured in {clusters} clusters of configurations"
    )
    more = f"{missing} more {'configuration' if missing == 1 else 'configurations'}"
    return (
        f"{measured}, and fewer than {FEWEST_CLUSTERS} do not show by how much the model's parameters differ from one "
        f"to another: measure {more}"
    )


def _known_alone(solution: ElasticSolution) -> list[str]:
    """Identified springs that one cluster knows."""
    estimate = solution.estimate
    if solution.effective is None:
        return []
    columns = estimate.names, estimate.kinds, estimate.identified & solution.effective.untested
    return [name for name, kind, alone in zip(*columns, strict=True) if kind == "stiffness" and alone]


def is_unexplained(solution: ElasticSolution) -> bool:
    """Whether a residual holds so much more than noise that its cause is worth a search."""
    error = solution.model_error
    if solution.misfit > _MISFIT_LIMIT:
        return True
    return error is not None and telling_shares(error)[0] > share_limit(error.count)


def share_limit(count: int) -> float:
    """Share of so many elements, telling ones beyond their covariance, that a right model hardly ever has."""
    count = max(count, 1)
    return _EXPECTED + _SIGNIFICANT * float(np.sqrt(_EXPECTED * (1 - _EXPECTED) / count))


def telling_shares(error: ModelError) -> tuple[float, float]:
    """Shares of the elements above their band, and correlated over frequency, by more than moves any spring."""
    known = np.isfinite(error.ratio)
    if not known.any():
        return 0.0, 0.0
    large = error.level > FLOOR
    above, correlated = (error.ratio > error.limit) & large, (error.correlation > error.correlation_limit) & large
    return float(above[known].mean()), float(correlated[known].mean())
