"""What is doubtful about the parameters of a rigid fit, and how far to trust it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import BoolArray
from robid.models.conclusions import graded_alone
from robid.models.rigid.fit.alone import RECORDS
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.solution import RigidSolution, Travel
from robid.models.rigid.judge.motors import (
    EXPECTED_ERROR_LIMIT,
    MOTOR_ERROR_LIMIT,
    Motors,
    added_error,
    elsewhere,
    motors_of,
)
from robid.models.rigid.judge.trials import Trial
from robid.results.estimate import Estimate
from robid.results.finding import CAUSES, Finding, two_digits
from robid.results.grade import Grade
from robid.robot.description import Robot
from robid.robot.regressor.drives import acts_along

_FRICTION = ("viscous", "coulomb", "load_friction", "coupling_viscous", "coupling_coulomb")
_INERTIAL = ("inertia", "first_moment", "mass", "motor_inertia", "coupling_inertia")
TOTAL_ERROR_LIMIT = 0.15
"""Share of the torques that a model may leave, on its own motion and on another."""

_POSITIVE = ("viscous", "coulomb", "motor_inertia")
_MATTERS = 0.05  # of a motor's torque
_FAR, _TOO_FAR = 2.0, 8.0  # times the robot file's
_ALIKE, _TURNED = 0.8, -0.5  # correlation with the robot file's
_TO_BLAME = 100.0
_VISIBLE, _BESIDE = 0.1, 1.5  # of a motor's torque, and over what the fit leaves
_TOLD, _UNFELT = 0.1, 0.3  # of a rotor's inertia: its deviation where it is told, and what is none
_FELT = 0.05  # of a rotor's inertia, from which it is there
_BEYOND, _FAR_BEYOND = 0.05, 1.0  # of a joint's range
_MOVED, _TORN = 3.0, 5.0  # deviations
_POOR_CONDITION = 200.0
_BIASED = 0.1


def parameter_findings(
    robot: Robot, solution: RigidSolution, motors: Motors, tried: Sequence[Trial] = ()
) -> tuple[Finding, ...]:
    """Returns what of a rigid fit cannot be or is hardly known, decisive findings first."""
    found = [
        *estimator_findings(solution, motors.names),
        *_places(solution.travel, motors.names),
        *_signs(robot, solution, motors.names),
        *file_findings(robot, solution, motors.names),
        *_unfelt_rotors(solution),
        *_channels(solution, motors),
        *_unexplained(solution, motors, tried),
        *_negative(solution.estimate),
        *_excitation(solution, motors),
        *_bodies(solution),
    ]
    return tuple(sorted(found, key=_rank))


def _rank(finding: Finding) -> tuple[bool, float]:
    return not finding.decisive, -finding.strength


def estimator_findings(solution: RigidSolution, names: Sequence[str]) -> Iterator[Finding]:
    """Yields what the tests of least squares say of the result, which may be another estimator's."""
    checks, told = solution.checks, solution.checks.sentence.rstrip(".")
    told = told[0].lower() + told[1:]
    if checks.instruments_differ and solution.chosen != "instruments":
        yield Finding("filters", told, decisive=True, strength=2.0)
    elif checks.huber_differs and checks.instrument_variation is None and solution.filtered.trial_hz.size <= 1:
        # What is hardly told from zero decides nothing, nor what other rows hardly suffer from.
        varies = checks.huber_variation[solution.estimate.identified] > _BIASED
        off = np.nanmax(np.append(solution.expected.left_out, solution.expected.residual))
        yield Finding("filters", told, bool(varies.any() and off > EXPECTED_ERROR_LIMIT), 2.0)
    elif checks.huber_differs and not checks.instruments_differ:
        # The instruments agree, or the cut-off was chosen against noise: what moves Huber's estimate is none of it.
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
        told = f"the residuals of {names[worst]} are correlated in time by {size:.2g} beyond their filter"
        yield Finding("friction", told, decisive=False, strength=1 + size)
    if checks.odd and not checks.huber_differs:
        share = float(np.max(checks.outlier_share))
        told = f"the residuals are not Gaussian: up to {share:.2g} of a joint's lie beyond three deviations"
        yield Finding("friction", told, decisive=False, strength=1.5)


