"""What a rigid fit is worth motor by motor: which are determined, which are judged, and how far each is off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.rigid.fit.sizes import LEAST_SHARE
from robid.models.rigid.fit.solution import RigidSolution
from robid.results.finding import two_digits

MOTOR_ERROR_LIMIT = 0.3
"""Error of a motor's torque over its size from which it must not be used."""

EXPECTED_ERROR_LIMIT = 0.15
"""Error that is expected on other motions from which a fit that was not validated on any must not be used."""

_WITHOUT_MEANING = 10  # times a motor's size: how many more says nothing
_BESIDE = 0.5  # of the residual: torque of links below it is lost in that
_BETTER = 0.7  # of what the fit leaves: noise is left by whatever explains it


@dataclass(frozen=True)
class Motors:
    """The motors of a fit."""

    names: tuple[str, ...]
    determined: BoolArray  # (n_joint,): whether its torque holds more of its links than noise and misfit leave
    judged: BoolArray  # (n_joint,): whether the grade counts it
    forces: frozenset[str] = frozenset()  # those whose torque is a force along a slide

    def unit(self, joint: int, torque_unit: str) -> str:
        """Unit of what drives a joint, where torques have another one: N for a force."""
        return "N" if torque_unit == "N m" and self.names[joint] in self.forces else torque_unit

    @property
    def left_out(self) -> tuple[str, ...]:
        """Motors that the grade does not count because nothing determines them."""
        rows = zip(self.names, self.judged.tolist(), self.determined.tolist(), strict=True)
        return tuple(name for name, is_judged, told in rows if not is_judged and not told)

    def worst(self, error: FloatArray) -> tuple[str, int, float]:
        """The judged motor with the largest error (n_joint,): its name, index and error."""
        counted = np.where(self.judged, np.nan_to_num(error), -1.0)
        index = int(np.argmax(counted))
        return self.names[index], index, float(counted[index])

    def total(self, error: FloatArray, torque: FloatArray) -> float:
        """Norm of the errors (n_row, n_joint) of all judged motors over that of their torques; 0 without any."""
        square = [np.nansum(each[:, self.judged] ** 2) for each in (error, torque)]
        return float(np.sqrt(square[0] / square[1])) if square[1] > 0 else 0.0

    def off(self, solution: RigidSolution, joint: int, error: float) -> str:
        """Says an error over the size of a motor's torque in the fit's own log, and what it is."""
        if error > _WITHOUT_MEANING:
            return f"more than {_WITHOUT_MEANING} times its size"
        rms = float(np.sqrt(np.nanmean(solution.residuals.torque[:, joint] ** 2)))
        size = max(rms, LEAST_SHARE * float(solution.expected.rated[joint]))
        return f"{error:.0%} of its size ({two_digits(error * size)} {self.unit(joint, solution.torque_unit)})"


def motors_of(solution: RigidSolution, names: Sequence[str], judge: Sequence[str] = ()) -> Motors:
    """Says which motors of a fit count.

    A motor is not determined where its torque is mostly noise, resolution or friction: what its links do along this
    motion, estimated and by the robot file, is lost in what the fit leaves, which is more than may be left. A robot
    file whose links are large beside it speaks of a misfit instead, which is the motor's fault; so does a torque that
    is explained apart from the model, by another joint's motion or in each record alone.

    Args:
        solution: The fit.
        names: The joints.
        judge: Joints that alone are judged; empty for all that are determined.
    """
    found, error = solution.against_nominal, solution.residuals.relative_error
    stated = np.nan_to_num(found.share / found.ratio, nan=0.0)
    hidden = (found.share < _BESIDE * error) & (stated < _BESIDE * error)
    determined = ~(hidden & (solution.expected.residual > MOTOR_ERROR_LIMIT)) | elsewhere(solution)
    named = np.isin(np.array(names), np.array(judge, dtype=str)) if judge else np.ones(len(names), bool)
    return Motors(tuple(names), determined, named & (determined | bool(judge)))


def elsewhere(solution: RigidSolution) -> BoolArray:
    """Whether each motor's torque (n_joint,) is explained apart from the model far better than by it."""
    if solution.alone is None:
        return np.zeros(len(solution.expected.residual), bool)
    error, own = np.nan_to_num(solution.alone.error, nan=np.inf), solution.residuals.relative_error
    # Over the motor's size, as its residual is; a motor that gives little has a size above its torque.
    sized = error * solution.expected.residual / np.maximum(own, np.finfo(float).tiny)
    return np.asarray((error < _BETTER * own) & (sized < MOTOR_ERROR_LIMIT))


def added_error(solution: RigidSolution) -> FloatArray:
    """Returns what the covariance of the parameters adds (n_joint,) on other motions to what the own log shows."""
    expected = solution.expected
    own = np.fmax(expected.left_out, expected.residual)
    return np.asarray(np.sqrt(np.maximum(expected.error**2 - own**2, 0.0)))
