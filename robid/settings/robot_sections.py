"""Models of the sections of a robot file."""

from __future__ import annotations

import math
from typing import Literal, TypeVar

import numpy as np
from pydantic import Field

from robid.arrays import FloatArray, group, option
from robid.robot.description import Inertial, JointType, Motor, Sensor, Spring, TorquePlace, no_motor
from robid.robot.friction import Friction
from robid.robot.parameters import PARAMETER_KINDS
from robid.settings.base import Assumed, Name, Section, Vector
from robid.settings.joint_sections import CounterbalanceSection, Dh, Frame, GearSection, JointNuisanceStd, SpringDamper

_Value = TypeVar("_Value")


class InertiaTensor(Section):
    """Inertia about the centre of mass; xy, yz, xz are the entries of the matrix as they stand in it."""

    xx: float = Field(description="Entry (x, x) of the matrix [kg m^2].")
    yy: float = Field(description="Entry (y, y) of the matrix [kg m^2].")
    zz: float = Field(description="Entry (z, z) of the matrix [kg m^2].")
    xy: float = option(0.0, "Entry (x, y) of the matrix, minus the integral of x y dm [kg m^2].")
    yz: float = option(0.0, "Entry (y, z) of the matrix, minus the integral of y z dm [kg m^2].")
    xz: float = option(0.0, "Entry (x, z) of the matrix, minus the integral of x z dm [kg m^2].")

    def matrix(self) -> FloatArray:
        """Returns the tensor (3, 3) [kg m^2]."""
        return np.array([[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]])


class Body(Assumed):
    """Mass properties of a rigid body, in its link's frame."""

    mass_kg: float = Field(description="Mass [kg]; 0 where a source gives its inertia alone, or for no payload.", ge=0)
    com_m: Vector = Field(description="Centre of mass [m].")
    inertia_kgm2: InertiaTensor = Field(description="Inertia about the centre of mass, along the frame's axes.")

    def inertial(self) -> Inertial:
        """Returns the mass properties in the frame they are given in."""
        return Inertial(self.mass_kg, np.array(self.com_m), self.inertia_kgm2.matrix())


class FrictionSection(Assumed):
    """LuGre friction of a motor, motor side."""

    viscous_nms_rad: float = option(0.0, "Viscous coefficient [N m s/rad].", ge=0)
    coulomb_nm: float = option(0.0, "Coulomb torque [N m].", ge=0)
    static_nm: float | None = option(
        None, "Breakaway torque, not below the Coulomb torque; the latter when not given [N m].", ge=0
    )
    stribeck_rad_s: float = option(1.0, "Stribeck speed [rad/s].", gt=0)
    presliding_rad: float = option(0.02, "Bristle deflection at the Coulomb torque [rad].", gt=0)
    relative_std: float = option(0.1, "Standard deviation of the relative error of the coefficients.", ge=0)

    def friction(self) -> Friction:
        """Returns the plain description."""
        static = self.coulomb_nm if self.static_nm is None else self.static_nm
        return Friction(**{**self.model_dump(exclude={"assumed"}), "static_nm": static})


class MotorSection(Assumed):
    """A motor and its gear, motor side."""

    inertia_kgm2: float = Field(description="Rotor inertia [kg m^2].", gt=0)
    inertia_relative_std: float = option(0.05, "Standard deviation of the relative error of the rotor inertia.", gt=0)
    gear_ratio: float | None = option(None, "Motor turns per arm turn, negative where the two turn opposite ways.")
    gear_ratio_rad_m: float | None = option(
        None,
        "Of a prismatic joint, in place of `gear_ratio`: motor radians per metre [rad/m]. It is 2 pi over the "
        "lead of a screw, or gear ratio over the radius of a pinion; negative where the motor turns the other "
        "way.",
    )
    max_speed_rad_s: float | None = option(
        None, "Speed limit; that of `model` when not given, not needed where there are only logs [rad/s].", gt=0
    )
    max_torque_nm: float | None = option(
        None, "Torque limit; that of `model` when not given, not needed where there are only logs [N m].", gt=0
    )
    torque_constant_nm_a: float | None = option(
        None,
        "Torque per ampere, where it is known. It shows which logs have currents that are read as torques [N m/A].",
        gt=0,
    )
    rated_torque_nm: float | None = option(
        None,
        "Rated (continuous) torque. Errors of the motor's torque are relative to at least a tenth of it [N m].",
        gt=0,
    )
    friction: FrictionSection = group(FrictionSection, "Nominal friction.")
    ripple_nm: float = option(0.0, "Amplitude of the torque ripple [N m].", ge=0)
    ripple_order: int = option(6, "Ripple periods per motor turn.", ge=1, le=10_000)

    @property
    def ratio(self) -> float | None:
        """Motor radians per radian or metre of the arm; None where the file does not say."""
        return self.gear_ratio if self.gear_ratio is not None else self.gear_ratio_rad_m

    def with_ratio(self, factor: float) -> MotorSection:
        """Returns the motor with a gear ratio that is larger by a factor."""
        key = "gear_ratio" if self.gear_ratio is not None else "gear_ratio_rad_m"
        return self.model_copy(update={key: given(self.ratio) * factor})

    def motor(self) -> Motor:
        """Returns the plain description."""
        return Motor(
            inertia_kgm2=self.inertia_kgm2,
            gear_ratio=given(self.ratio),
            max_speed_rad_s=math.inf if self.max_speed_rad_s is None else self.max_speed_rad_s,
            max_torque_nm=math.inf if self.max_torque_nm is None else self.max_torque_nm,
            friction=self.friction.friction(),
            ripple_nm=self.ripple_nm,
            ripple_order=self.ripple_order,
            inertia_relative_std=self.inertia_relative_std,
            torque_constant_nm_a=self.torque_constant_nm_a,
            rated_torque_nm=self.rated_torque_nm,
        )