def _signs(robot: Robot, solution: RigidSolution, names: Sequence[str]) -> Iterator[Finding]:
    """Torques with the wrong sign: gravity and inertia against the robot file's, friction and rotors that drive.

    A rough file, as of a payload's centre, turns around what the links of a motor do; but no file makes friction drive.
    """
    visible, likeness = _visible(solution), solution.against_nominal.likeness
    turned = visible & (np.nan_to_num(likeness) < _TURNED)
    against, found = [*(_driving(robot, solution, joint) for joint in range(len(names)))], []
    for joint, (negative, positive) in enumerate(against):
        if positive or not (negative or turned[joint]):
            continue
        links = f"its links' torque is the robot file's with the other sign (correlation {likeness[joint]:.2g})"
        found.append((names[joint], [*([links] if turned[joint] else []), *negative[:1]]))
    if len(found) == len(names) > 1:
        told = f"all motors, as {found[0][0]}: {' and '.join(found[0][1])}"
        yield Finding("torque_sign", told, decisive=True, strength=_TO_BLAME)
        return
    for name, evidence in found:
        # What a wrong sign leaves unexplained is its doing, so it is to blame first.
        told = f"{name}: {' and '.join(evidence)}; {CAUSES['angle_sign']} may look the same"
        yield Finding("torque_sign", told, decisive=True, strength=_TO_BLAME)


def _driving(robot: Robot, solution: RigidSolution, joint: int) -> tuple[list[str], bool]:
    """Terms of a motor that are clearly negative and matter, and whether one is as clearly positive."""
    estimate, own = solution.estimate, robot.joints[joint]
    speed = abs(own.motor.gear_ratio) * solution.travel.fastest[joint]
    least = _MATTERS * float(np.sqrt(np.nanmean(solution.residuals.torque[:, joint] ** 2)))
    negative, positive = [], False
    for index, (name, kind) in enumerate(zip(estimate.names, estimate.kinds, strict=True)):
        if name.rpartition(".")[0] != own.name or kind not in _POSITIVE:
            continue
        value, half = float(estimate.value[index]), float(estimate.upper[index] - estimate.value[index])
        size = {"viscous": abs(value) * speed, "coulomb": abs(value)}.get(kind, np.inf)
        if abs(value) > 2 * half and size > least:
            positive |= value > 0
            negative += [f"{name} comes out negative ({value:.3g})"] if value < 0 else []
    return negative, positive


def _visible(solution: RigidSolution) -> BoolArray:
    """Motors (n_joint,) whose links' torque, estimated or the robot file's, stands out of what the fit leaves."""
    found = solution.against_nominal
    size = np.nan_to_num(np.maximum(found.share, found.share / found.ratio))
    return np.asarray(
        (solution.torque_unit != "A") & (size > np.maximum(_VISIBLE, _BESIDE * solution.residuals.relative_error))
    )


def file_findings(robot: Robot, solution: RigidSolution, names: Sequence[str]) -> Iterator[Finding]:
    """Yields where torques of links are nothing like the robot file's, whose links are often drawn, not weighed.

    It says that the file is rough, or the log's scale or a gear ratio off: what is off by a factor of 8 is not to be
    used before a new motion was predicted, unless the file says itself what it lacks.
    """
    found, visible = solution.against_nominal, _visible(solution)
    size = np.where(visible & np.isfinite(found.ratio), np.abs(np.log(found.ratio)), 0.0)
    worst = int(np.argmax(size))
    cause = _likely_missing(robot, names[worst])
    if size[worst] > np.log(_FAR):
        times = two_digits(float(found.ratio[worst]))
        told = f"the links that {names[worst]} moves come out {times} times the robot file's"
        # What a load that the file lacks explains is no wrong scale; a gear ratio that nobody knows may well be one.
        excused = bool(cause[1]) and cause[0] != "gear_ratio"
        decisive = bool(size[worst] > np.log(_TOO_FAR)) and not excused
        yield Finding(cause[0], f"{told}{cause[1]}", decisive, float(size[worst] / np.log(_FAR)))
    unlike = int(np.argmin(np.where(visible, found.likeness, 1.0)))
    likeness, cause = float(found.likeness[unlike]), _likely_missing(robot, names[unlike])
    if visible[unlike] and abs(likeness) < _ALIKE:
        told = (
            f"what the links do to {names[unlike]} along this motion is not what the robot file's would do "
            f"(correlation {likeness:.2g}){cause[1]}"
        )
        yield Finding(cause[0], told, decisive=False, strength=1 + _ALIKE - likeness)


def _likely_missing(robot: Robot, joint: str) -> tuple[str, str]:
    """What of the robot file is known to be unsure, a cause with a clause: its notes and what it assumes come first."""
    if f"{joint}.motor.gear_ratio" in robot.assumed:
        return "gear_ratio", f"; the robot file assumes {joint}.motor.gear_ratio"
    for note in robot.notes:
        if "counterbalance" in note.lower():
            return "counterbalance", f"; the robot file notes: {note.rstrip('.')}"
    assumed = [name for name in robot.assumed if name.startswith("payload.")]
    if assumed:
        return "payload", f"; the robot file assumes {', '.join(assumed)}"
    return "masses", ""


