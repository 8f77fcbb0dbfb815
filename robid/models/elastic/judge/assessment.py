"""Everything that speaks against a fit, from its data, its parameters and its residual."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import takewhile

import numpy as np

from robid.arrays import FloatArray
from robid.frf.frf import Frf
from robid.models.elastic.fit.nuisance.effects import LoadFriction
from robid.models.elastic.fit.nuisance.listing import estimated_nuisances
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import without_coefficients
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.judge.causes import misfit_findings
from robid.models.elastic.judge.fitted import FittedModel, fitted_model
from robid.models.elastic.judge.friction import with_friction_remedies
from robid.models.elastic.judge.grading import grade_fit, is_unexplained, measure
from robid.models.elastic.judge.hidden import FAR, hidden_findings
from robid.models.elastic.judge.outstanding import outstanding_findings
from robid.models.elastic.judge.plausible_parameters import fitted_carrier, parameter_findings
from robid.models.elastic.judge.power import detectable_defects
from robid.results.estimate import Estimate
from robid.results.finding import Finding, two_digits
from robid.results.grade import Grade, ordered
from robid.results.plausible.evidence import Evidence, gather_evidence
from robid.results.plausible.findings import data_findings
from robid.results.plausible.hypotheses import Hypothesis, Named, hypotheses_of
from robid.results.plausible.scales import named_finding
from robid.robot.description import Robot

_CLEAR = 10.0
"""Power over variance from which an element counts as seen (10 dB)."""

_LEAST_SHARE = 0.01
"""Of what moves the motors themselves, from which motion by another motor's torque matters."""

_FEW = 3


def uncoupled_findings(fitted: FittedModel) -> tuple[Finding, ...]:
    """A finding where a model lets no torque of one motor move another where the data show that it does.

    No logarithm compares a response with zero, so no residual tells of it.
    """
    problem, frf = fitted.problem, fitted.problem.frf
    never = problem.model_response(fitted.internal) == 0
    if not never.any():
        return ()
    power, variance = np.abs(frf.response) ** 2, frf.element_variance()
    seen = never & np.isfinite(variance) & (variance > 0) & (power > _CLEAR * variance)
    rows = [frf.output_names.index(name) if name in frf.output_names else None for name in frf.input_names]
    found = []
    for column, name in enumerate(frf.input_names):
        for at, row in enumerate(rows):
            own = rows[column]
            if row is None or own is None or seen[..., row, column].sum() < _FEW:
                continue
            both = power[..., row, at] * power[..., own, column]
            share = np.sqrt(np.median((power[..., row, column] / np.sqrt(both))[seen[..., row, column]]))
            found.append((float(share), name, frf.input_names[at]))
    share, name, other = max(found, default=(0.0, "", ""))
    told = (
        f"the torque of {name} moves {other} by {two_digits(100 * share)} % of what moves them themselves, and nothing "
        "in the model couples them"
    )
    return (Finding("missing_spring", told, decisive=False, strength=share / _LEAST_SHARE),) if found else ()


_KINDS = ("motor_inertia", "link_inertia", "stiffness", "damping")
_LEAST = 4
_KNOWN = 0.2
_FLOOR, _SCATTER = 0.05, 0.25
_LEAST_GAIN = 6.0
_ALIKE = 2.0


def common_factor_findings(robot: Robot, frf: Frf, estimate: Estimate) -> tuple[Finding, ...]:
    """Returns the wrong scale by which all estimates are off from the robot file, if there is one.

    With `x` the logarithms of estimates over the file's values, their scatter about the factor's is held against that
    about zero: a ratio of likelihoods of normal variates of unknown variance, `n log(s_0/s_F)`.
    """
    ratios, evidence = _log_ratios(estimate), gather_evidence(frf)
    if ratios is None or not evidence.belongs_to(robot) or evidence.torque_unit != "N m":
        return ()
    n_motor = len(evidence.names)
    none, found = float(np.sqrt(np.mean(ratios**2))), []
    for each in _hypotheses(robot, evidence):
        scatter = float(np.sqrt(np.mean((ratios - _effect(each, n_motor)) ** 2)))
        gain = len(ratios) * float(np.log(none / max(scatter, _FLOOR))) - 0.5 * each.penalty
        if scatter < _SCATTER and gain > _LEAST_GAIN:
            found.append((gain, each))
    if not found:
        return ()
    found.sort(key=lambda one: -one[0])
    best, first = found[0]
    alike = {each.scales: each for gain, each in reversed(found) if best - gain < _ALIKE}
    # The first one's factor as the parameters show it.
    sign = float(np.sign(_effect(first, n_motor) * first.log[np.argmax(np.abs(first.log))]))
    middle, std = sign * float(ratios.mean()), float(ratios.std(ddof=1)) / np.sqrt(len(ratios))
    low, size, high = (float(np.exp(middle + side * 1.96 * std)) for side in (-1, 0, 1))
    named = Named(tuple(reversed(alike.values())), (size, low, high), best / _LEAST_GAIN)
    return (named_finding(named, "the robot file's inertias, springs and dampers say, all by one factor"),)


def _log_ratios(estimate: Estimate) -> FloatArray | None:
    """Logarithms of what is known well over the robot file's; None where too little is, or no rotor among it."""
    kinds, value, nominal = np.array(estimate.kinds), estimate.value, estimate.nominal
    usable = np.isin(kinds, _KINDS) & (nominal > 0) & (value > 0) & (estimate.relative_half_width < _KNOWN)
    rotors = kinds[usable] == "motor_inertia"
    if usable.sum() < _LEAST or not rotors.any() or rotors.all():
        return None
    return np.asarray(np.log(value[usable] / nominal[usable]))