class JointSection(Assumed):
    """A joint, its motor, and the link that it moves."""

    name: Name = Field(description="Name of the joint.")
    type: JointType = option("revolute", "Whether the link turns about the joint's axis z, or slides along it.")
    rigid: bool = option(False, "No transmission spring: the arm follows the motor, whose inertia moves with it.")
    dh: Dh | None = option(None, "From this joint's frame to the next one.")
    frame: Frame | None = option(None, "In place of `dh`: this joint's frame in the previous one.")
    limits_deg: tuple[float, float] | None = option(
        None, "Lower and upper joint limit; those of `model` when not given [deg]."
    )
    limits_m: tuple[float, float] | None = option(None, "Of a prismatic joint, in place of `limits_deg` [m].")
    couplings: dict[Name, float] = group(
        dict,
        "Arm turns of this joint per turn of another joint's motor, by that joint's name; of a"
        " prismatic joint metres per motor radian.",
    )
    link: Body | None = option(None, "The link, in its frame; not stated where `model` contains it.")
    torque_measured_at: TorquePlace = option(
        "motor",
        "`joint` where a sensor behind the gear measures the torque. The joint then has no `motor`, because "
        "such a sensor does not measure the rotor; only rigid models support it.",
    )
    motor: MotorSection | None = option(None, "The motor and its gear; required unless `torque_measured_at: joint`.")
    gear: GearSection | None = option(None, "The transmission; or an entry among `springs`.")
    counterbalance: CounterbalanceSection | None = option(
        None, "Device that carries gravity in place of the motor; rigid models and simulations contain it."
    )
    arm_viscous_nms_rad: float = option(
        0.0,
        "Viscous friction of the link against the part that carries it, behind the transmission: of bearings, "
        "seals, a load motor; arm side [N m s/rad].",
        ge=0,
    )
    arm_viscous_ns_m: float = option(0.0, "Of a prismatic joint, in place of `arm_viscous_nms_rad` [N s/m].", ge=0)
    doubts: JointNuisanceStd = group(JointNuisanceStd, "Of this joint, in place of the robot's `doubts`.")

    @property
    def arm_viscous_key(self) -> str:
        """Name of the field that states the viscous friction of its arm."""
        return PARAMETER_KINDS["arm_viscous"].fields[self.slides]

    @property
    def arm_viscous(self) -> float:
        """Viscous friction of the arm [N m s/rad, or N s/m]."""
        return float(getattr(self, self.arm_viscous_key))

    @property
    def slides(self) -> bool:
        """Whether it is prismatic."""
        return self.type == "prismatic"

    @property
    def has_motor(self) -> bool:
        """Whether its torque is that of a motor, not one that is measured at the joint."""
        return self.torque_measured_at == "motor"

    @property
    def plain_motor(self) -> Motor:
        """Plain description of the motor, or of what stands in its place."""
        return given(self.motor).motor() if self.has_motor else no_motor()

    @property
    def limits_key(self) -> str:
        """Name of the field that states its limits."""
        return "limits_m" if self.slides else "limits_deg"

    @property
    def limits_unit(self) -> str:
        """Unit in which the file states its positions."""
        return "m" if self.slides else "deg"

    @property
    def stated_limits(self) -> tuple[float, float] | None:
        """Lower and upper limit as the file states them [deg, or m]."""
        return self.limits_m if self.slides else self.limits_deg

    @property
    def geometry(self) -> Dh | Frame:
        """Where the joint and its link are."""
        return self.dh if self.dh is not None else given(self.frame)

    def into_joint_frame(self, body: Inertial) -> Inertial:
        """Moves mass properties from the link's frame into the joint frame."""
        return moved(body, *self.geometry.link_frame())


