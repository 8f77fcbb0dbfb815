"""The nuisance parameters of an elastic fit: what a robot file may have wrong, in one table.

A row (`Kind`) says what is off, how far off it may be, and what it does: another robot, another value of a parameter
that no fit estimates, or a column of the response alone. Rows of one owner stand together; `WIDENING` widen the
intervals, `ESTIMABLE` are what a fit can estimate. One more kind is one more row here and, where its effect is new, a
function in `nuisance.response`. Priors are stated in `robid.robot.nuisance`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import ClassVar, Literal, TypeAlias

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.nuisance import moves
from robid.models.elastic.fit.nuisance.moves import MM, PERCENT, Change, missing_springs
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Inertial, Joint, Robot, Spring
from robid.robot.nuisance import NuisanceStd

PRIOR_FACTOR = 10.0
"""How many times as far off as a nuisance parameter is one expected to be that a user frees."""
ZERO = "zero"
"""Cause and end of the name of zeros that are off."""
DRIFT = "drift"
"""End of the names of viscous friction that drifts."""
ONE_SIDED = "one_sided"
"""End of the names of gears that are stiffer one way."""
BALANCE, LOAD_DAMPING, HYSTERESIS, FIXED = "counterbalance", "load_damping", "hysteresis", "held_spring"
"""Causes, the first three of them the ends of the names that free them."""
MICRO = 1e-6
_SHARE_STEP, _STEP_M, _TURN_STEP, _STEP_NM, _STEP_DEG = 1e-4, 1e-5, 1e-2, 1.0, 1e-3  # of differences
_MOST_DEG = 20.0  # of a zero
_ONE_SIDED, _DRIFT = 10.0, 5.0  # percent
_LATE_US = 500.0  # of a drive, where it matters
_WRIST, _WITH_WRIST = 3, 6  # joints of a wrist whose motors sit before it, and of an arm that has one
_BALANCE_SHARE, _BALANCE_NM = 0.1, 100.0  # of the arm-side torque that the motor can give; where nobody says that
_GROWTH, _SLIP_SHARE, _TORQUE_NM = 3.0, 0.005, 2e3  # of a damper up to that torque, of it, and where nobody says it
_STICKS = 1e3  # over the swing: bristles that never slip
_OF_LINK = "% of what its link's inertia asks for at 10 Hz"
_OF_ROTOR = "% of what its rotor asks for at 10 Hz"


@dataclass(frozen=True)
class Effect:
    """What a nuisance parameter does; `nuisance.response.column` has the column of each."""

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
        return RobotMove(partial(moves.with_carried_share, self.joint), PERCENT * _SHARE_STEP)


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
    """Bristles beside a gear, a tenth as stiff, amounts in the torque at which they slip; only where a fit frees it."""

    spring: int


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


@dataclass(frozen=True)
class Owner:
    """A part of a robot of which something may be off."""

    name: str  # Its name, with which those of its nuisance parameters begin; empty for the drives
    title: str  # The same for a sentence
    priors: object  # What has the deviations as attributes
    at: tuple[int, ...] = ()  # Its indices among the robot's parts
    more: str = ""  # What the names of its nuisance parameters end on
    linear: bool = False  # Whether it slides

    def named(self, ending: str) -> str:
        """Returns the name of what is its own."""
        return f"{self.name}.{ending}{self.more}" if self.name else ending


@dataclass(frozen=True)
class Kind:
    """A kind of nuisance parameter: a row of the table. Effect and size are those of a robot's part at its indices."""

    ending: str  # What the names end on, after the owner's
    title: str  # The same for a sentence, `{}` for the owner's
    cause: str  # The likely cause that it stands for
    effect: Callable[..., Effect | None]  # What it does; None where the owner has no such thing
    prior: str = ""  # Which of the owner's priors is its deviation, as they are stated; none where only a fit frees it
    size: float | Callable[..., float] = PERCENT  # Amount of a prior of one
    unit: str = "%"  # Unit of the amounts
    linear_unit: str = ""  # That of owners that slide, where it is another
    cluster: float = 0.0  # What each cluster adds, over the deviation
    least: float = -np.inf  # Smallest amount that makes sense, over the size
    most: float = np.inf  # Largest one
    stated: bool = False  # Whether the size is what the file states
    parameter: str = ""  # Kind of the fit's own parameters that take its place where they are estimated

    def of(self, robot: Robot, owner: Owner, *, by_default: bool = False) -> Nuisance | None:
        """Returns that of an owner; None where it has none, or where the file is taken for granted.

        Args:
            robot: The robot.
            owner: Its part.
            by_default: Whether what is taken for granted is as far off as by default.
        """
        size = self.size(robot, *owner.at) if callable(self.size) else self.size
        prior = float(getattr(owner.priors, self.prior)) if self.prior else 1.0
        prior = prior or (float(getattr(NuisanceStd(), self.prior)) if by_default else 0.0)
        effect = self.effect(robot, *owner.at)
        if effect is None or not size * prior > 0:
            return None
        return Nuisance(
            owner.named(self.ending),
            self.title.format(owner.title),
            self.cause,
            self.linear_unit if owner.linear and self.linear_unit else self.unit,
            size * prior,
            self.cluster * size * prior,
            effect,
            self.least * size,
            self.most * size,
            size if self.stated else 0.0,
            1.0 if self.prior else size,
        )


