"""Further explanations of a misfit: gear ratios and backlash, which no fit doubts or estimates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import ComplexArray
from robid.frf.frf import Frf
from robid.models.elastic.fit.doubts.column import DoubtColumn, RobotMove
from robid.results.plausible.evidence import gather_evidence
from robid.robot.description import Robot

if TYPE_CHECKING:
    from robid.models.elastic.fit.doubts.scene import Scene

_RATIO_STD = 0.1
_RATIO_STEP = 1e-5
_LEAST_RATIO, _MOST_RATIO = 0.5, 2.0  # times the stated one
_TURNED_RAD = float(np.deg2rad(5.0))
_CONFIRMED = 0.01
_MILLI = 1e3
_BACKLASH_STD, _MOST_BACKLASH = 0.1, 2.0  # mrad: a gear of good quality has some 0.3


def candidates(robot: Robot, frf: Frf) -> tuple[DoubtColumn, ...]:
    """Lists explanations of a misfit that are no doubts of a robot file.

    They widen no interval: ratios are exact or plainly wrong, and backlash leaves no linear spring to estimate.

    Args:
        robot: The robot file that the fit started from.
        frf: The response that it was fitted to.
    """
    return (*_gear_ratios(robot, frf), *_backlashes(robot))


def gear_ratio(robot: Robot, joint: int) -> DoubtColumn:
    """Returns the explanation that a joint's gear ratio is not as stated, in the unit of the ratio."""
    own = robot.joints[joint]
    stated = own.motor.gear_ratio
    least, most = sorted(((_LEAST_RATIO - 1) * stated, (_MOST_RATIO - 1) * stated))
    unit = "rad/m" if robot.prismatic[joint] else "turns per turn"
    return DoubtColumn(
        f"{own.name}.gear_ratio",
        f"gear ratio of {own.name}",
        "gear_ratio",
        unit,
        _RATIO_STD * abs(stated),
        0.0,
        RobotMove(partial(with_gear_ratio, joint), _RATIO_STEP * abs(stated)),
        least,
        most,
        stated,
    )


def with_gear_ratio(joint: int, robot: Robot, more: float) -> Robot:
    """Returns a robot one of whose gear ratios is larger by some amount."""
    own = robot.joints[joint]
    motor = replace(own.motor, gear_ratio=own.motor.gear_ratio + more)
    joints = (*robot.joints[:joint], replace(own, motor=motor), *robot.joints[joint + 1 :])
    return replace(robot, joints=joints)


def _gear_ratios(robot: Robot, frf: Frf) -> Iterator[DoubtColumn]:
    confirmed = _confirmed(robot, frf)
    for index, joint in enumerate(robot.joints):
        if joint.name not in confirmed:
            yield gear_ratio(robot, index)


def _confirmed(robot: Robot, frf: Frf) -> set[str]:
    """Joints whose mean motor angles follow the stated configurations by the stated ratio."""
    evidence = gather_evidence(frf)
    if evidence.mean_angle is None or not evidence.belongs_to(robot) or len(evidence.configurations) < 2:
        return set()
    rows = evidence.joints(robot)
    expected = evidence.configurations @ robot.motor_per_arm[rows].T
    away = expected - expected.mean(axis=0)
    square = (away**2).sum(axis=0)
    slope = (away * evidence.mean_angle).sum(axis=0) / np.maximum(square, np.finfo(float).tiny)
    turned = np.ptp(expected / robot.gear_ratio[rows], axis=0) > _TURNED_RAD
    sure = turned & (np.abs(slope - 1) < _CONFIRMED)
    return {name for name, known in zip(evidence.names, sure.tolist(), strict=True) if known}


@dataclass(frozen=True)
class Backlash:
    """A gap in a gear, in thousandths of its unit of motion.

    A gear that rests at a deflection `y` and swings by `s`, root mean square and normally distributed, passes through
    a small gap `b` for `b / s` times the standard normal density at `y / s` of its time, and is softer by that share.
    A load holds a gear on one side of its gap, so places tell backlash from softness.

    Attributes:
        spring: Index of the gear.

    Source:
        Statistical linearisation of a dead zone: Gelb and Vander Velde (1968), app. E.
    """

    spring: int

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the gap; zero where the swing is unknown."""
        swing = np.sqrt(scene.swing[:, :, self.spring].sum(axis=1))
        moves = swing > 0
        size = np.where(moves, swing, 1.0)
        load = scene.problem.model.rest.deflection[:, self.spring] / size
        softer = moves * np.exp(-0.5 * load**2) / (np.sqrt(2 * np.pi) * size * _MILLI)
        return np.asarray(-softer[:, None, None, None] * scene.stiffness_slopes[..., self.spring])


def _backlashes(robot: Robot) -> Iterator[DoubtColumn]:
    for index, spring in enumerate(robot.springs):
        if spring.place == "transmission":
            unit = "mm" if robot.is_linear(spring) else "mrad"
            names = f"{spring.name}.backlash", f"backlash of {spring.name}"
            sizes = _BACKLASH_STD, 0.0
            yield DoubtColumn(*names, "gear_nonlinearity", unit, *sizes, Backlash(index), 0.0, _MOST_BACKLASH)