def _unfelt_rotors(solution: RigidSolution) -> Iterator[Finding]:
    """Torques that hold no rotor's inertia where the links are those of the robot file: a sensor behind the gear."""
    estimate, ratio = solution.estimate, solution.against_nominal.ratio
    usual = float(np.exp(np.nanmedian(np.log(ratio)))) if np.isfinite(ratio).any() else float("nan")
    if solution.torque_unit == "A" or not 1 / _FAR < usual < _FAR:
        return  # all is off alike
    if solution.residuals.total_error > TOTAL_ERROR_LIMIT:
        return  # noise in the columns hides rotors as well
    std = np.sqrt(np.diag(estimate.covariance))
    told = (np.array(estimate.kinds) == "motor_inertia") & (estimate.nominal > 0) & (std < _TOLD * estimate.nominal)
    size = (np.abs(estimate.value) + _MOVED * std) / np.where(told, estimate.nominal, np.inf)
    # A rotor that is clearly there, though smaller than the file's, is none that a sensor does not see.
    felt = told & (estimate.value - _MOVED * std > _FELT * estimate.nominal)
    if told.any() and size[told].max() < _UNFELT and not felt.any():
        names = [name for name, is_told in zip(estimate.names, told.tolist(), strict=True) if is_told]
        worst = two_digits(100 * float(size[told].max()))
        message = f"the torques hold at most {worst} % of the rotors' inertias ({', '.join(names)})"
        yield Finding("torque_sensor", message, decisive=True, strength=_TO_BLAME)


def _places(travel: Travel, names: Sequence[str]) -> Iterator[Finding]:
    """Positions beyond the joints' limits: a zero, or, where more was moved over than there is, a gear ratio."""
    reach = travel.upper_limit - travel.lower_limit
    beyond = np.maximum(travel.lower_limit - travel.lowest, travel.highest - travel.upper_limit)
    share = np.where(np.isfinite(reach), beyond / reach, 0.0)
    worst = int(np.argmax(share))
    if share[worst] > _BEYOND:
        told = (
            f"{names[worst]} would have moved from {travel.lowest[worst]:.3g} to {travel.highest[worst]:.3g}, but "
            f"its limits are {travel.lower_limit[worst]:.3g} and {travel.upper_limit[worst]:.3g} (rad, or m)"
        )
        wider = bool((travel.highest - travel.lowest)[worst] > (1 + _FAR_BEYOND) * reach[worst])
        cause = "gear_ratio" if wider else "zero"
        yield Finding(cause, told, bool(share[worst] > _FAR_BEYOND), float(share[worst] / _BEYOND))


def is_unexplained(robot: Robot, solution: RigidSolution, options: RigidFitOptions) -> bool:
    """Whether a fit leaves more of its own torques than it may."""
    return any(each.decisive for each in _unexplained(solution, motors_in(robot, solution, options), ()))


def _unexplained(solution: RigidSolution, motors: Motors, tried: Sequence[Trial]) -> Iterator[Finding]:
    """Torques that the fit leaves, all together or of one motor, with the cause that explains most where one does."""
    if not motors.judged.any():
        told = "no motor's torque contains more of its links than noise, friction and misfit leave"
        yield Finding("excitation", told, decisive=True, strength=_TO_BLAME)
        return
    if motors.left_out:
        told = f"{', '.join(motors.left_out)}: torque that is mostly noise, resolution or friction, not determined"
        yield Finding("excitation", told, decisive=False, strength=1.5)
    whole = motors.total(solution.residuals.residual, solution.residuals.torque)
    name, index, own = motors.worst(solution.expected.residual)
    if whole > TOTAL_ERROR_LIMIT:
        told, strength = f"{whole:.0%} of its own torques, limit {TOTAL_ERROR_LIMIT:.0%}", whole / TOTAL_ERROR_LIMIT
    elif own > MOTOR_ERROR_LIMIT:
        off = motors.off(solution, index, own)
        told, strength = f"of {name}'s torque {off}, limit {MOTOR_ERROR_LIMIT:.0%}", own / MOTOR_ERROR_LIMIT
    else:
        return
    gains = "".join(f"; {trial.sentence}" for trial in tried)
    # A change that was tried and helps is better evidence than whatever else a bad fit shows.
    cause, strength = (tried[0].cause, _TO_BLAME) if tried else ("model", strength)
    yield Finding(cause, f"the fit leaves {told}{gains}", decisive=True, strength=strength)