class SpringSection(SpringDamper):
    """A spring-damper pair, arm side: torsional, but for the transmission of a prismatic joint; shafts motor side."""

    name: Name = Field(description="Name of the spring.")
    joint: Name | None = option(None, "Name of the joint it belongs to; springs of the base and the payload have none.")
    place: Literal["transmission", "shaft", "bearing", "split", "base", "payload"] = Field(
        description="`transmission`: between motor and arm. `shaft`: between the motor and its transmission. "
        "`bearing`: about a further axis of the joint. `split`: inside the joint's link. `base`: "
        "beneath the first joint. `payload`: between the last link and the payload."
    )
    axis: Vector | None = option(
        None,
        "Axis. Bearing: in the joint frame at zero joint angle (z is the joint axis). It does not turn with "
        "the joint; of a prismatic joint it moves with the link. Split: in the link's frame. Payload: in the "
        "payload's. Base: in the world frame. A transmission and a shaft have none.",
    )
    point_m: Vector | None = option(
        None,
        "Point where the link is split, or the hinge of payload or base (their frame's origin when not given), "
        "in the same frame as the axis [m].",
    )
    outboard: Body | None = option(None, "Split only: the part of the link beyond the split, in the link's frame.")
    inertia_kgm2: float | None = option(
        None,
        "Shaft only: inertia that it turns, on the motor side like its stiffness and damping. Shafts of a "
        "joint follow each other as listed, starting at the motor [kg m^2].",
        gt=0,
    )

    def is_linear(self, joints: tuple[JointSection, ...]) -> bool:
        """Whether it works along a line."""
        return self.place == "transmission" and any(joint.name == self.joint and joint.slides for joint in joints)

    def spring(self, joints: tuple[JointSection, ...]) -> Spring:
        """Returns the plain description, in the joint frame."""
        ends = {"base": 0, "payload": len(joints) - 1}
        index = ends[self.place] if self.place in ends else [joint.name for joint in joints].index(given(self.joint))
        position, rotation = joints[index].geometry.link_frame()
        if self.place == "base":
            position, rotation = np.zeros(3), np.eye(3)
        linear = self.is_linear(joints)
        axis, point = np.array(self.axis or (0.0, 0.0, 1.0)), np.array(self.point_m or (0.0, 0.0, 0.0))
        if self.place in ("split", "payload"):
            axis = rotation @ axis
        return Spring(
            name=self.name,
            joint=index,
            place=self.place,
            axis=axis / np.linalg.norm(axis),
            stiffness=given(self.value("stiffness", linear=linear)),
            damping=given(self.value("damping", linear=linear)),
            cubic=self.value("cubic", linear=linear) or 0.0,
            point_m=position + rotation @ point if self.place in ("split", "base", "payload") else np.zeros(3),
            outboard=None if self.outboard is None else joints[index].into_joint_frame(self.outboard.inertial()),
            inertia_kgm2=self.inertia_kgm2 or 0.0,
            stiffness_over=None if self.stiffness_over is None else self.stiffness_over.law(joints),
        )


class SensorSection(Assumed):
    """A sensor beyond the encoders."""

    name: Name = Field(description="Name of the sensor, and of the output that it gives.")
    kind: Literal["tracker", "accelerometer"] = Field(
        description="A point's position, or its acceleration less gravity, along an axis."
    )
    joint: Name | None = option(None, "Joint whose link carries it, on its outermost part; the payload when not given.")
    point_m: Vector = option((0.0, 0.0, 0.0), "Its position, in the link's frame, or the payload's [m].")
    axis: Vector = Field(description="Axis. Tracker: in the world frame. Accelerometer: in the frame of the point.")

    def sensor(self, joints: tuple[JointSection, ...]) -> Sensor:
        """Returns the plain description, in the joint frame."""
        names = [joint.name for joint in joints]
        index = None if self.joint is None else names.index(self.joint)
        position, rotation = joints[-1 if index is None else index].geometry.link_frame()
        axis = np.array(self.axis) / np.linalg.norm(self.axis)
        return Sensor(
            name=self.name,
            kind=self.kind,
            joint=index,
            point_m=position + rotation @ np.array(self.point_m),
            axis=axis if self.kind == "tracker" else rotation @ axis,
        )


def moved(body: Inertial, position: FloatArray, rotation: FloatArray) -> Inertial:
    """Returns mass properties in another frame, in which theirs has this origin (3,) [m] and orientation (3, 3)."""
    return Inertial(body.mass_kg, position + rotation @ body.com_m, rotation @ body.inertia_kgm2 @ rotation.T)


def given(value: _Value | None) -> _Value:
    """Returns a value that checked settings have."""
    if value is None:
        message = "checked settings lack no value"
        raise RuntimeError(message)
    return value
