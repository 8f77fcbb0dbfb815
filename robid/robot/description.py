"""Plain description of an elastic robot: joints, motors, springs, payload."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.robot.balances import Counterbalance
from robid.robot.balances import HarmonicBalance as HarmonicBalance
from robid.robot.balances import SpringBalance as SpringBalance
from robid.robot.friction import Friction, TorqueLaw
from robid.robot.nuisance import NuisanceStd
from robid.signals.quantities import METRES, RADIANS, shown

JointType = Literal["revolute", "prismatic"]
TorquePlace = Literal["motor", "joint"]
SpringPlace = Literal["transmission", "shaft", "bearing", "split", "base", "payload"]
LOCATED: tuple[SpringPlace, ...] = ("split", "payload", "base")  # Places of springs whose location matters


@dataclass(frozen=True)
class Inertial:
    """Mass properties of a rigid body."""

    mass_kg: float  # Mass [kg]
    com_m: FloatArray  # (3,) Centre of mass in the body frame [m]
    inertia_kgm2: FloatArray  # (3, 3) Inertia about the centre of mass, along the body axes [kg m^2]


@dataclass(frozen=True)
class Motor:
    """A motor behind a gear; everything on the motor side."""

    inertia_kgm2: float  # Rotor inertia [kg m^2]
    # Motor turns per arm turn, of a prismatic joint motor radians per metre; negative where the two go opposite ways
    gear_ratio: float
    max_speed_rad_s: float  # Speed limit, infinite where it is unknown [rad/s]
    max_torque_nm: float  # Torque limit, infinite where it is unknown [N m]
    friction: Friction = field(default_factory=Friction)
    ripple_nm: float = 0.0  # Amplitude of the torque ripple [N m]
    ripple_order: int = 6  # Ripple periods per motor turn
    ripple_phase_rad: float = 0.0  # Phase `p` of the torque `ripple_nm sin(ripple_order q_m + p)` [rad]
    inertia_relative_std: float = 0.05
    torque_constant_nm_a: float | None = None  # Torque per ampere, None where it is unknown [N m/A]
    rated_torque_nm: float | None = None  # Torque that it can give for ever, None where it is unknown [N m]

    @property
    def torque_law(self) -> TorqueLaw:
        """What the robot file says of the motor's torque nonlinearities; its friction is LuGre's."""
        law = self.friction
        levels = (law.coulomb_nm, law.static_nm, law.stribeck_rad_s, law.presliding_rad)
        return TorqueLaw(*levels, law.relative_std, self.ripple_nm, self.ripple_order)


def no_motor() -> Motor:
    """Returns what stands for the motor of a joint whose torque is measured at the joint: the arm itself."""
    return Motor(inertia_kgm2=0.0, gear_ratio=1.0, max_speed_rad_s=np.inf, max_torque_nm=np.inf)


@dataclass(frozen=True)
class Joint:
    """A joint about or along the z axis of its frame, the link it moves and the motor that moves it."""

    name: str
    position_m: FloatArray  # (3,) Origin of the joint frame in the previous joint's frame [m]
    rotation: FloatArray  # (3, 3) Orientation of the joint frame in the previous joint's frame at zero position
    link: Inertial
    lower: float  # Lower joint limit [rad; m of a prismatic joint]
    upper: float  # Upper joint limit [rad; m of a prismatic joint]
    motor: Motor
    # Arm motion of this joint per radian of another joint's motor, by that joint's name [rad or m]
    couplings: Mapping[str, float] = field(default_factory=dict)
    type: JointType = "revolute"  # Whether the arm turns about the axis or slides along it
    # What takes gravity off the motor; only the rigid model and the simulated truth know it
    counterbalance: Counterbalance | None = None
    # Viscous friction between the link and what carries it: of bearings, seals, a carriage, a load motor; arm side,
    # where the motor's acts before the transmission [N m s/rad, or N s/m]
    arm_viscous: float = 0.0
    nuisance_std: NuisanceStd = field(default_factory=NuisanceStd)
    # Where its torque is known: at its motor, or behind motor and gear, by a sensor at the joint. In the latter case it
    # has no motor: what stands in its place has no inertia and turns with the arm.
    torque_at: TorquePlace = "motor"

    @property
    def has_motor(self) -> bool:
        """Whether a motor with its gear is part of it."""
        return self.torque_at == "motor"

    @property
    def reflected_viscous_nms_rad(self) -> float:
        """The arm's viscous friction as its own motor would feel it through a rigid gear [N m s/rad]."""
        return self.arm_viscous / self.motor.gear_ratio**2


@dataclass(frozen=True)
class Pin:
    """Where a link that closes a loop is held."""

    point_m: FloatArray  # (3,) The point on the link, in its frame [m]
    joint: int  # Index of the joint whose link holds it
    held_point_m: FloatArray  # (3,) The point on that link, in the joint frame [m]