Section: TypeAlias = tuple[Callable[[Robot], Iterable[Owner]], tuple[Kind, ...]]
"""The owners of a robot, and what may be off of each of them."""


def _joints(robot: Robot, title: str = "{}") -> Iterator[Owner]:
    for index, joint in enumerate(robot.joints):
        yield Owner(joint.name, title.format(joint.name), joint.nuisance_std, (index,))


_links = partial(_joints, title="link {}")


def _rotors(robot: Robot) -> Iterator[Owner]:
    for index, joint in enumerate(robot.joints):
        yield Owner(joint.name, joint.name, joint.motor, (index,))


def _bases(robot: Robot) -> Iterator[Owner]:
    if robot.base is not None and any(spring.place == "base" for spring in robot.springs):
        yield Owner("base", "the base", robot.nuisance_std)


def _payloads(robot: Robot) -> Iterator[Owner]:
    if robot.payload.mass_kg > 0:
        yield Owner("payload", "the payload", robot.nuisance_std)


def _drives(robot: Robot) -> Iterator[Owner]:
    yield Owner("", "", robot.nuisance_std)


def _springs(robot: Robot) -> Iterator[Owner]:
    for index, spring in enumerate(robot.springs):
        priors = robot.nuisance_std if spring.place in ("base", "payload") else robot.joints[spring.joint].nuisance_std
        yield Owner(spring.name, spring.name, priors, (index,), linear=robot.is_linear(spring))


def _gears(robot: Robot) -> Iterator[Owner]:
    return (owner for owner in _springs(robot) if robot.springs[owner.at[0]].place == "transmission")


def _shafts(robot: Robot) -> Iterator[Owner]:
    for index, spring in enumerate(robot.springs):
        if spring.inertia_kgm2 > 0:
            yield Owner(spring.name, spring.name, robot.joints[spring.joint].nuisance_std, (index,))


def _missing(robot: Robot) -> Iterator[Owner]:
    for index, spring in enumerate(missing_springs(robot)):
        priors = robot.nuisance_std if spring.place == "base" else robot.joints[spring.joint].nuisance_std
        yield Owner(spring.name, spring.name.replace("_", " "), priors, (index,))


def _couplings(robot: Robot) -> Iterator[Owner]:
    """Gear couplings: those that the file states, and those of an arm's wrist."""
    n_joint = len(robot.joints)
    wrist = range(n_joint - _WRIST, n_joint) if n_joint >= _WITH_WRIST else range(0)
    for index, joint in enumerate(robot.joints):
        for other, driven in enumerate(robot.joints):
            inside = other < index and index in wrist and other in wrist
            turning = joint.type == driven.type == "revolute" and other != index and not robot.rigid[index]
            if turning and (inside or driven.name in joint.couplings):
                title = f"turn of {joint.name} by the motor of {driven.name}"
                yield Owner(joint.name, title, joint.nuisance_std, (index, other), driven.name)


