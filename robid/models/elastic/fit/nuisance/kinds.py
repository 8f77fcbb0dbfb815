"""The nuisance parameters of an elastic fit: what a robot file may have wrong, in one table.

A row (`Kind`) says what is off, how far off it may be, and what it does: another robot, another value of a parameter
that no fit estimates, or a column of the response alone. Rows of one owner stand together; `WIDENING` widen the
intervals, `ESTIMABLE` are what a fit can estimate. One more kind is one more row here and, where its effect is new, a
function in `nuisance.columns`. Priors are stated in `robid.robot.nuisance`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Literal, TypeAlias

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.nuisance import moves
from robid.models.elastic.fit.nuisance.effects import (
    MICRO,
    SHARE_STEP,
    STICKS,
    Compliance,
    Drift,
    Effect,
    Hysteresis,
    LateDrive,
    LoadDamping,
    LoadFriction,
    LoadStiffness,
    MotorFriction,
    Nuisance,
    OneSided,
    RobotMove,
    SlipTorque,
    TorqueScale,
    ValueOff,
)
from robid.models.elastic.fit.nuisance.moves import MM, PERCENT, Change, missing_springs
from robid.models.elastic.fit.nuisance.owners import (
    Owner,
    bases,
    couplings,
    drives,
    gears,
    joints,
    links,
    missing,
    payloads,
    rotors,
    shafts,
    springs,
    unbalanced,
)
from robid.robot.description import Inertial, Joint, Robot
from robid.robot.nuisance import NuisanceStd

PRIOR_FACTOR = 10.0
"""How many times as far off as a nuisance parameter is one expected to be that a user frees."""
ZERO = "zero"
"""Cause and end of the name of zeros that are off."""
DRIFT = "drift"
"""End of the names of viscous friction that drifts."""
LOAD_FRICTION = "load_friction"
"""Name, after the joint's, of friction that grows with the load of its gear; those of its parts begin so."""
ONE_SIDED = "one_sided"
"""End of the names of gears that are stiffer one way."""
BALANCE, LOAD_DAMPING, HYSTERESIS, FIXED = "counterbalance", "load_damping", "hysteresis", "held_spring"
"""Causes, the first three of them the ends of the names that free them."""
_STEP_M, _TURN_STEP, _STEP_NM, _STEP_DEG = 1e-5, 1e-2, 1.0, 1e-3  # of differences
_MOST_DEG = 20.0  # of a zero
_ONE_SIDED, _DRIFT = 10.0, 5.0  # percent
_BY_LOAD = 20.0  # percent for each mrad
_LATE_US = 500.0  # of a drive, where it matters
_BALANCE_SHARE, _BALANCE_NM = 0.1, 100.0  # of the arm-side torque that the motor can give; where nobody says that
_GROWTH, _SLIP_SHARE, _TORQUE_NM = 3.0, 0.005, 2e3  # of a damper up to that torque, of it, and where nobody says it
_OF_LINK = "% of what its link's inertia asks for at 10 Hz"
_OF_ROTOR = "% of what its rotor asks for at 10 Hz"


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
    stated: Callable[..., float] | None = None  # What is stated of it, where amounts add to that
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
            self.stated(robot, *owner.at) if self.stated else 0.0,
            1.0 if self.prior else size,
        )


Section: TypeAlias = tuple[Callable[[Robot], Iterable[Owner]], tuple[Kind, ...]]
"""The owners of a robot, and what may be off of each of them."""


def _link(robot: Robot, index: int) -> tuple[Inertial, Change, FloatArray]:
    return robot.joints[index].link, partial(moves.with_link, index), robot.link_axes(index)


def _base(robot: Robot) -> tuple[Inertial, Change, FloatArray]:
    return robot.base or robot.payload, moves.with_base, np.eye(3)


def _payload(robot: Robot) -> tuple[Inertial, Change, FloatArray]:
    return robot.payload, moves.with_payload, robot.payload_axes


def _payload_kg(robot: Robot) -> float:
    return robot.payload.mass_kg


_Body: TypeAlias = Callable[..., tuple[Inertial, Change, FloatArray]]
"""Returns a body, the change of it, and the axes (3, 3) of the frame that the file states it in."""


def _heavier(body: _Body, robot: Robot, *at: int) -> Effect:
    return RobotMove(partial(moves.heavier, body(robot, *at)[1]), PERCENT * SHARE_STEP)