@dataclass(frozen=True)
class LoopLink:
    """A link beside the chain, in a closed loop that fixes its angle: a crank or a rod of a parallelogram."""

    name: str
    parent: str | None  # Name of the joint or loop link that carries it; None for the base
    position_m: FloatArray  # (3,) Origin of its frame in the parent's frame [m]
    rotation: FloatArray  # (3, 3) Orientation of its frame in the parent's frame at zero angle
    link: Inertial  # Mass properties in its frame
    turns: Mapping[str, float]  # How far it turns about its z axis per unit of each joint's arm position, by joint
    offset_rad: float = 0.0  # Its angle where all joints are at zero [rad]
    pin: Pin | None = None  # Where it closes the loop; None for what only carries another loop link


@dataclass(frozen=True)
class StiffnessLaw:
    """How a spring's stiffness depends on a joint's position: a factor on all of its torque but the damper's."""

    joint: int  # Index of the joint
    # `table`: factors at some positions; `stiffness`: the factor is a polynomial of the position; `compliance`: its
    # inverse is one
    form: Literal["table", "stiffness", "compliance"]
    values: FloatArray  # (n_value,) The factors, or the polynomial's coefficients, constant first
    # (n_value,) Of a table, ascending; empty for a polynomial [rad, or m]
    positions: FloatArray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Spring:
    """A spring-damper pair, arm side: torsional, but for the transmission of a prismatic joint."""

    name: str
    joint: int  # Index of the joint it belongs to; the first for the base, the last for the payload
    # `transmission` between motor and arm, `shaft` between the motor and the transmission, on the motor's side,
    # `bearing` about a further axis of the joint's parent frame, `split` inside the joint's link, `base` beneath the
    # first joint, `payload` between the last link and the payload
    place: SpringPlace
    # (3,) Unit axis: bearing, in the parent's frame turned by the joint's fixed rotation; split and payload, in the
    # joint frame; base, in the world frame
    axis: FloatArray
    stiffness: float  # Stiffness [N m/rad, or N/m]
    damping: float  # Damping [N m s/rad, or N s/m]
    cubic: float = 0.0  # Cubic coefficient of a symmetrically stiffening spring [N m/rad^3, or N/m^3]
    # (3,) Where the link is split or the payload hinged, in the joint frame; where the base is hinged, in the world
    # frame [m]
    point_m: FloatArray = field(default_factory=lambda: np.zeros(3))
    outboard: Inertial | None = None  # Split only: mass properties of the part beyond the split, in the joint frame
    inertia_kgm2: float = 0.0  # Shaft only: inertia that it turns, before the next shaft or the transmission [kg m^2]
    stiffness_over: StiffnessLaw | None = None  # How its stiffness depends on a joint's position, if it does
    # What is known of them beforehand where another fit has found them; None where only the robot file states them
    stiffness_std: float | None = None  # Standard deviation of the logarithm of the stiffness
    cubic_std: float | None = None  # Standard deviation of the cubic coefficient [N m/rad^3, or N/m^3]
    slip: float = 0.0  # Torque at which its hysteresis slips; 0 where nobody has found it [N m, or N]
    slip_std: float | None = None  # Its standard deviation [N m, or N]


@dataclass(frozen=True)
class Sensor:
    """A sensor beyond the encoders."""

    name: str
    # `tracker` shows a point's position along an axis of the world, `accelerometer` the point's acceleration less
    # gravity along an axis that moves with it
    kind: Literal["tracker", "accelerometer"]
    joint: int | None  # Index of the joint whose link carries it, on its outermost part; None for the payload
    point_m: FloatArray  # (3,) Where it sits, in that joint's frame [m]
    axis: FloatArray  # (3,) Unit axis: tracker, in the world frame; accelerometer, in the joint's frame


@dataclass(frozen=True)
class FileFrames:
    """In which frames a robot file states its bodies: what is told of a centre of mass is told in them."""

    links: tuple[FloatArray, ...]  # (3, 3) of each joint: orientation of its link's frame in the joint frame
    payload: FloatArray  # (3, 3) Orientation of the payload's frame in the last joint's frame


