"""Models of the robot file and its way into a plain description."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from pydantic import Field
from scipy.spatial.transform import Rotation

from robid.arrays import FloatArray
from robid.errors import SettingsError
from robid.robot.description import Friction, Inertial, Joint, Motor, Robot, Spring
from robid.settings.base import Name, Section, Vector
from robid.settings.yaml import FieldPath
from robid.simulate.options import Controller


class Assumed(Section):
    """A section some of whose values no source gives."""

    assumed: tuple[str, ...] = Field(
        default=(), description="Dotted names, within this section, of the values that no source gives."
    )


class InertiaTensor(Section):
    """Inertia about the centre of mass; xy, yz, xz are the entries of the matrix as they stand in it."""

    xx: float = Field(description="Entry (x, x) of the matrix [kg m^2].")
    yy: float = Field(description="Entry (y, y) of the matrix [kg m^2].")
    zz: float = Field(description="Entry (z, z) of the matrix [kg m^2].")
    xy: float = Field(default=0.0, description="Entry (x, y) of the matrix, minus the integral of x y dm [kg m^2].")
    yz: float = Field(default=0.0, description="Entry (y, z) of the matrix, minus the integral of y z dm [kg m^2].")
    xz: float = Field(default=0.0, description="Entry (x, z) of the matrix, minus the integral of x z dm [kg m^2].")

    def matrix(self) -> FloatArray:
        """Returns the tensor (3, 3) [kg m^2]."""
        return np.array([[self.xx, self.xy, self.xz], [self.xy, self.yy, self.yz], [self.xz, self.yz, self.zz]])


class Body(Assumed):
    """Mass properties of a rigid body, in the DH frame at the end of its link."""

    mass_kg: float = Field(description="Mass [kg].", ge=0)
    com_m: Vector = Field(description="Centre of mass [m].")
    inertia_kgm2: InertiaTensor = Field(description="Inertia about the centre of mass, along the frame's axes.")

    def inertial(self) -> Inertial:
        """Returns the mass properties in the frame they are given in."""
        return Inertial(self.mass_kg, np.array(self.com_m), self.inertia_kgm2.matrix())


class FrictionSection(Assumed):
    """LuGre friction of a motor, motor side."""

    viscous_nms_rad: float = Field(default=0.0, description="Viscous coefficient [N m s/rad].", ge=0)
    coulomb_nm: float = Field(default=0.0, description="Coulomb level [N m].", ge=0)
    static_nm: float = Field(default=0.0, description="Breakaway level [N m].", ge=0)
    stribeck_rad_s: float = Field(default=1.0, description="Stribeck speed [rad/s].", gt=0)
    presliding_rad: float = Field(default=0.02, description="Bristle deflection at the Coulomb level [rad].", gt=0)
    relative_std: float = Field(
        default=0.1, description="Standard deviation of the relative error of the coefficients.", ge=0
    )

    def friction(self) -> Friction:
        """Returns the plain description."""
        return Friction(**self.model_dump(exclude={"assumed"}))


class MotorSection(Assumed):
    """A motor and its gear, motor side."""

    inertia_kgm2: float = Field(description="Rotor inertia [kg m^2].", gt=0)
    gear_ratio: float = Field(description="Motor turns per arm turn.", gt=1e-9)
    max_speed_rad_s: float = Field(description="Speed limit [rad/s].", gt=0)
    max_torque_nm: float = Field(description="Torque limit [N m].", gt=0)
    friction: FrictionSection = Field(default_factory=FrictionSection, description="Nominal friction.")
    ripple_nm: float = Field(default=0.0, description="Amplitude of the torque ripple [N m].", ge=0)
    ripple_order: int = Field(default=6, description="Ripple periods per motor turn.", ge=1)

    def motor(self) -> Motor:
        """Returns the plain description."""
        values = self.model_dump(exclude={"assumed", "friction"})
        return Motor(friction=self.friction.friction(), **values)


class Dh(Assumed):
    """Standard Denavit-Hartenberg parameters: Rz(q + offset) Tz(d) Tx(a) Rx(alpha)."""

    d_m: float = Field(default=0.0, description="Translation along the joint axis [m].")
    a_m: float = Field(default=0.0, description="Translation along the turned x axis [m].")
    alpha_deg: float = Field(default=0.0, description="Turn about the turned x axis [deg].")
    offset_deg: float = Field(default=0.0, description="Joint angle of the DH frame at zero robot angle [deg].")

    def after_joint(self) -> tuple[FloatArray, FloatArray]:
        """Returns position (3,) [m] and orientation (3, 3) of the DH frame at the link's end in the joint frame."""
        return np.array([self.a_m, 0.0, self.d_m]), Rotation.from_euler("x", self.alpha_deg, degrees=True).as_matrix()

    def offset(self) -> FloatArray:
        """Returns the turn (3, 3) about the joint axis at zero robot angle."""
        return np.asarray(Rotation.from_euler("z", self.offset_deg, degrees=True).as_matrix())

    def into_joint_frame(self, body: Inertial) -> Inertial:
        """Moves mass properties from the DH frame at the link's end into the joint frame."""
        position, rotation = self.after_joint()
        inertia = rotation @ body.inertia_kgm2 @ rotation.T
        return Inertial(body.mass_kg, position + rotation @ body.com_m, inertia)


