"""What is doubtful about the parameters of a rigid fit, and how far to trust it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid.models.conclusions import graded_alone
from robid.models.rigid.fit.solution import RigidSolution, Travel
from robid.results.estimate import Estimate
from robid.results.finding import Finding, two_digits
from robid.results.grade import Grade

_FRICTION = ("viscous", "coulomb", "load_friction", "coupling_viscous", "coupling_coulomb")
_INERTIAL = ("inertia", "first_moment", "mass", "motor_inertia", "coupling_inertia")
TOTAL_ERROR_LIMIT = 0.15
"""Share of the torques that a model may leave, on its own motion and on another."""

_FAR, _TOO_FAR = 2.0, 5.0  # times the robot file's
_ALIKE, _UNLIKE = 0.8, 0.5  # correlation with the robot file's
_TO_BLAME = 100.0
_VISIBLE = 0.1  # of a motor's torque
_TOLD, _UNFELT = 0.1, 0.3  # of a rotor's inertia: its deviation where it is told, and what is none
_BEYOND, _FAR_BEYOND = 0.05, 1.0  # of a joint's range
_MOVED = 3.0  # deviations
_POOR_CONDITION = 200.0
_BIASED = 0.1


def parameter_findings(solution: RigidSolution) -> tuple[Finding, ...]:
    """Returns what of a rigid fit cannot be or is hardly known, decisive findings first."""
    found = [
        *_estimators(solution),
        *_places(solution.travel),
        *_sizes(solution),
        *_unfelt_rotors(solution),
        *_unexplained(solution),
        *_negative(solution.estimate),
        *_excitation(solution),
        *_bodies(solution),
    ]
    return tuple(sorted(found, key=_rank))


def _rank(finding: Finding) -> tuple[bool, float]:
    return not finding.decisive, -finding.strength


def _estimators(solution: RigidSolution) -> Iterator[Finding]:
    """What the verdict on least squares says of the result, which may be another estimator's."""
    checks, told = solution.checks, solution.checks.sentence.rstrip(".")
    told = told[0].lower() + told[1:]
    if checks.instruments_differ and solution.chosen != "instruments":
        yield Finding("filters", told, decisive=True, strength=2.0)
    elif checks.huber_differs and checks.instrument_variation is None:
        # What is hardly told from zero decides nothing.
        varies = checks.huber_variation[solution.estimate.identified] > _BIASED
        yield Finding("filters", told, decisive=bool(varies.any()), strength=2.0)
    elif checks.huber_differs and not checks.instruments_differ:
        # The instruments agree: what moves Huber's estimate is no noise of the positions.
        told = f"{solution.estimate.names[int(np.argmax(checks.huber_variation))]} depends on large residuals"
        yield Finding("model", told, decisive=False, strength=1.5)
    if checks.untested:
        told = "too few rows are left to test the residuals of all joints"
        yield Finding("excitation", told, decisive=False, strength=2.0)
    for name, status in zip(solution.estimators.names, solution.estimators.status, strict=True):
        if status != "converged" and name != solution.chosen:
            yield Finding("model", f"the {name} estimate beside it has not converged", decisive=False, strength=1.5)
    if checks.coloured:
        worst = int(np.argmax(np.abs(checks.correlation).max(axis=1)))
        size = float(np.abs(checks.correlation[worst]).max())
        told = f"the residuals of joint {worst + 1} are correlated in time by {size:.2g} beyond their filter"
        yield Finding("friction", told, decisive=False, strength=1 + size)
    if checks.odd and not checks.huber_differs:
        share = float(np.max(checks.outlier_share))
        told = f"the residuals are not Gaussian: up to {share:.2g} of a joint's lie beyond three deviations"
        yield Finding("friction", told, decisive=False, strength=1.5)


def _sizes(solution: RigidSolution) -> Iterator[Finding]:
    """Torques of links that are nothing like the robot file's, whose links are often drawn, not weighed."""
    if solution.torque_unit == "A":
        return  # ratios to a torque constant that nobody knows
    found = solution.against_nominal
    visible = np.nan_to_num(np.maximum(found.share, found.share / found.ratio)) > _VISIBLE
    size = np.where(visible, np.abs(np.log(found.ratio)), 0.0)
    worst = int(np.argmax(size))
    if size[worst] > np.log(_FAR):
        ratio = float(found.ratio[worst])
        told = f"the links that joint {worst + 1} moves come out {two_digits(ratio)} times the robot file's"
        yield Finding("masses", told, bool(size[worst] > np.log(_TOO_FAR)), float(size[worst] / np.log(_FAR)))
    unlike = int(np.argmin(np.where(visible, found.likeness, 1.0)))
    likeness = float(found.likeness[unlike])
    if visible[unlike] and likeness < _ALIKE:
        told = (
            f"what the links do to joint {unlike + 1} along this motion is not what the robot file's would do "
            f"(correlation {likeness:.2g})"
        )
        yield Finding("masses", told, likeness < _UNLIKE, 1 + _ALIKE - likeness)