def _channels(solution: RigidSolution, motors: Motors) -> Iterator[Finding]:
    """Torques beyond their limit that go with another joint's motion, or differently in each record."""
    alone, residual = solution.alone, solution.expected.residual
    if alone is None:
        return
    # What its own motion explains is a scale or a sign beside the other motors', which other findings name.
    told = (
        elsewhere(solution) & motors.judged & (residual > MOTOR_ERROR_LIMIT) & (alone.row != np.arange(len(residual)))
    )
    if not told.any():
        return
    index = int(np.argmax(np.where(told, residual, 0.0)))
    name, row, share = motors.names[index], int(alone.row[index]), float(alone.error[index])
    how = "each record alone" if row == RECORDS else f"the motion of {motors.names[row]}"
    left = float(solution.residuals.relative_error[index])
    message = f"{how} explains the torque of {name} but for {share:.0%}, where the fit leaves {left:.0%}"
    yield Finding("channels", message, decisive=True, strength=_TO_BLAME)


def _gains(solution: RigidSolution, names: Sequence[str], prior_std: float | None) -> Iterator[Finding]:
    """Gains far from what was known of them: the load was not carried as stated."""
    if solution.gains is None or prior_std is None:
        return
    away = np.abs(1 / solution.gains.gain - 1) / prior_std
    # What the load does not tell has no reason to leave what was known.
    beyond = away / np.where(solution.gains.determined, _TORN, _MOVED)
    index = int(np.argmax(beyond))
    if beyond[index] > 1:
        told = (
            f"the known load asks for torques of {names[index]} {two_digits(float(solution.gains.gain[index]))} times "
            f"the recorded ones, {two_digits(float(away[index]))} deviations from what `gain_std` states"
        )
        yield Finding("payload", told, decisive=True, strength=_TO_BLAME)


def _negative(estimate: Estimate) -> Iterator[Finding]:
    """Friction and inertias that are negative beyond their interval."""
    columns = (each.tolist() for each in (estimate.nominal, estimate.upper, estimate.value))
    for name, kind, nominal, upper, value in zip(estimate.names, estimate.kinds, *columns, strict=True):
        own = name.endswith((".ZZ", ".XX", ".YY", ".M"))
        # A combination of the robot file's own bodies may be negative as well.
        if upper >= 0 or nominal < 0 or not (kind in _FRICTION or kind in ("motor_inertia", "coupling_inertia") or own):
            continue
        cause = "masses" if kind in _INERTIAL else "friction"
        yield Finding(cause, f"{name} comes out negative ({value:.3g})", decisive=False, strength=1.5)


def _excitation(solution: RigidSolution, motors: Motors) -> Iterator[Finding]:
    """A motion that is too poor: by the errors that it lets expect on others, or by its condition."""
    expected, estimate = solution.expected, solution.estimate
    poor = [name for name, known in zip(estimate.names, estimate.identified.tolist(), strict=True) if not known]
    listed = ", ".join(poor[:5]) + (f" and {len(poor) - 5} more" if len(poor) > 5 else "")
    # What the covariance of the parameters adds to what is left of the fit's own log, which `_unexplained` judges.
    name, index, error = motors.worst(added_error(solution))
    if error > EXPECTED_ERROR_LIMIT:
        told = (
            f"the motion is too poor: on others the torque of {name} is to be expected off by "
            f"{motors.off(solution, index, float(expected.error[index]))}, where the fit leaves "
            f"{expected.residual[index]:.0%}; it determines {len(estimate.names) - len(poor)} of "
            f"{len(estimate.names)} parameters (not {listed}); record larger, faster or longer motions of all joints"
        )
        yield Finding("excitation", told, decisive=True, strength=error / EXPECTED_ERROR_LIMIT)
    elif poor and solution.base.condition > _POOR_CONDITION:
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


def motors_in(robot: Robot, solution: RigidSolution, options: RigidFitOptions) -> Motors:
    """Returns the motors of a fit, those that its options ask to be judged among them."""
    found = motors_of(solution, [joint.name for joint in robot.joints], options.judge)
    return replace(found, forces=frozenset(joint.name for joint in robot.joints if acts_along(joint)))


def assess_rigid(
    robot: Robot,
    solution: RigidSolution,
    options: RigidFitOptions,
    scales: Sequence[Finding] = (),
    tried: Sequence[Trial] = (),
    further: Sequence[Finding] = (),
) -> Grade:
    """Grades a rigid fit by itself: it predicts at best. Beside wrong scales nothing else is looked for.

    Args:
        robot: The robot file's.
        solution: What the fit found.
        options: How.
        scales: Wrong scales that were seen in its data.
        tried: What a bad fit was tried with, and what that gained.
        further: What else speaks against it, seen in its rows.
    """
    motors = motors_in(robot, solution, options)
    own = (*parameter_findings(robot, solution, motors, tried), *_gains(solution, motors.names, options.gain_std))
    found = scales or sorted((*own, *further), key=_rank)
    return graded_alone(found, solution.estimate.status)