class JointSection(Assumed):
    """A revolute joint, its motor, and the link that it moves."""

    name: Name = Field(description="Name of the joint.")
    dh: Dh = Field(description="From this joint's frame to the next one.")
    limits_deg: tuple[float, float] = Field(description="Lower and upper joint limit [deg].")
    link: Body = Field(description="The link, in the DH frame at its end.")
    motor: MotorSection = Field(description="The motor and its gear.")


class SpringSection(Assumed):
    """A torsional spring-damper pair, arm side."""

    name: Name = Field(description="Name of the spring.")
    joint: Name = Field(description="Name of the joint it belongs to.")
    place: Literal["transmission", "bearing", "split"] = Field(
        description="Between motor and arm, about a further axis of the joint, or inside the joint's link."
    )
    axis: Vector | None = Field(
        default=None,
        description="Axis. Bearing: in the joint frame at zero joint angle (z is the joint axis), it does not turn "
        "with the joint. Split: in the DH frame at the link's end. A transmission has none.",
    )
    stiffness_nm_rad: float = Field(description="Stiffness [N m/rad].", gt=0)
    damping_nms_rad: float = Field(description="Damping [N m s/rad].", ge=0)
    cubic_nm_rad3: float = Field(
        default=0.0, description="Coefficient of the cubic, stiffening part [N m/rad^3].", ge=0
    )
    point_m: Vector | None = Field(
        default=None, description="Split only: where the link is split, in the DH frame at the link's end [m]."
    )
    outboard: Body | None = Field(
        default=None, description="Split only: the part of the link beyond the split, in the DH frame at its end."
    )

    def spring(self, names: list[str], dh: Dh) -> Spring:
        """Returns the plain description, in the joint frame.

        Args:
            names: Names of all joints.
            dh: Denavit-Hartenberg parameters of the spring's joint.
        """
        position, rotation = dh.after_joint()
        axis = np.array(self.axis or (0.0, 0.0, 1.0))
        if self.place == "split":
            axis = rotation @ axis
        return Spring(
            name=self.name,
            joint=names.index(self.joint),
            place=self.place,
            axis=axis / np.linalg.norm(axis),
            stiffness_nm_rad=self.stiffness_nm_rad,
            damping_nms_rad=self.damping_nms_rad,
            cubic_nm_rad3=self.cubic_nm_rad3,
            point_m=np.zeros(3) if self.point_m is None else position + rotation @ np.array(self.point_m),
            outboard=None if self.outboard is None else dh.into_joint_frame(self.outboard.inertial()),
        )


