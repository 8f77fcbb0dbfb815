"""A motion of the branch that excites its base parameters, within the limits of joints and torques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.description import Robot
from robid.robot.regressor.model import RigidModel
from robid.simulate.options import Controller
from robid.studies.settings.study import BranchCase

_COARSE = 200  # samples by which a series is chosen


@dataclass(frozen=True)
class Branch:
    """The robot with what moves it.

    Attributes:
        case: The case.
        robot: The robot.
        controller: Its controller.
        middle_rad (n_joint,): Arm positions about which it moves.
    """

    case: BranchCase
    robot: Robot
    controller: Controller
    middle_rad: FloatArray


@dataclass(frozen=True)
class _Series:
    """A Fourier series of arm positions about a middle.

    Attributes:
        middle (n_joint,): Its middle [rad].
        sine (n_harmonic, n_joint): Amplitudes of the sines [rad].
        cosine (n_harmonic, n_joint): Amplitudes of the cosines [rad].
        period_s: Its period [s].
    """

    middle: FloatArray
    sine: FloatArray
    cosine: FloatArray
    period_s: float

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Returns positions, speeds and accelerations (n_sample, n_joint) at times (n_sample,)."""
        rate = 2 * np.pi * np.arange(1, len(self.sine) + 1) / self.period_s
        sine, cosine = np.sin(np.outer(time_s, rate)), np.cos(np.outer(time_s, rate))
        return (
            self.middle + sine @ self.sine + cosine @ self.cosine,
            (cosine * rate) @ self.sine - (sine * rate) @ self.cosine,
            -(sine * rate**2) @ self.sine - (cosine * rate**2) @ self.cosine,
        )


def exciting_motion(branch: Branch, model: RigidModel, truth: FloatArray) -> FloatArray:
    """Returns the best conditioned of random Fourier series within the limits of joints and torques.

    Args:
        branch: The robot and its case.
        model: The model with the columns of base parameters alone.
        truth (n_base,): The base parameters.

    Returns:
        Motor angles (n_sample, n_joint) at the controller's samples [rad].

    Raises:
        DataError: If every series needs more torque than there is.
    """
    case, period = branch.case, branch.controller.sampling_period_s
    generator = np.random.default_rng(case.draw_seed)
    drawn = [_draw(branch, generator) for _ in range(case.draws)]
    condition = [_condition(branch, series, model, truth) for series in drawn]
    best = int(np.argmin(condition))
    if not np.isfinite(condition[best]):
        message = "every series that was drawn needs more torque than the motors have"
        raise DataError(
            message, where="study.branch", remedy="lower `range_share` or `harmonics`, or raise `duration_s`"
        )
    time_s = np.arange(round(case.duration_s / period)) * period
    return np.asarray(drawn[best].at(time_s)[0] @ branch.robot.motor_per_arm.T)


def _draw(branch: Branch, generator: np.random.Generator) -> _Series:
    """A random series that begins at rest and uses the allowed share of the range of each joint."""
    case, robot, middle = branch.case, branch.robot, branch.middle_rad
    shape, order = (case.harmonics, len(middle)), np.arange(1.0, case.harmonics + 1)
    sine, cosine = generator.standard_normal(shape), generator.standard_normal(shape)
    sine -= np.outer(order, order @ sine) / (order @ order)
    plain = _Series(np.zeros_like(middle), sine, cosine, case.duration_s)
    reach = np.abs(plain.at(np.linspace(0, case.duration_s, _COARSE))[0]).max(axis=0)
    room = case.range_share * np.minimum(robot.upper - middle, middle - robot.lower)
    return _Series(middle, sine * room / reach, cosine * room / reach, case.duration_s)


def _condition(branch: Branch, series: _Series, model: RigidModel, truth: FloatArray) -> float:
    """Condition number of the columns, each of norm 1, along a series; infinite beyond the torque limits."""
    motor = branch.robot.motor_per_arm.T
    motion = [each @ motor for each in series.at(np.linspace(0, series.period_s, _COARSE))]
    limit = np.array([joint.motor.max_torque_nm for joint in branch.robot.joints])
    if np.any(np.abs(model.torques(truth, *motion)) > branch.case.torque_share * limit):
        return float("inf")
    columns = model.columns(*motion).reshape(-1, len(truth))
    return float(np.linalg.cond(columns / np.linalg.norm(columns, axis=0)))
