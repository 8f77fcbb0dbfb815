"""Angles that were read too small, which make a motion look too poor: each is tried as if it were in radians."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.shots import Shot
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.motors import EXPECTED_ERROR_LIMIT, added_error
from robid.models.rigid.judge.scales import Motions
from robid.results.finding import Finding, two_digits
from robid.results.scale import SCALES, Scale
from robid.robot.description import Robot

_FACTOR = "180/pi"
_REACH, _ENDLESS = 1.1, 4 * np.pi  # of a joint's range, and the range of one without ends [rad]
_SHARPER = 1 / 3  # of what the parameters' covariance adds to the motor's error
_NO_WORSE, _BETTER = 1.02, 0.8  # of the error on pieces left out
_OFF, _NEARER = 4.0, 3.0  # times the robot file's inertial torques, and how much nearer to these


def small_angle_findings(
    robot: Robot, shots: Sequence[Shot], motions: Motions, solution: RigidSolution, options: RigidFitOptions
) -> tuple[Finding, ...]:
    """Names a joint whose radians were read as degrees, at most one, where a motion determines its motor poorly.

    The joint then hardly moves by the log, so that other parameters explain its torques as well and no misfit shows.
    It is fitted again with that angle 180/pi times as large, which counts only where the arm has the room, what the
    covariance adds to the motor's expected error falls to a third, and errors on pieces left out do not grow. Since a
    larger motion is always better determined, one of two more is asked for: these errors fall by a fifth, or torques of
    links and rotor that were 4 times the robot file's and more come 3 times nearer to it. Never may they come to lie 3
    times farther from it.

    Args:
        robot: The robot file's.
        shots: Those of the fit.
        motions: What the record says of its motions; an angle that another channel measures too was judged by that.
        solution: The fit.
        options: How it was made.
    """
    filters = replace(options.filters, position_cut_hz=solution.filtered.cut_hz)
    plain = replace(options, filters=filters, physical=False, estimator="weighted")
    added = added_error(solution)
    tried = []
    for joint in _candidates(robot, shots, motions, added):
        try:
            found = fit_rigid(robot, [_enlarged(shot, joint) for shot in shots], plain)
        except DataError:
            continue
        if _is_better(solution, found, joint):
            tried.append((float(added_error(found)[joint] / added[joint]), joint, found))
    if not tried:
        return ()
    _, joint, found = min(tried, key=lambda one: one[0])
    return (_finding(robot, motions, joint, solution, found),)


def _candidates(robot: Robot, shots: Sequence[Shot], motions: Motions, added: FloatArray) -> Iterator[int]:
    """Joints whose motors are poorly determined, whose angle nothing else measures, with room for the larger motion."""
    paired = {index for pair in motions.pairs for index in (pair.first, pair.second)}
    reach = robot.upper - robot.lower
    reach = np.where(np.isfinite(reach), reach, _ENDLESS)
    for joint in np.flatnonzero(added > EXPECTED_ERROR_LIMIT).tolist():
        used = int(motions.used[joint])
        if motions.channels[used].quantity != "angle" or used in paired:
            continue
        # A coupled arm turns with this motor as well: all must have the room.
        arms = [_enlarged(shot, joint).position @ robot.arm_per_motor.T for shot in shots]
        travel = np.max([arm.max(axis=0) for arm in arms], axis=0) - np.min([arm.min(axis=0) for arm in arms], axis=0)
        if np.all((travel < _REACH * reach) | (robot.arm_per_motor[:, joint] == 0)):
            yield joint


def _enlarged(shot: Shot, joint: int) -> Shot:
    """A shot whose motor `joint` moved as far as it would if its angle had been radians."""
    factor = np.ones(shot.position.shape[1])
    factor[joint] = SCALES[_FACTOR]
    return replace(shot, position=shot.position * factor)


def _is_better(before: RigidSolution, after: RigidSolution, joint: int) -> bool:
    """Whether a fit with a larger angle speaks for it."""
    left = _left_out(after) / _left_out(before)
    sharper = added_error(after)[joint] < _SHARPER * added_error(before)[joint]
    own, other = (abs(float(np.log(each.against_nominal.whole_ratio[joint]))) for each in (before, after))
    nearer = own > np.log(_OFF) and own - other > np.log(_NEARER)
    # What a motion hardly shows is left less of by any larger one, but then as far from the file as the angle was made.
    farther = other - own > np.log(_NEARER)
    return bool(sharper and not farther and not left > _NO_WORSE and (left < _BETTER or nearer))


def _left_out(solution: RigidSolution) -> float:
    """Error on pieces left out, all motors alike."""
    return float(np.sqrt(np.mean(solution.expected.left_out**2)))


def _finding(robot: Robot, motions: Motions, joint: int, before: RigidSolution, after: RigidSolution) -> Finding:
    own = motions.channels[int(motions.used[joint])]
    is_alone = sum(each.quantity == "angle" and each.side == own.side for each in motions.channels) == 1
    name = robot.joints[joint].name
    scale = Scale(f"{own.side}_angle", _FACTOR, inverse=True, joints=() if is_alone else (name,))
    now, first = (two_digits(100 * float(each.expected.error[joint])) for each in (after, before))
    told = (
        f"with an angle 180/pi times as large the torque of {name} is to be expected off by {now} % instead of {first} "
        f"% on other motions, as if {scale.mistake(SCALES[_FACTOR])}"
    )
    strength = float(added_error(before)[joint] / EXPECTED_ERROR_LIMIT)
    return Finding("units", told, decisive=True, strength=strength, scales=(scale,))