def _hypotheses(robot: Robot, evidence: Evidence) -> list[Hypothesis]:
    """Mistakes of all torques alike, or of all motions, which parameters show by one factor."""
    joints = evidence.joints(robot)
    constants = [robot.joints[index].motor.torque_constant_nm_a for index in joints]
    stated = np.array([np.nan if one is None else one for one in constants])
    listed = hypotheses_of(evidence.names, evidence.moved, robot.gear_ratio[joints], stated)
    return [each for each in listed if _is_common(each, len(joints))]


def _is_common(hypothesis: Hypothesis, n_motor: int) -> bool:
    torque, motion = hypothesis.log[:n_motor], hypothesis.log[n_motor:-1]
    is_one = np.ptp(torque) < _FLOOR and np.ptp(motion) < _FLOOR
    return bool(is_one and hypothesis.log[-1] == 0 and abs(_effect(hypothesis, n_motor)) > 0)


def _effect(hypothesis: Hypothesis, n_motor: int) -> float:
    """Logarithm of what parameters come out by: torques raise them, motions lower them."""
    return float(hypothesis.log[:n_motor].mean() - hypothesis.log[n_motor:-1].mean())


def assess_fit(robot: Robot, solution: ElasticSolution, frf: Frf, options: ElasticOptions, delay_s: float) -> Grade:
    """Gathers the findings about a fit and grades it by itself.

    Where units or other scales are wrong, nothing else is looked for: all of it would be their doing.

    Else first to blame is what data alone decide, then a delay, which a fit reads from the phases, then what explains
    the residual, then the rest: parameters that cannot be are mostly the residual's doing. Causes of the residual are
    looked for only where it holds more than noise explains; else what noise may hide counts, last. Where none is
    found, a drift that it plainly follows is told, or one defect that is much of it.

    The fit's own data are held to the limits of a validation. Responses or resonances beyond them are a decisive
    finding, which a validation takes over. What the error costs decides only here: where new data are predicted within
    the limit, a residual that costs more is one finding among others.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        solution: What the fit found.
        frf: The response that it was fitted to.
        options: Options of the fit.
        delay_s: Nominal delay of the fit, hold excluded [s].

    Returns:
        The grade of the fit alone; with a validation, `grade_validation` takes its findings.
    """
    seen = data_findings(robot, frf, delay_s, fitted_carrier(robot, solution.estimate))
    if not any(finding.scales for finding in seen):
        seen = (*common_factor_findings(robot, frf, solution.estimate), *seen)
    if any(finding.scales for finding in seen):
        return grade_fit(solution, ordered(seen))
    read = _parameter_findings(robot, solution.estimate, frf, options)
    timing = [finding for finding in read if finding.cause in ("delay", "samples")]
    findings = [finding for finding in seen if finding.decisive] + timing
    used = frf if options.correct_torques else without_coefficients(frf)
    fitted = fitted_model(robot, solution, used, options, delay_s)
    unexplained = is_unexplained(solution)
    causes = misfit_findings(solution, fitted) if unexplained else ()
    solution = solution if causes else _with_detectable(robot, solution, frf, options, delay_s)
    findings += causes or outstanding_findings(fitted, solution, FAR)
    hidden = () if unexplained else hidden_findings(robot, solution)
    findings += uncoupled_findings(fitted)
    own = measure(fitted, fitted.problem.model_response(fitted.internal), options.weights.model_error)
    missed = own.findings("the fit's own data")
    by_load = any(isinstance(each.effect, LoadFriction) for each in estimated_nuisances(robot, options))
    told = with_friction_remedies([*findings, *hidden, *seen, *read, *missed], frf, by_load=by_load)
    # What noise may hide comes behind all that shows.
    every = ordered(sorted(told, key=lambda one: one.cause == "hidden"))
    return grade_fit(solution, every, own.cost_failures("the fit's own data"))


def _with_detectable(
    robot: Robot, solution: ElasticSolution, frf: Frf, options: ElasticOptions, delay_s: float
) -> ElasticSolution:
    """The solution with what its residual would have shown, which a fit from arrays has not said yet."""
    if solution.detectable is not None:
        return solution
    return replace(solution, detectable=detectable_defects(robot, solution, frf, options, delay_s))


def _parameter_findings(robot: Robot, estimate: Estimate, frf: Frf, options: ElasticOptions) -> tuple[Finding, ...]:
    band_hz = float(frf.frequency_hz[0]), float(frf.frequency_hz[-1])
    differenced = any(one.quantity == "speed" and "difference" in one.sampled for one in frf.measured_channels)
    told = band_hz, frf.sampling_period_s, options.prior_decades
    return parameter_findings(robot, estimate, *told, differenced=differenced)


def validation_findings(
    findings: Sequence[Finding], robot: Robot, estimate: Estimate, frf: Frf, campaign: str, delay_s: float = 0.0
) -> tuple[Finding, ...]:
    """Adds what a validation campaign's data contradict to the findings about a fit.

    What the data of either campaign decide is to blame first.

    Args:
        findings: Findings about the fit, the first to blame first.
        robot: The robot file that the fit started from, with the validation campaign's payload.
        estimate: What the fit found: with masses or counterbalances that it estimated, weight is carried otherwise.
        frf: The response of the validation campaign.
        campaign: Its name.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
    """
    # Mean torques are those of the robot with what the fit estimated.
    found = data_findings(robot, frf, delay_s, fitted_carrier(robot, estimate))
    seen = [replace(finding, message=f"in campaign {campaign}, {finding.message}") for finding in found]
    first = takewhile(lambda finding: finding.decisive, findings)
    return ordered([*first, *(finding for finding in seen if finding.decisive), *findings, *seen])
