"""Counterbalances that a robot file lacks, which a fit can free."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.doubts.column import DoubtColumn, RobotMove
from robid.robot.description import HarmonicBalance, Joint, Robot

BALANCE = "counterbalance"
"""Name that frees them all, and their names' end before the wave."""
_WAVES = ("sine", "cosine")
_SHARE = 0.1  # of the arm-side torque that the motor can give
_LIKELY_NM = 100.0  # where nobody says what the motor can give
_STEP_NM = 1.0


def balance_doubts(robot: Robot) -> Iterator[DoubtColumn]:
    """Yields a torque on the arm of each joint that turns, by sine and cosine of its angle.

    A robot file that states counterbalances has none: the elastic model does not know them.
    """
    if any(joint.counterbalance is not None for joint in robot.joints):
        return
    for index, joint in enumerate(robot.joints):
        for wave, name in enumerate(_WAVES) if joint.type == "revolute" else ():
            names = f"{joint.name}.{BALANCE}_{name}", f"counterbalance of {joint.name} by the {name} of its angle"
            move = RobotMove(partial(_with_balance, index, np.eye(2)[wave]), _STEP_NM)
            likely = _likely_nm(joint)
            yield DoubtColumn(*names, BALANCE, "N m", likely, 0.0, move, natural=likely)


def _likely_nm(joint: Joint) -> float:
    most = abs(joint.motor.max_torque_nm * joint.motor.gear_ratio)
    return _SHARE * most if np.isfinite(most) else _LIKELY_NM


def _with_balance(index: int, waves: FloatArray, robot: Robot, torque_nm: float) -> Robot:
    """The robot with more torque by the sine and the cosine of a joint's angle."""
    joint = robot.joints[index]
    own = joint.counterbalance
    sine, cosine = (own.sine_nm, own.cosine_nm) if isinstance(own, HarmonicBalance) else np.zeros((2, 1))
    more = torque_nm * waves
    balance = HarmonicBalance(sine + more[0], cosine + more[1])
    balanced = replace(joint, counterbalance=balance)
    return replace(robot, joints=(*robot.joints[:index], balanced, *robot.joints[index + 1 :]))