@dataclass(frozen=True)
class Robot:
    """An elastic robot with its payload."""

    name: str
    gravity_m_s2: FloatArray  # (3,) Gravity in the base frame [m/s^2]
    joints: tuple[Joint, ...]
    # The spring-damper pairs; a joint without a transmission is rigid: its arm follows its motor
    springs: tuple[Spring, ...]
    payload: Inertial  # Mass properties of the payload in the last joint's frame
    rotor: Literal["spong", "on_link"] = "spong"  # `spong` neglects rotors' motion with the links, `on_link` does not
    assumed: tuple[str, ...] = ()  # Dotted names of the values that no source gives
    notes: tuple[str, ...] = ()
    base: Inertial | None = None  # Mass properties of what base springs carry beneath the first joint, world frame
    sensors: tuple[Sensor, ...] = ()
    loop_links: tuple[LoopLink, ...] = ()  # Links beside the chain, after what carries them; the rigid model's alone
    # How far what is stated of the payload and the base may be off
    nuisance_std: NuisanceStd = field(default_factory=NuisanceStd)
    # The frames of its file; None where they are the joints' own. No part of what the robot is
    file_frames: FileFrames | None = field(default=None, metadata={"physical": False})

    def link_axes(self, joint: int) -> FloatArray:
        """Returns the axes (3, 3) of the frame that a joint's link is stated in, as columns in the joint frame."""
        return np.eye(3) if self.file_frames is None else self.file_frames.links[joint]

    @property
    def payload_axes(self) -> FloatArray:
        """The same of the payload, in the last joint's frame."""
        return np.eye(3) if self.file_frames is None else self.file_frames.payload

    @property
    def gear_ratio(self) -> FloatArray:
        """Gear ratios (n_joint,), motor turns per arm turn, or motor radians per metre."""
        return np.array([joint.motor.gear_ratio for joint in self.joints])

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of everything that can be measured: motors, link encoders, sensors."""
        names = [joint.name for joint in self.joints]
        return (*names, *(f"{name}.arm" for name in names), *(sensor.name for sensor in self.sensors))

    @cached_property
    def arm_per_motor(self) -> FloatArray:
        """Arm motion (n_joint, n_joint) per motor angle: inverse gear ratios, and couplings off the diagonal."""
        names = [joint.name for joint in self.joints]
        # q_arm = N q_motor: inverse ratios on the diagonal, couplings beside it.
        turns = np.diag(1 / self.gear_ratio)
        for row, joint in enumerate(self.joints):
            for name, turn in joint.couplings.items():
                turns[row, names.index(name)] = turn
        turns.flags.writeable = False
        return turns

    @cached_property
    def motor_per_arm(self) -> FloatArray:
        """Motor angles (n_joint, n_joint) per arm motion."""
        turns: FloatArray = np.linalg.inv(self.arm_per_motor)
        turns.flags.writeable = False
        return turns

    @property
    def motor_inertia_kgm2(self) -> FloatArray:
        """Rotor inertias (n_joint,) [kg m^2]."""
        return np.array([joint.motor.inertia_kgm2 for joint in self.joints])

    @property
    def arm_viscous(self) -> FloatArray:
        """Viscous friction (n_joint,) of the arms, arm side [N m s/rad, or N s/m]."""
        return np.array([joint.arm_viscous for joint in self.joints])

    @property
    def shaft_inertia_kgm2(self) -> FloatArray:
        """Inertia (n_joint,) of the shafts behind each rotor: a rigid drive's is that of both [kg m^2]."""
        joints = range(len(self.joints))
        return np.array([sum(s.inertia_kgm2 for s in self.springs if s.joint == joint) for joint in joints], float)

    @property
    def lower(self) -> FloatArray:
        """Lower joint limits (n_joint,) [rad, or m]."""
        return np.array([joint.lower for joint in self.joints])

    @property
    def upper(self) -> FloatArray:
        """Upper joint limits (n_joint,) [rad, or m]."""
        return np.array([joint.upper for joint in self.joints])

    @property
    def joint_units(self) -> tuple[str, ...] | None:
        """Unit of each joint's position; None where all are angles."""
        if not self.prismatic.any():
            return None
        return tuple(METRES if slides else RADIANS for slides in self.prismatic.tolist())

    def shown(self, configuration: FloatArray) -> str:
        """Writes joint positions (n_joint,): angles in degrees, lengths in metres."""
        return shown(configuration, self.joint_units)

    @property
    def prismatic(self) -> BoolArray:
        """Which joints (n_joint,) slide."""
        return np.array([joint.type == "prismatic" for joint in self.joints])

    @property
    def has_motors(self) -> BoolArray:
        """Which joints (n_joint,) have a motor, not a sensor behind their gear."""
        return np.array([joint.has_motor for joint in self.joints])

    @cached_property
    def rigid(self) -> BoolArray:
        """Which joints (n_joint,) have no transmission spring, so that motor and arm are one coordinate."""
        elastic = {spring.joint for spring in self.springs if spring.place == "transmission"}
        found = np.array([index not in elastic for index in range(len(self.joints))])
        found.flags.writeable = False
        return found

    @property
    def spring_points_m(self) -> FloatArray:
        """Points (3 n_spring,) of the springs, one after the other [m]."""
        return np.array([spring.point_m for spring in self.springs]).reshape(-1)

    def is_linear(self, spring: Spring) -> bool:
        """Whether a spring works along a line: N, m, N s instead of N m, rad, N m s."""
        return spring.place == "transmission" and self.joints[spring.joint].type == "prismatic"