def _unbalanced(robot: Robot) -> Iterator[Owner]:
    """Joints that turn; none where the file states counterbalances, which the elastic model does not know."""
    if all(joint.counterbalance is None for joint in robot.joints):
        for owner in _joints(robot):
            if robot.joints[owner.at[0]].type == "revolute":
                yield owner


def _link(robot: Robot, index: int) -> tuple[Inertial, Change, FloatArray]:
    return robot.joints[index].link, partial(moves.with_link, index), robot.link_axes(index)


def _base(robot: Robot) -> tuple[Inertial, Change, FloatArray]:
    return robot.base or robot.payload, moves.with_base, np.eye(3)


def _payload(robot: Robot) -> tuple[Inertial, Change, FloatArray]:
    return robot.payload, moves.with_payload, robot.payload_axes


_Body: TypeAlias = Callable[..., tuple[Inertial, Change, FloatArray]]
"""Returns a body, the change of it, and the axes (3, 3) of the frame that the file states it in."""


def _heavier(body: _Body, robot: Robot, *at: int) -> Effect:
    return RobotMove(partial(moves.heavier, body(robot, *at)[1]), PERCENT * _SHARE_STEP)


def _shift(body: _Body, axis: FloatArray, robot: Robot, *at: int) -> Effect | None:
    own, change, axes = body(robot, *at)
    # Along the axes of the file's own frame, so that an amount is what is to be added to the file.
    return RobotMove(partial(moves.shifted, change, axes @ axis), MM * _STEP_M) if own.mass_kg > 0 else None


def _more_inert(body: _Body, robot: Robot, *at: int) -> Effect | None:
    own, change, _ = body(robot, *at)
    return RobotMove(partial(moves.more_inert, change), PERCENT * _SHARE_STEP) if own.inertia_kgm2.any() else None


def _body(cause: str, body: _Body, mass: Kind, com: str, inertia: str) -> tuple[Kind, ...]:
    """What may be off of a body: its mass, with its inertia, its centre of mass, and its inertia alone."""
    centres = (
        Kind(
            f"com_{letter}", f"centre of mass of {{}} along {letter}", cause, partial(_shift, body, axis),
            com, MM, "mm", least=-0.5, most=0.5,
        )
        for axis, letter in zip(np.eye(3), "xyz", strict=True)
    )  # fmt: skip
    return mass, *centres, Kind("inertia", "inertia of {}", cause, partial(_more_inert, body), inertia, least=-1.0)


def _mass(body: _Body) -> Kind:
    return Kind("mass", "mass of {}", "masses", partial(_heavier, body), "mass_relative_std", least=-1.0, most=1.0)


def _most_torque(joint: Joint, otherwise: float, share: float = 1.0) -> float:
    """A share of the arm-side torque that a motor can give, where that is known [N m]."""
    most = abs(joint.motor.max_torque_nm * joint.motor.gear_ratio)
    return share * most if np.isfinite(most) else otherwise


def _likely_nm(robot: Robot, index: int) -> float:
    return _most_torque(robot.joints[index], _BALANCE_NM, _BALANCE_SHARE)


def _likely_growth(robot: Robot, index: int) -> float:
    spring = robot.springs[index]
    return _GROWTH * spring.stiffness / _most_torque(robot.joints[spring.joint], _TORQUE_NM)


def _likely_slip(robot: Robot, index: int) -> float:
    return _SLIP_SHARE * _most_torque(robot.joints[robot.springs[index].joint], _TORQUE_NM)


def _zero(robot: Robot, index: int) -> Effect | None:
    slides = robot.joints[index].type == "prismatic"
    return None if slides else RobotMove(partial(moves.with_zero, index), _STEP_DEG)