def _shift(body: _Body, axis: FloatArray, robot: Robot, *at: int) -> Effect | None:
    own, change, axes = body(robot, *at)
    # Along the axes of the file's own frame, so that an amount is what is to be added to the file.
    return RobotMove(partial(moves.shifted, change, axes @ axis), MM * _STEP_M) if own.mass_kg > 0 else None


def _more_inert(body: _Body, robot: Robot, *at: int) -> Effect | None:
    own, change, _ = body(robot, *at)
    return RobotMove(partial(moves.more_inert, change), PERCENT * SHARE_STEP) if own.inertia_kgm2.any() else None


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


def _known_slip(robot: Robot, index: int) -> float:
    return robot.springs[index].slip


def _zero(robot: Robot, index: int) -> Effect | None:
    slides = robot.joints[index].type == "prismatic"
    return None if slides else RobotMove(partial(moves.with_zero, index), _STEP_DEG)


def _fixed(kind: Literal["stiffness", "damping"], robot: Robot, index: int) -> Effect | None:
    return ValueOff(kind, index) if getattr(robot.springs[index], kind) > 0 else None


def _by_load(phase: complex | None, robot: Robot, index: int) -> Effect | None:
    gears = [row for row, spring in enumerate(robot.springs) if (spring.place, spring.joint) == ("transmission", index)]
    return LoadFriction(index, gears[0], phase) if gears else None


