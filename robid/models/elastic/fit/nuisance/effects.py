"""What a nuisance parameter does: moves the robot, a value that no fit estimates, or the response alone."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.nuisance import moves
from robid.models.elastic.fit.nuisance.moves import PERCENT
from robid.robot.description import Robot, Spring

MICRO = 1e-6
SHARE_STEP = 1e-4  # of differences by a share
STICKS = 1e3  # over the swing: bristles that never slip


@dataclass(frozen=True)
class Effect:
    """What a nuisance parameter does; `nuisance.columns.column` has the column of each."""

    put_in: ClassVar[bool] = True  # Whether a robot can be off by it; else a response is, as its column says
    by_cluster: ClassVar[bool] = False  # Whether it may differ between clusters of one robot


@dataclass(frozen=True)
class RobotMove(Effect):
    """A robot whose file says something else: central differences of its response, statics included."""

    moved: Callable[[Robot, float], Robot]  # Returns a robot that is off by an amount from another one
    step: float  # Amount of a difference


@dataclass(frozen=True)
class TorqueScale(Effect):
    """A measured torque that is too large by some percent: its column of the response is too small."""

    put_in = False
    joint: int  # Index of the motor
    # Whether masses were found by the same torques, in a rigid fit: the joint's link is too heavy by as much. Torques,
    # masses and springs by one factor are the same response, so such masses do not determine the constant.
    shared: bool = False

    @property
    def slope(self) -> float:
        """Derivative of the log response to its torque by the amount."""
        return -1 / PERCENT

    @property
    def heavier(self) -> RobotMove:
        """The link that is heavier by as many percent."""
        return RobotMove(partial(moves.with_carried_share, self.joint), PERCENT * SHARE_STEP)


@dataclass(frozen=True)
class LateDrive(Effect):
    """A drive whose torque acts, or whose angle is read, later than those of the others; only where a fit frees it."""

    put_in = False
    joint: int  # Index of the motor
    of: Literal["torque", "angle"]  # What is late
    amount_s: float = MICRO  # How much later an amount of one is [s]


@dataclass(frozen=True)
class ValueOff(Effect):
    """A parameter that no fit estimates is off from what the file says.

    Amounts are percent of springs, dampers and rotors, microseconds of a delay, and of viscous friction percent of what
    the inertia that it acts on asks for at 10 Hz.
    """

    kind: Literal["stiffness", "damping", "motor_inertia", "viscous", "arm_viscous", "delay"]  # Kind of the parameter
    element: int  # Index of the element of that kind


@dataclass(frozen=True)
class MotorFriction(Effect):
    """A torque that follows a motor's angle, in percent of what its rotor asks for at 10 Hz."""

    by_cluster = True
    joint: int  # Index of the motor
    phase: complex  # Its direction in the complex plane: 1 as a spring's, 1j as that of a loss whatever the speed


@dataclass(frozen=True)
class GearShare(Effect):
    """Something beside a gear's stiffness, as a share of it."""

    by_cluster = True
    spring: int  # Index of the gear


@dataclass(frozen=True)
class Hysteresis(GearShare):
    """A bristle beside a gear, amounts in percent of loss factor where it loses most.

    A bristle that slips at a deflection `h` obeys `dz/dt = dx/dt - |dx/dt| z / h`. Under a normal motion whose speed
    has the deviation `v` it does as a spring in series with a damper: its torque goes with `g jw / (jw + w_h)` times
    the deflection, with the corner `w_h = sqrt(2 / pi) v / h` and a gain `g` below one. It stiffens what moves little
    or fast, and loses most at the corner, half as much. It does most harm where it slips at about the swing, the
    deflection's root mean square over the configurations, as predicted from the measured torques.

    Source:
        Dahl (1968); statistical linearisation as in Roberts and Spanos (1990), ch. 8; docs/methods, sec. 1.
    """

    slip: float  # Where it slips, over the swing


@dataclass(frozen=True)
class LoadStiffness(GearShare):
    """A gear that is stiffer by some percent at the largest of its loads than at their mean."""


@dataclass(frozen=True)
class OneSided(GearShare):
    """A gear that is stiffer by some percent bent one way, and as much softer the other way; where a fit frees it."""


@dataclass(frozen=True)
class Compliance(Effect):
    """A spring that is there in truth, in percent of its joint's gear's compliance, statics included."""

    spring: Spring  # The spring, as stiff as the gear