def _fixed(kind: Literal["stiffness", "damping"], robot: Robot, index: int) -> Effect | None:
    return ValueOff(kind, index) if getattr(robot.springs[index], kind) > 0 else None


# A row: ending, title, cause, effect, prior, size, unit. `least` and `most` bound an amount by what makes sense: no
# mass is negative, no hysteresis gains energy.
# fmt: off
PAYLOAD: Section = (_payloads, _body("payload", _payload, Kind(
    "mass", "payload mass", "payload",
    lambda robot: RobotMove(moves.with_payload_mass, _SHARE_STEP * robot.payload.mass_kg),
    "payload_relative_std", lambda robot: robot.payload.mass_kg, "kg", least=-1.0, most=1.0, stated=True,
), "payload_com_m", "payload_inertia_relative_std"))
LINKS: Section = (_links, _body("masses", _link, _mass(_link), "com_m", "inertia_relative_std"))
BASE: Section = (_bases, _body("masses", _base, _mass(_base), "com_m", "inertia_relative_std"))
SHAFTS: Section = (_shafts, (Kind(
    "inertia", "inertia of shaft {}", "masses",
    lambda _, index: RobotMove(partial(moves.with_shaft_share, index), PERCENT * _SHARE_STEP),
    "inertia_relative_std", least=-1.0,
),))
ZEROS: Section = (_joints, (Kind(
    ZERO, "zero of {}", ZERO, _zero, "zero_deg", 1.0, "deg", least=-_MOST_DEG, most=_MOST_DEG,
),))
TORQUES: Section = (_joints, (Kind(
    "torque_constant", "torque constant of {}", "torque_constant", lambda _, index: TorqueScale(index),
    # What temperature does differs between clusters.
    "torque_relative_std", cluster=0.25, least=-1.0, most=1.0,
),))
DELAY: Section = (_drives, (Kind(
    "delay", "delay of the drives", "delay", lambda _: ValueOff("delay", 0),
    "delay_s", 1 / MICRO, "us", parameter="delay",
),))
ROTORS: Section = (_rotors, (Kind(
    "motor_inertia", "rotor inertia of {}", "rotor_inertia", lambda _, index: ValueOff("motor_inertia", index),
    "inertia_relative_std", least=-1.0, most=1.0, parameter="motor_inertia",
),))
COUPLINGS: Section = (_couplings, (Kind(
    "coupling_", "{}", "gear_coupling",
    lambda _, index, other: RobotMove(partial(moves.with_coupling, index, other), _TURN_STEP),
    "coupling_std", unit="% of a turn",
),))
GEARS: Section = (_gears, (
    # What slips between early and late is a mixture of both. What never slips stiffens a spring without any loss,
    # alike in all clusters: nothing distinguishes it from the spring.
    *(
        Kind(
            f"hysteresis_{when}", f"hysteresis of {{}} that slips {when}", "gear_nonlinearity",
            lambda _, index, slip=slip: Hysteresis(index, slip),
            "loss_factor", cluster=cluster, least=0.0, most=1.0,
        )
        for when, slip, cluster in (("early", 0.5, 1.0), ("late", 2.0, 1.0), ("never", _STICKS, 0.0))
    ),
    Kind(
        "load_stiffness", "stiffness of {} by its load", "gear_nonlinearity", lambda _, index: LoadStiffness(index),
        "load_stiffness", least=-1.0, most=1.0, parameter="cubic",
    ),
))
ARM_FRICTION: Section = (_joints, (Kind(
    "arm_viscous", "viscous friction of {}'s arm", "arm_friction",
    # The arm of a rigid joint moves as its motor does, whose friction says it all.
    lambda robot, index: None if robot.rigid[index] else ValueOff("arm_viscous", index),
    "arm_friction", unit=_OF_LINK, cluster=1.0, least=0.0, most=1.0, parameter="arm_viscous",
),))
MOTOR_FRICTION: Section = (_joints, (Kind(
    "viscous", "viscous friction of {}'s motor", "friction", lambda _, index: ValueOff("viscous", index),
    "friction", unit=_OF_ROTOR, cluster=1.0, least=-1.0, most=1.0, parameter="viscous",
),))
OTHER_FRICTION: Section = (_joints, tuple(
    Kind(
        ending, f"friction of {{}} {what}", "friction", lambda _, index, phase=phase: MotorFriction(index, phase),
        "friction", unit=_OF_ROTOR, cluster=1.0, least=-1.0, most=1.0,
    )
    for ending, what, phase in (
        ("friction_spring", "in phase with its angle", 1.0), ("friction_loss", "that loses energy", 1j),
    )
))
# What has no stiffness is no spring, so nine tenths of it are the most that can be missing.
FIXED_SPRINGS: Section = (_springs, (
    Kind(
        "stiffness", "{}", FIXED, partial(_fixed, "stiffness"),
        "stiffness_relative_std", least=-0.9, most=9.0, parameter="stiffness",
    ),
    Kind(
        "damping", "{}'s damper", FIXED, partial(_fixed, "damping"),
        "damping_relative_std", least=-0.9, most=9.0, parameter="damping",
    ),
))
MISSING_SPRINGS: Section = (_missing, (Kind(
    "compliance", "{}", "missing_spring", lambda robot, index: Compliance(list(missing_springs(robot))[index]),
    "compliance", unit="% of its gear's compliance", least=0.0,
),))
LATE_DRIVES: Section = (_joints, tuple(
    Kind(
        f"late_{of}", f"{of} of {{}} late by", "delay", lambda _, index, of=of: LateDrive(index, of),
        size=_LATE_US, unit="us",
    )
    for of in ("torque", "angle")
))
DRIFTS: Section = (_joints, (Kind(
    DRIFT, "half the growth of {}'s viscous friction over the campaign", "unsteady", lambda _, index: Drift(index),
    size=_DRIFT, unit=_OF_ROTOR,
),))
BALANCES: Section = (_unbalanced, tuple(
    Kind(
        f"{BALANCE}_{wave}", f"{BALANCE} of {{}} by the {wave} of its angle", BALANCE,
        lambda _, index, row=row: RobotMove(partial(moves.with_balance, index, np.eye(2)[row]), _STEP_NM),
        size=_likely_nm, unit="N m",
    )
    for row, wave in enumerate(("sine", "cosine"))
))
GEAR_EFFECTS: Section = (_gears, (
    Kind(
        LOAD_DAMPING, "growth of {}'s damper with its deflection", LOAD_DAMPING, lambda _, index: LoadDamping(index),
        # Downwards, no damper may become negative.
        size=_likely_growth, unit="1/rad", linear_unit="1/m", least=-1 / _GROWTH,
    ),
    Kind(
        ONE_SIDED, "stiffness of {} by the sign of its load", "gear_nonlinearity", lambda _, index: OneSided(index),
        size=_ONE_SIDED, unit="%", least=-5.0, most=5.0,
    ),
    Kind(
        HYSTERESIS, "hysteresis of {}", HYSTERESIS, lambda _, index: SlipTorque(index),
        size=_likely_slip, unit="N m", linear_unit="N",
    ),
))
# fmt: on