class RobotFile(Assumed):
    """A robot file."""

    schema_version: Literal[1] = Field(description="Version of this format.")
    name: str = Field(description="Name of the robot.", min_length=1)
    notes: tuple[str, ...] = Field(default=(), description="Sources and gaps that the reader must know.")
    gravity_m_s2: Vector = Field(default=(0.0, 0.0, -9.81), description="Gravity in the world frame [m/s^2].")
    base_rpy_deg: Vector = Field(
        default=(0.0, 0.0, 0.0), description="Turns of the base about the world's x, then y, then z axis [deg]."
    )
    rotor: Literal["spong", "on_link"] = Field(
        default="spong", description="Whether the rotors' motion with the links is neglected or not."
    )
    controller: Controller | None = Field(default=None, description="The controller of a simulated robot.")
    joints: tuple[JointSection, ...] = Field(description="The joints, base to flange.", min_length=1)
    springs: tuple[SpringSection, ...] = Field(description="The spring-damper pairs.", min_length=1)
    payload: Body | None = Field(default=None, description="The payload, in the DH frame at the last link's end.")

    def to_robot(self, payload_kg: float | None = None) -> Robot:
        """Returns the plain description.

        Args:
            payload_kg: Payload mass that replaces the file's; its inertia is scaled with it, its centre of
                mass stays [kg].

        Raises:
            SettingsError: If a payload is asked for and the file has none to scale.
        """
        names = [joint.name for joint in self.joints]
        springs = tuple(spring.spring(names, self.joints[names.index(spring.joint)].dh) for spring in self.springs)
        return Robot(
            name=self.name,
            gravity_m_s2=np.array(self.gravity_m_s2),
            joints=self._joints(),
            springs=springs,
            payload=self._payload(payload_kg),
            rotor=self.rotor,
            assumed=assumed_names(self),
            notes=self.notes,
        )

    def _joints(self) -> tuple[Joint, ...]:
        joints = []
        position: FloatArray = np.zeros(3)
        rotation = Rotation.from_euler("xyz", self.base_rpy_deg, degrees=True).as_matrix()
        for section in self.joints:
            lower, upper = np.deg2rad(section.limits_deg)
            joint = Joint(
                name=section.name,
                position_m=position,
                rotation=rotation @ section.dh.offset(),
                link=section.dh.into_joint_frame(section.link.inertial()),
                lower_rad=float(lower),
                upper_rad=float(upper),
                motor=section.motor.motor(),
            )
            joints.append(joint)
            position, rotation = section.dh.after_joint()
        return tuple(joints)

    def _payload(self, payload_kg: float | None) -> Inertial:
        if self.payload is None or self.payload.mass_kg == 0:
            if payload_kg:
                raise SettingsError(
                    f"a payload of {payload_kg} kg is asked for, but the robot file has none to scale",
                    where=self.name,
                    remedy="give the robot file a `payload` with mass, centre of mass and inertia",
                )
            return Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
        body = self.payload.inertial()
        scale = 1.0 if payload_kg is None else payload_kg / body.mass_kg
        scaled = Inertial(scale * body.mass_kg, body.com_m, scale * body.inertia_kgm2)
        return self.joints[-1].dh.into_joint_frame(scaled)


def assumed_names(robot: RobotFile) -> tuple[str, ...]:
    """Collects all `assumed` lists as dotted names that start with a joint's or spring's name."""
    names = (f"{prefix}{name}" for prefix, _, section in assumed_sections(robot) for name in section.assumed)
    return tuple(dict.fromkeys(names))


def assumed_sections(
    section: Assumed, prefix: str = "", field: FieldPath = ()
) -> Iterator[tuple[str, FieldPath, Assumed]]:
    """Yields each section that may list assumed values, with its dotted prefix and its place in the file."""
    yield prefix, field, section
    for key in type(section).model_fields:
        value = getattr(section, key)
        if isinstance(value, Assumed):
            yield from assumed_sections(value, f"{prefix}{key}.", (*field, key))
        elif isinstance(value, tuple):
            for index, item in enumerate(value):
                if isinstance(item, JointSection | SpringSection):
                    yield from assumed_sections(item, f"{item.name}.", (*field, key, index))
