"""Puts together what a rigid fit found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm, t

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.models.rigid.fit.conclusion import HUBER, INSTRUMENTS, LEAST_SQUARES, Conclusion, Verdict, scale_of
from robid.models.rigid.fit.consistency import against_nominal, make_consistent, parameter_scale, pseudo_inertia
from robid.models.rigid.fit.cut_off import CutOffChoice
from robid.models.rigid.fit.expected import Known, expected_error
from robid.models.rigid.fit.options import EstimatorName, PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.regression import HuberRegression, Reduction, Regression, huber_weights, solve_factor
from robid.models.rigid.fit.sizes import rated_torques
from robid.models.rigid.fit.solution import (
    Base,
    Checks,
    Estimators,
    ExpectedError,
    Filtered,
    Gains,
    RigidSolution,
    RowResiduals,
    StandardSet,
    Travel,
)
from robid.results.estimate import Estimate
from robid.robot.description import Robot
from robid.robot.regressor.base import BaseParameters
from robid.robot.regressor.model import RigidModel

_PLACES = {"huber": HUBER, "instruments": INSTRUMENTS}
_NOT_NEGATIVE = ("motor_inertia", "coupling_inertia", "viscous", "coupling_viscous", "coulomb", "coupling_coulomb")
_BODY = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "MX", "MY", "MZ", "M")


@dataclass(frozen=True)
class Found:
    """What all estimators found on the same rows."""

    ordinary: Regression  # least squares with equal weights
    conclusion: Conclusion  # least squares, Huber's estimator and instrumental variables with their joint uncertainty
    swept: tuple[HuberRegression, ...]  # Huber's estimator at the bends of the sweep
    torque: FloatArray  # (n_row, n_joint): filtered torques, NaN where a row does not count
    residual: FloatArray  # (n_row, n_joint): what the chosen estimator leaves of them
    shot: IntArray  # (n_row,): index of the shot that each row is of
    shots: tuple[str, ...]  # name of each shot
    filters: PreprocessingOptions  # filters of the rows
    sampling_period_s: float  # period of the samples [s]

    @property
    def by_name(self) -> dict[EstimatorName, Regression]:
        """The estimators by name, in the order in which they are shown."""
        found: dict[EstimatorName, Regression] = {"ordinary": self.ordinary, "weighted": self.conclusion.least_squares}
        found["huber"] = self.conclusion.huber
        instruments = self.conclusion.instruments
        return found if instruments is None else {**found, "instruments": instruments}

    def known(self, name: EstimatorName) -> Known:
        """Values of one estimator with the covariance of what they predict.

        The long-run covariance holds how errors cancel in torques. Variances scaled one by one do not: where motions
        are poor, parameters that hardly differ would come out with errors of their own.
        """
        own, long_run = self.by_name[name], self.conclusion.long_run
        covariance = self.covariance(name) if name == "ordinary" else long_run.of(_PLACES.get(name, LEAST_SQUARES))
        return Known(own.parameters, covariance, float(long_run.freedom))

    def covariance(self, name: EstimatorName) -> FloatArray:
        """Covariance (n_base, n_base) of one estimator that respects correlated residuals.

        Its variances are the long-run ones; so few degrees of freedom do not determine correlations, which are those
        of the estimator's own formula.
        """
        own, place = self.by_name[name], _PLACES.get(name, LEAST_SQUARES)
        ratio = np.sqrt(np.diag(self.conclusion.long_run.of(place))) / own.standard_deviation
        return np.asarray(own.covariance * np.outer(ratio, ratio))


def make_solution(
    model: RigidModel,
    base: BaseParameters,
    reduced: RigidModel,
    found: Found,
    choice: CutOffChoice,
    travel: Travel,
    options: RigidFitOptions,
    gains: Gains | None = None,
) -> RigidSolution:
    """Puts together what a rigid fit found."""
    name = options.estimator if options.estimator in found.by_name else "weighted"
    estimate = _estimate(model, base, reduced, found, name, options, gains)
    standard = _standard(model, base, estimate, options) if options.physical else None
    decimation = found.filters.decimator(found.sampling_period_s).factor
    reduction = found.conclusion.reduction
    triangle = reduction.weighted(np.ones(len(reduction.n_row)))[:-1, :-1]
    return RigidSolution(
        estimate=estimate,
        base=Base(
            labels=base.labels,
            standard=base.names,
            combination=base.combination,
            silent=base.silent,
            mixed=base.undetermined,
            gap=base.gap,
            condition=found.conclusion.least_squares.condition,
            unscaled_condition=float(np.linalg.cond(triangle)),
            rests_on=resting_on(reduction, found.by_name[name]),
        ),
        estimators=_estimators(found, options.sweep),
        checks=_checks(found.conclusion.verdict),
        filtered=Filtered(
            cut_hz=choice.cut_hz,
            decimation=decimation,
            sampling_period_s=found.sampling_period_s,
            motion_hz=choice.motion_hz,
            band_hz=choice.band_hz,
            trial_hz=choice.trial_hz,
            trial_error=choice.error,
            trial_deviation=choice.deviation,
        ),
        residuals=RowResiduals(
            time_s=np.arange(len(found.torque)) * decimation * found.sampling_period_s,
            torque=found.torque,
            residual=found.residual,
            weight=huber_weights(found.conclusion.residual / found.conclusion.huber.scale, options.huber.bend),
            shot=found.shot,
            shots=found.shots,
        ),
        against_nominal=against_nominal(model, base, estimate, reduction),
        travel=travel,
        expected=_expected(reduced, found, found.known(name), travel, choice),
        standard=standard,
        chosen=name,
        gains=gains,
    )


def body_columns(names: Sequence[str]) -> IntArray:
    """Indices (n_body, 10) of the standard parameters of each body whose ten are all there."""
    at = {name: index for index, name in enumerate(names)}
    owners = dict.fromkeys(name.rpartition(".")[0] for name in names if name.endswith(".M"))
    rows = [[at[f"{owner}.{one}"] for one in _BODY] for owner in owners if f"{owner}.XX" in at]
    return np.array(rows, int).reshape(-1, len(_BODY))


def first_moments(names: Sequence[str]) -> list[list[int]]:
    """Groups the indices of first moments by their body: they are judged as vectors."""
    found: dict[str, list[int]] = {}
    for index, name in enumerate(names):
        owner, _, component = name.rpartition(".")
        if component in ("MX", "MY", "MZ"):
            found.setdefault(owner, []).append(index)
    return list(found.values())


def _estimate(
    model: RigidModel,
    base: BaseParameters,
    reduced: RigidModel,
    found: Found,
    name: EstimatorName,
    options: RigidFitOptions,
    gains: Gains | None,
) -> Estimate:
    chosen, covariance = found.by_name[name], found.covariance(name)
    std = np.sqrt(np.diag(covariance))
    freedom = np.full(std.size, float(found.conclusion.long_run.freedom))
    reach = t.ppf(0.5 + 0.5 * options.confidence, freedom) * std
    quantile, status = norm.ppf(0.5 + 0.5 * options.confidence), chosen.status
    # What predicts is known by the residuals; masses and friction no better than the constants of the motors' torques.
    doubt = torque_doubt(reduced.robot) if gains is None else gains.relative_covariance
    physical = np.hypot(reach, quantile * torque_constant_std(doubt, found.conclusion.reduction, chosen))
    size = scale_of(chosen.parameters, std, first_moments(reduced.names))
    nominal, limit = base.values(model.nominal), options.identifiable_relative_std
    # What the file has as zero is related to what was found, so that it can be identifiable at all.
    stated = np.where(nominal == 0, size, np.abs(nominal))
    identifiable = std / stated <= limit
    zero = physical >= np.abs(chosen.parameters)
    half = physical / np.maximum(np.abs(chosen.parameters), np.finfo(float).tiny)
    told = _undetermined(reduced.names, zero, ~zero & (half > quantile * limit), limit)
    return Estimate(
        names=tuple(reduced.names),
        kinds=tuple(reduced.kinds),
        units=tuple(reduced.units),
        nominal=nominal,
        value=chosen.parameters,
        lower=chosen.parameters - physical,
        upper=chosen.parameters + physical,
        covariance=covariance,
        degrees_of_freedom=freedom,
        confidence=options.confidence,
        interval_rule="residuals correlated in time and between joints",
        relative_std=std / size,
        predicted_relative_std=std / stated,
        prior_relative_std=np.full(std.size, np.inf),
        relative_half_width=half,
        identifiable=identifiable,
        identifiable_relative_std=limit,
        undetermined=told,
        status=status,
        advice="" if status == "converged" else _unsettled(name),
        effective_value=chosen.parameters,
        effective_lower=chosen.parameters - reach,
        effective_upper=chosen.parameters + reach,
    )


def resting_on(reduction: Reduction, estimate: Regression) -> IntArray:
    """Returns the index of the motor (n_param,) whose torque tells most of each parameter.

    The covariance `C` of weighted least squares is `C (sum_j W_j' V_j W_j) C`, to which each motor adds its part.
    """
    _, inverse, _ = solve_factor(reduction.weighted(estimate.weights))
    parts = reduction.factors[:, :, :-1] @ inverse
    share = np.einsum("jra,jra->ja", parts, parts) * estimate.weights[:, None]
    return np.asarray(np.argmax(share, axis=0))


def torque_doubt(robot: Robot) -> FloatArray:
    """Covariance (n_joint, n_joint) of the shares by which torque constants are off, as the robot file doubts them."""
    return np.diag([joint.nuisance_std.torque_relative_std**2 for joint in robot.joints])


def torque_constant_std(doubt: FloatArray, reduction: Reduction, estimate: Regression) -> FloatArray:
    """Returns how far parameters (n_param,) may be off because motors' torque constants are, standard deviations.

    A torque that is by a share `d_j` too large, of covariance `doubt` (n_joint, n_joint), moves the parameters by
    `(W' V W)^-1 W_j' V_j y_j d_j`, with the weights V; currents have no constant that could be off.
    """
    _, inverse, _ = solve_factor(reduction.weighted(estimate.weights))
    factors = reduction.factors
    moves = np.einsum("jra,jr->ja", factors[:, :, :-1], factors[:, :, -1]) * estimate.weights[:, None] @ inverse
    return np.asarray(np.sqrt(np.einsum("ja,jk,ka->a", moves, doubt, moves)))


def _undetermined(names: Sequence[str], zero: BoolArray, wide: BoolArray, limit: float) -> tuple[str, ...]:
    """Which parameters (n_param,) are not told from zero, and which are hardly known."""
    rows = ((f"Known to no better than {limit:.0%}", wide), ("Not distinguished from zero", zero))
    listed = (
        (told, [name for name, is_so in zip(names, which.tolist(), strict=True) if is_so]) for told, which in rows
    )
    return tuple(f"{told}: {', '.join(found)}" for told, found in listed if found)


def _unsettled(name: EstimatorName) -> str:
    """What to try where an estimator has not converged."""
    if name in ("ordinary", "weighted"):
        return "the motors' weights have not settled: the motion is too poor, record a richer one"
    setting = "huber" if name == "huber" else "convergence"
    return f"the {name} estimate has not converged: raise `{setting}.iteration_limit`, or record a richer motion"


def _estimators(found: Found, bends: Sequence[float]) -> Estimators:
    every = found.by_name
    return Estimators(
        names=tuple(every),
        values=np.array([each.parameters for each in every.values()]),
        std=np.array([each.standard_deviation for each in every.values()]),
        deviation=np.array([each.deviation for each in every.values()]),
        iterations=np.array([each.iterations for each in every.values()]),
        status=tuple(each.status for each in every.values()),
        bends=np.array(bends, float),
        bent=np.array([each.parameters for each in found.swept]).reshape(-1, found.ordinary.parameters.size),
    )


def _checks(verdict: Verdict) -> Checks:
    against = verdict.instruments
    return Checks(
        trust=verdict.trust,
        sentence=verdict.sentence,
        huber_variation=verdict.huber.relative,
        huber_p=verdict.huber.p_value,
        instrument_variation=None if against is None else against.relative,
        instrument_p=None if against is None else against.p_value,
        skewness=np.array([joint.skewness for joint in verdict.normality]),
        excess_kurtosis=np.array([joint.excess_kurtosis for joint in verdict.normality]),
        outlier_share=np.array([joint.outlier_share for joint in verdict.normality]),
        normality_p=np.array([joint.p_value for joint in verdict.normality]),
        correlation=np.array([joint.correlation for joint in verdict.whiteness]),
        whiteness_p=np.array([joint.p_value for joint in verdict.whiteness]),
        odd=verdict.normality_alarm,
        coloured=verdict.whiteness_alarm,
        huber_differs=verdict.huber.alarm,
        instruments_differ=against is not None and against.alarm,
        untested=verdict.untested,
    )


def _expected(reduced: RigidModel, found: Found, known: Known, travel: Travel, choice: CutOffChoice) -> ExpectedError:
    """Errors of the torques that the covariance and the residuals promise on other motions."""
    rms = np.sqrt(np.nanmean(found.torque**2, axis=0))
    left = np.sqrt(np.nanmean(found.conclusion.residual**2, axis=0))
    rated = rated_torques(reduced.robot, rms)
    size = rated.size(rms)
    # What is left on pieces that the parameters never saw; noise of the fit's own rows, whose band may be wider, too.
    unseen = np.fmax(choice.left_out, left)
    error, bound = expected_error(reduced.robot, reduced, known, travel, unseen, size)
    # In the band of the motion, where that is known: noise beyond it is no error of the model.
    residual = np.where(np.isnan(choice.residual), left, choice.residual)
    return ExpectedError(error, bound, choice.left_out / size, residual / size, rated.torque_nm, rated.stated)


def _standard(
    model: RigidModel, base: BaseParameters, estimate: Estimate, options: RigidFitOptions
) -> StandardSet | None:
    """The real bodies nearest to the robot file's with the estimated base parameters."""
    bodies, nominal = body_columns(model.names), model.nominal
    real = np.array([np.linalg.eigvalsh(pseudo_inertia(nominal[body])).min() > 0 for body in bodies], bool)
    if not len(bodies) or not real.all():
        return None
    held = [index for index, kind in enumerate(model.kinds) if kind in _NOT_NEGATIVE]
    found = estimate.value, estimate.covariance, base.combination, nominal, bodies
    made = make_consistent(*found, held, options.consistency, _scale(model, bodies))
    return StandardSet(
        names=tuple(model.names),
        units=tuple(model.units),
        nominal=nominal,
        value=made.standard,
        covariance=made.gain @ estimate.covariance @ made.gain.T,
        moved=made.moved,
        real=real,
        status=made.status,
    )


def _scale(model: RigidModel, bodies: IntArray) -> FloatArray:
    """What changes (n_std,) of the standard parameters are measured by.

    What a motor and a link show together goes to the link: data sheets know rotors well.
    """
    nominal = model.nominal
    scale = parameter_scale(nominal, bodies)
    known = {f"{joint.name}.motor_inertia": joint.motor.inertia_relative_std for joint in model.robot.joints}
    rotors = [index for index, kind in enumerate(model.kinds) if kind == "motor_inertia"]
    # A rotor of which the robot file states nothing, or no inertia, is measured as any other number.
    stated = [(index, known[model.names[index]] * nominal[index]) for index in rotors]
    for index, size in stated:
        scale[index] = size if size > 0 else scale[index]
    return scale