WIDENING: tuple[Section, ...] = (
    *(PAYLOAD, LINKS, BASE, SHAFTS, TORQUES, DELAY, ROTORS, COUPLINGS, GEARS),
    *(ARM_FRICTION, MOTOR_FRICTION, OTHER_FRICTION, FIXED_SPRINGS, MISSING_SPRINGS, ZEROS),
)
"""What widens the intervals of every fit that does not estimate it."""
ESTIMABLE: tuple[Section, ...] = (
    PAYLOAD,
    LINKS,
    BASE,
    SHAFTS,
    ZEROS,
    COUPLINGS,
    TORQUES,
    LATE_DRIVES,
    DRIFTS,
    BALANCES,
    GEAR_EFFECTS,
)
"""What a fit can estimate, in the order of its parameters; the last four only where one does."""


def list_nuisances(robot: Robot, options: ElasticOptions, rigid: Sequence[PerturbedRobot] = ()) -> tuple[Nuisance, ...]:
    """Lists the nuisance parameters of a robot file with the priors that it states.

    What the fit estimates is none: springs, dampers, rotor inertias, viscous friction, delay, cubic gears, nuisance
    parameters that are estimated and not fixed.

    Args:
        robot: The robot that the fit starts from, with its campaign's payload.
        options: Options of the fit.
        rigid: Robots that are off along the independent directions that a rigid fit leaves open, which take the place
            of the file's links.
    """
    estimated = {each.name for each in estimated_nuisances(robot, options)}.difference(options.fixed)
    return tuple(_left(_widening(robot, options, rigid), estimated))