def _unfelt_rotors(solution: RigidSolution) -> Iterator[Finding]:
    """Torques that hold no rotor's inertia where the links are those of the robot file: a sensor behind the gear."""
    estimate, ratio = solution.estimate, solution.against_nominal.ratio
    usual = float(np.exp(np.nanmedian(np.log(ratio)))) if np.isfinite(ratio).any() else float("nan")
    if solution.torque_unit == "A" or not 1 / _FAR < usual < _FAR:
        return  # all is off alike
    std = np.sqrt(np.diag(estimate.covariance))
    told = (np.array(estimate.kinds) == "motor_inertia") & (estimate.nominal > 0) & (std < _TOLD * estimate.nominal)
    size = (np.abs(estimate.value) + _MOVED * std) / np.where(told, estimate.nominal, np.inf)
    if told.any() and size[told].max() < _UNFELT:
        names = [name for name, is_told in zip(estimate.names, told.tolist(), strict=True) if is_told]
        worst = two_digits(100 * float(size[told].max()))
        message = f"the torques hold at most {worst} % of the rotors' inertias ({', '.join(names)})"
        yield Finding("torque_sensor", message, decisive=True, strength=_TO_BLAME)


def _places(travel: Travel) -> Iterator[Finding]:
    """Positions beyond the joints' limits: a zero, or, where more was moved over than there is, a gear ratio."""
    reach = travel.upper_limit - travel.lower_limit
    beyond = np.maximum(travel.lower_limit - travel.lowest, travel.highest - travel.upper_limit)
    share = np.where(np.isfinite(reach), beyond / reach, 0.0)
    worst = int(np.argmax(share))
    if share[worst] > _BEYOND:
        told = (
            f"joint {worst + 1} would have moved from {travel.lowest[worst]:.3g} to {travel.highest[worst]:.3g}, but "
            f"its limits are {travel.lower_limit[worst]:.3g} and {travel.upper_limit[worst]:.3g} (rad, or m)"
        )
        wider = bool((travel.highest - travel.lowest)[worst] > (1 + _FAR_BEYOND) * reach[worst])
        cause = "gear_ratio" if wider else "zero"
        yield Finding(cause, told, bool(share[worst] > _FAR_BEYOND), float(share[worst] / _BEYOND))


def _unexplained(solution: RigidSolution) -> Iterator[Finding]:
    error = solution.residuals.total_error
    if error > TOTAL_ERROR_LIMIT:
        told = f"the fit leaves {error:.0%} of its own torques, limit {TOTAL_ERROR_LIMIT:.0%}"
        yield Finding("model", told, decisive=True, strength=error / TOTAL_ERROR_LIMIT)


def _negative(estimate: Estimate) -> Iterator[Finding]:
    """Friction and inertias that are negative beyond their interval."""
    columns = (each.tolist() for each in (estimate.nominal, estimate.upper, estimate.value))
    for name, kind, nominal, upper, value in zip(estimate.names, estimate.kinds, *columns, strict=True):
        own = name.endswith((".ZZ", ".XX", ".YY", ".M"))
        # A combination of the robot file's own bodies may be negative as well.
        if upper >= 0 or nominal < 0 or not (kind in _FRICTION or kind in ("motor_inertia", "coupling_inertia") or own):
            continue
        inertial = kind in _INERTIAL
        told = f"{name} comes out negative ({value:.3g})"
        decisive = kind in ("motor_inertia", "coulomb", "viscous")
        cause = "torque_sign" if decisive else ("masses" if inertial else "friction")
        # What a wrong sign leaves unexplained is its doing, so it is to blame first.
        yield Finding(cause, told, decisive, _TO_BLAME if decisive else 1.5)


def _excitation(solution: RigidSolution) -> Iterator[Finding]:
    poor = [
        name
        for name, share in zip(solution.estimate.names, solution.estimate.relative_std.tolist(), strict=True)
        if share > solution.estimate.identifiable_relative_std
    ]
    if poor and solution.base.condition > _POOR_CONDITION:
        listed = ", ".join(poor[:5]) + (f" and {len(poor) - 5} more" if len(poor) > 5 else "")
        told = f"the motion has a condition number of {solution.base.condition:.3g}: {listed} suffer"
        yield Finding("excitation", told, decisive=False, strength=solution.base.condition / _POOR_CONDITION)


def _bodies(solution: RigidSolution) -> Iterator[Finding]:
    standard = solution.standard
    if standard is None or standard.status == "estimated" or not standard.moved.size:
        return
    worst = int(np.argmax(np.abs(standard.moved)))
    if abs(standard.moved[worst]) > _MOVED:
        told = (
            f"no real bodies have these base parameters: the nearest have {solution.estimate.names[worst]} off by "
            f"{two_digits(abs(float(standard.moved[worst])))} deviations"
        )
        yield Finding("masses", told, decisive=False, strength=abs(float(standard.moved[worst])) / _MOVED)


def assess_rigid(solution: RigidSolution, scales: Sequence[Finding] = (), further: Sequence[Finding] = ()) -> Grade:
    """Grades a rigid fit by itself: it predicts at best. Beside wrong scales nothing else is looked for.

    Args:
        solution: What the fit found.
        scales: Wrong scales that were seen in its data.
        further: What else speaks against it, seen in its rows.
    """
    found = scales or sorted((*parameter_findings(solution), *further), key=_rank)
    return graded_alone(found, solution.estimate.status)