@dataclass(frozen=True)
class LoadDamping(Effect):
    """A damper that grows with its gear's deflection, amounts in shares per deflection; only where a fit frees it."""

    spring: int


@dataclass(frozen=True)
class SlipTorque(Effect):
    """Bristles beside a gear, a tenth as stiff; amounts add to the torque of slip; only where a fit frees it."""

    spring: int
    known: float = 0.0  # Torque at which they are known to slip [N m, or N]


@dataclass(frozen=True)
class PerturbedRobot:
    """A robot whose rigid parameters are off along one of several independent directions."""

    robot: Robot  # The robot
    deviations: float  # By how many standard deviations; not zero


@dataclass(frozen=True)
class RigidError(Effect):
    """An independent error of a rigid fit, amounts in standard deviations."""

    put_in = False
    off: PerturbedRobot  # What the rigid fit found, off along the direction


@dataclass(frozen=True)
class Drift(Effect):
    """A motor's viscous friction that grows evenly from configuration to configuration; only where a fit frees it.

    An amount is what it has at the last configuration more than in the mean, and at the first less, in percent of what
    the rotor asks for at 10 Hz.
    """

    put_in = False
    joint: int  # Index of the motor


@dataclass(frozen=True)
class LoadFriction(Effect):
    """A motor's friction that grows with what its gear carries at rest; only where a fit frees it.

    An amount is what it has more for each mrad (mm) that the load bends its gear, in percent of what the rotor asks for
    at 10 Hz: as viscous friction, or as a torque per angle, for motors that hardly slide cling.
    """

    put_in = False
    joint: int  # Index of the motor
    spring: int  # Index of its gear
    phase: complex | None  # Of that torque, 1 of a spring and j of a constant loss; None for viscous friction


@dataclass(frozen=True)
class Nuisance:
    """A nuisance parameter of one robot. Amounts are zero where the file is right."""

    name: str  # What it is, in one word as parameters are named: `axis_2.mass`
    title: str  # The same for a sentence
    cause: str  # Its likely cause, of `robid.results.finding.CAUSES`, or what only a fit's wish frees
    unit: str  # Unit of its amounts
    common_std: float  # Standard deviation of the amount that all clusters share
    cluster_std: float  # Standard deviation of what each cluster adds to that
    effect: Effect  # What it does
    least: float = -np.inf  # Smallest amount that makes sense
    most: float = np.inf  # Largest amount that makes sense
    stated: float = 0.0  # What the robot file says in the same unit, where that is said; zero where only amounts are
    natural: float = 1.0  # Amount from which it matters: where the file says nothing, its deviation is judged by it


def torque_slopes(nuisances: Sequence[Nuisance], n_joint: int) -> FloatArray:
    """Derivatives (n_nuisance, n_joint) of the log response to each motor's torque by the amounts."""
    slopes = np.zeros((len(nuisances), n_joint))
    for row, each in enumerate(nuisances):
        if isinstance(each.effect, TorqueScale):
            slopes[row, each.effect.joint] = each.effect.slope
    return slopes


def late_slopes(
    nuisances: Sequence[Nuisance], inputs: Sequence[str], outputs: Sequence[str]
) -> tuple[FloatArray, FloatArray] | None:
    """By how much later an amount of each makes torques (n_nuisance, n_in) and outputs (n_nuisance, n_out) [s].

    Args:
        nuisances: The nuisance parameters.
        inputs: Names of the motors, joint by joint.
        outputs: Names of the outputs.

    Returns:
        Both; None where none is of a late drive.
    """
    torque, angle = np.zeros((len(nuisances), len(inputs))), np.zeros((len(nuisances), len(outputs)))
    for row, each in enumerate(nuisances):
        if isinstance(each.effect, LateDrive) and each.effect.of == "torque":
            torque[row, each.effect.joint] = each.effect.amount_s
        elif isinstance(each.effect, LateDrive) and inputs[each.effect.joint] in outputs:
            angle[row, outputs.index(inputs[each.effect.joint])] = each.effect.amount_s
    return (torque, angle) if torque.any() or angle.any() else None


def moved_robot(robot: Robot, nuisances: Sequence[Nuisance], amounts: FloatArray) -> Robot:
    """Returns a robot that is off by some amounts (n_nuisance,)."""
    for each, amount in zip(nuisances, amounts.tolist(), strict=True):
        if isinstance(each.effect, RobotMove) and amount:
            robot = each.effect.moved(robot, amount)
    return robot