# A row: ending, title, cause, effect, prior, size, unit. `least` and `most` bound an amount by what makes sense: no
# mass is negative, no hysteresis gains energy.
# fmt: off
PAYLOAD: Section = (payloads, _body("payload", _payload, Kind(
    "mass", "payload mass", "payload",
    lambda robot: RobotMove(moves.with_payload_mass, SHARE_STEP * robot.payload.mass_kg),
    "payload_relative_std", _payload_kg, "kg", least=-1.0, most=1.0, stated=_payload_kg,
), "payload_com_m", "payload_inertia_relative_std"))
LINKS: Section = (links, _body("masses", _link, _mass(_link), "com_m", "inertia_relative_std"))
BASE: Section = (bases, _body("masses", _base, _mass(_base), "com_m", "inertia_relative_std"))
SHAFTS: Section = (shafts, (Kind(
    "inertia", "inertia of shaft {}", "masses",
    lambda _, index: RobotMove(partial(moves.with_shaft_share, index), PERCENT * SHARE_STEP),
    "inertia_relative_std", least=-1.0,
),))
ZEROS: Section = (joints, (Kind(
    ZERO, "zero of {}", ZERO, _zero, "zero_deg", 1.0, "deg", least=-_MOST_DEG, most=_MOST_DEG,
),))
TORQUES: Section = (joints, (Kind(
    "torque_constant", "torque constant of {}", "torque_constant", lambda _, index: TorqueScale(index),
    # What temperature does differs between clusters.
    "torque_relative_std", cluster=0.25, least=-1.0, most=1.0,
),))
DELAY: Section = (drives, (Kind(
    "delay", "delay of the drives", "delay", lambda _: ValueOff("delay", 0),
    "delay_s", 1 / MICRO, "us", parameter="delay",
),))
ROTORS: Section = (rotors, (Kind(
    "motor_inertia", "rotor inertia of {}", "rotor_inertia", lambda _, index: ValueOff("motor_inertia", index),
    "inertia_relative_std", least=-1.0, most=1.0, parameter="motor_inertia",
),))
COUPLINGS: Section = (couplings, (Kind(
    "coupling_", "{}", "gear_coupling",
    lambda _, index, other: RobotMove(partial(moves.with_coupling, index, other), _TURN_STEP),
    "coupling_std", unit="% of a turn",
),))
GEARS: Section = (gears, (
    # What slips between early and late is a mixture of both. What never slips stiffens a spring without any loss,
    # alike in all clusters: nothing distinguishes it from the spring.
    *(
        Kind(
            f"hysteresis_{when}", f"hysteresis of {{}} that slips {when}", "gear_nonlinearity",
            lambda _, index, slip=slip: Hysteresis(index, slip),
            "loss_factor", cluster=cluster, least=0.0, most=1.0,
        )
        for when, slip, cluster in (("early", 0.5, 1.0), ("late", 2.0, 1.0), ("never", STICKS, 0.0))
    ),
    Kind(
        "load_stiffness", "stiffness of {} by its load", "gear_nonlinearity", lambda _, index: LoadStiffness(index),
        "load_stiffness", least=-1.0, most=1.0, parameter="cubic",
    ),
))
ARM_FRICTION: Section = (joints, (Kind(
    "arm_viscous", "viscous friction of {}'s arm", "arm_friction",
    # The arm of a rigid joint moves as its motor does, whose friction says it all.
    lambda robot, index: None if robot.rigid[index] else ValueOff("arm_viscous", index),
    "arm_friction", unit=_OF_LINK, cluster=1.0, least=0.0, most=1.0, parameter="arm_viscous",
),))
MOTOR_FRICTION: Section = (joints, (Kind(
    "viscous", "viscous friction of {}'s motor", "friction", lambda _, index: ValueOff("viscous", index),
    "friction", unit=_OF_ROTOR, cluster=1.0, least=-1.0, most=1.0, parameter="viscous",
),))
OTHER_FRICTION: Section = (joints, tuple(
    Kind(
        ending, f"friction of {{}} {what}", "friction", lambda _, index, phase=phase: MotorFriction(index, phase),
        "friction", unit=_OF_ROTOR, cluster=1.0, least=-1.0, most=1.0,
    )
    for ending, what, phase in (
        ("friction_spring", "in phase with its angle", 1.0), ("friction_loss", "that loses energy", 1j),
    )
))
# What has no stiffness is no spring, so nine tenths of it are the most that can be missing.
FIXED_SPRINGS: Section = (springs, (
    Kind(
        "stiffness", "{}", FIXED, partial(_fixed, "stiffness"),
        "stiffness_relative_std", least=-0.9, most=9.0, parameter="stiffness",
    ),
    Kind(
        "damping", "{}'s damper", FIXED, partial(_fixed, "damping"),
        "damping_relative_std", least=-0.9, most=9.0, parameter="damping",
    ),
))
MISSING_SPRINGS: Section = (missing, (Kind(
    "compliance", "{}", "missing_spring", lambda robot, index: Compliance(list(missing_springs(robot))[index]),
    "compliance", unit="% of its gear's compliance", least=0.0,
),))
LATE_DRIVES: Section = (joints, tuple(
    Kind(
        f"late_{of}", f"{of} of {{}} late by", "delay", lambda _, index, of=of: LateDrive(index, of),
        size=_LATE_US, unit="us",
    )
    for of in ("torque", "angle")
))
DRIFTS: Section = (joints, (Kind(
    DRIFT, "half the growth of {}'s viscous friction over the campaign", "unsteady", lambda _, index: Drift(index),
    size=_DRIFT, unit=_OF_ROTOR,
),))
LOAD_FRICTIONS: Section = (joints, tuple(
    Kind(
        f"{LOAD_FRICTION}{ending}", f"friction of {{}} by its gear's load{what}", "friction",
        partial(_by_load, phase), size=_BY_LOAD, unit=f"{_OF_ROTOR} per mrad", linear_unit=f"{_OF_ROTOR} per mm",
    )
    for ending, what, phase in (
        ("_viscous", "", None), ("_spring", ", in phase with its angle", 1.0), ("_loss", ", that loses energy", 1j),
    )
))
BALANCES: Section = (unbalanced, tuple(
    Kind(
        f"{BALANCE}_{wave}", f"{BALANCE} of {{}} by the {wave} of its angle", BALANCE,
        lambda _, index, row=row: RobotMove(partial(moves.with_balance, index, np.eye(2)[row]), _STEP_NM),
        size=_likely_nm, unit="N m",
    )
    for row, wave in enumerate(("sine", "cosine"))
))
GEAR_EFFECTS: Section = (gears, (
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
        HYSTERESIS, "hysteresis of {}", HYSTERESIS, lambda robot, index: SlipTorque(index, _known_slip(robot, index)),
        size=_likely_slip, unit="N m", linear_unit="N", stated=_known_slip,
    ),
))
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
    LOAD_FRICTIONS,
    BALANCES,
    GEAR_EFFECTS,
)
"""What a fit can estimate, in the order of its parameters; the last five only where one does."""