def _widening(robot: Robot, options: ElasticOptions, rigid: Sequence[PerturbedRobot]) -> Iterator[Nuisance]:
    for section in WIDENING:
        if rigid and section is LINKS:
            for number, off in enumerate(rigid, start=1):
                title = f"error {number} of the rigid fit"
                yield Nuisance(f"rigid.{number}", title, "masses", "std", 1.0, 0.0, RigidError(off))
            continue
        owners, kinds = section
        for owner in owners(robot):
            for kind in kinds:
                own = bool(kind.parameter) and options.estimates(kind.parameter, owner.named(kind.parameter))
                found = None if own else kind.of(robot, owner)
                if found is not None and rigid and isinstance(found.effect, TorqueScale):
                    found = replace(found, effect=replace(found.effect, shared=True))
                if found is not None:
                    yield found


def _left(every: Iterable[Nuisance], estimated: set[str]) -> Iterator[Nuisance]:
    for each in every:
        gear = f"{each.name.rpartition('.')[0]}.{HYSTERESIS}"
        left = left_of_estimated(each) if each.name in estimated else each
        if left is not None and not (isinstance(each.effect, Hysteresis) and gear in estimated):
            yield left


def left_of_estimated(nuisance: Nuisance) -> Nuisance | None:
    """What is left once a fit estimates one: of a torque constant, masses that the same torques gave."""
    effect = nuisance.effect
    if not isinstance(effect, TorqueScale) or not effect.shared:
        return None
    name, title = f"{nuisance.name.rpartition('.')[0]}.mass_by_torque", f"mass by {nuisance.title}"
    return replace(nuisance, name=name, title=title, cause="masses", cluster_std=0.0, effect=effect.heavier)


def estimable_nuisances(robot: Robot) -> tuple[Nuisance, ...]:
    """Lists all that a fit can estimate; what the file takes for granted is as far off as by default."""
    every = (
        kind.of(robot, owner, by_default=True)
        for owners, kinds in ESTIMABLE
        for owner in owners(robot)
        for kind in kinds
    )
    return tuple(each for each in every if each is not None)


def estimated_nuisances(robot: Robot, options: ElasticOptions) -> tuple[Nuisance, ...]:
    """Lists those that a fit estimates, each as often as it is named.

    Args:
        robot: The robot that the fit starts from, with its campaign's payload.
        options: Options of the fit; what they name that the robot does not have is left out.
    """
    if not options.estimated:
        return ()
    return tuple(each for each in estimable_nuisances(robot) if any(names(each, name) for name in options.estimated))


def names(nuisance: Nuisance, name: str) -> bool:
    """Whether a name is its own, or of its group: its cause, or its name as far as the last underscore."""
    return name in (nuisance.name, nuisance.cause) or nuisance.name.startswith(f"{name}_")


def slipping_name(nuisance: Nuisance) -> str | None:
    """Name of what frees the hysteresis that one stands for; None of others, and of bristles that stick."""
    effect = nuisance.effect
    if not isinstance(effect, Hysteresis) or effect.slip == _STICKS:
        return None
    return f"{nuisance.name.rpartition('.')[0]}.{HYSTERESIS}"


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
