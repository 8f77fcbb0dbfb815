"""The model of the robot file and its way into a plain description."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, PrivateAttr

from robid.arrays import FloatArray, group, option
from robid.errors import DataError, SettingsError
from robid.robot.description import FileFrames, Inertial, Joint, LoopLink, Pin, Robot
from robid.robot.inertia import roll_pitch_yaw
from robid.robot.nuisance import NuisanceStd
from robid.settings.base import DATA_VARIABLE, Assumed, Name, Section, Vector, data_path
from robid.settings.joint_sections import Frame, GearSection
from robid.settings.robot_sections import Body, JointSection, SensorSection, SpringSection, given
from robid.settings.yaml import FieldPath
from robid.signals.quantities import METRES, RADIANS
from robid.simulate.options import Controller, PoseInterface


class PinSection(Section):
    """Where a link that closes a loop is held."""

    point_m: Vector = Field(description="The point on this link, in its frame [m].")
    joint: Name = Field(description="Joint whose link carries it.")
    held_point_m: Vector = Field(description="The same point on that link, in its frame [m].")


class LoopLinkSection(Assumed):
    """A link beside the chain, in a closed loop that fixes its angle: a crank or a rod of a parallelogram."""

    name: Name = Field(description="Name of the link.")
    parent: Name | None = option(None, "Joint or loop link, listed before, that carries it; the base when not given.")
    frame: Frame = group(Frame, "Its frame at zero angle, its axis along z, in the frame of that link.")
    turns: dict[Name, float] = Field(
        description="Its turns against the part that carries it, per turn of each joint, by the joint's name. "
        "In a parallelogram the sum of the angles is constant, so these are mostly 1 and -1."
    )
    offset_deg: float = option(0.0, "Its angle where all joints are at zero [deg].")
    link: Body = Field(description="Its mass properties, in its frame.")
    pin: PinSection | None = option(None, "Point that closes the loop; robid refuses a file whose loop does not close.")

    def loop_link(self, joints: Sequence[JointSection], base: FloatArray) -> LoopLink:
        """Returns the plain description, in joint frames; `base` (3, 3) is the orientation of the base in the world."""
        frames = {joint.name: joint.geometry.link_frame() for joint in joints}
        still = (np.zeros(3), base if self.parent is None else np.eye(3))
        position, rotation = frames.get(self.parent or "", still)
        offset, turn = self.frame.joint_frame()
        pin = None
        if self.pin is not None:
            index = [joint.name for joint in joints].index(self.pin.joint)
            origin, turned = frames[self.pin.joint]
            pin = Pin(np.array(self.pin.point_m), index, origin + turned @ np.array(self.pin.held_point_m))
        return LoopLink(
            name=self.name,
            parent=self.parent,
            position_m=position + rotation @ offset,
            rotation=rotation @ turn,
            link=self.link.inertial(),
            turns=dict(self.turns),
            offset_rad=float(np.deg2rad(self.offset_deg)),
            pin=pin,
        )


MODEL_NOT_THERE = "D215 the robot's model is not there"
SET_DATA_FOLDER = f"set ROBID_DATA to the folder that `{DATA_VARIABLE}` stands for"


class RobotFile(Assumed):
    """A robot file."""

    schema_version: Literal[1, 2] = Field(description="Version of this format; 1 and 2 are the same for a robot.")
    name: str = Field(description="Name of the robot.", min_length=1)
    notes: tuple[str, ...] = option((), "Sources and gaps that the reader must know.")
    gravity_m_s2: Vector = option((0.0, 0.0, -9.81), "Gravity in the world frame [m/s^2].")
    base_rpy_deg: Vector = option((0.0, 0.0, 0.0), "Turns of the base about the world's x, then y, then z axis [deg].")
    floor_m: float | None = option(
        None,
        "Height of the floor in the world frame. Configurations that take a joint, a link's or the payload's "
        "centre of mass below it are out of reach [m].",
    )
    rotor: Literal["spong", "on_link"] = option(
        "spong", "Whether the rotors' motion with the links is neglected or not."
    )
    controller: Controller | None = option(None, "The controller of a simulated robot.")
    pose_interface: PoseInterface | None = option(
        None, "How the controller receives commands of the tool's pose, and reports it."
    )
    model: str | None = option(
        None,
        "A rigid MJCF or URDF with frames, links and limits. `${ROBID_DATA}` is the data folder; other paths "
        "start at this file.",
    )
    locked_deg: dict[str, float] = group(dict, "Joints of `model` that do not move, with their angles [deg].")
    locked_m: dict[str, float] = group(dict, "Prismatic joints of `model` that do not move, with their positions [m].")
    locked: Literal["rest"] | None = option(
        None,
        "`rest`: all joints of `model` that are named neither in `joints` nor above do not move. They stay at "
        "the model's rest position, at 0, or in the middle of their limits where these exclude 0.",
    )
    flange: str | None = option(
        None, "Body or site of `model` in whose frame the payload is given; else the last link."
    )
    total_mass_kg: float | None = option(None, "Mass of all links that move, payload excluded, as a check [kg].", gt=0)
    joints: tuple[JointSection, ...] = Field(description="The joints, base to flange.", min_length=1, max_length=100)
    springs: tuple[SpringSection, ...] = option((), "The spring-damper pairs.", max_length=1_000)
    payload: Body | None = option(None, "The payload, in the last link's frame.")
    base: Body | None = option(None, "What base springs carry beneath the first joint, in the world frame.")
    sensors: tuple[SensorSection, ...] = option((), "Sensors beyond motors and link encoders.", max_length=1_000)
    loop_links: tuple[LoopLinkSection, ...] = option(
        (), "Links beside the chain, in closed loops; only rigid models contain them."
    )

    doubts: NuisanceStd = group(NuisanceStd, "Standard deviations of errors of the file; 0 means no error.")

    # Axes of the frames that a `model` states links in, and the payload's after them, in those of the joints
    _model_axes: list[list[list[float]]] | None = PrivateAttr(None)

    @property
    def output_names(self) -> tuple[str, ...]:
        """Names of everything that can be measured: motors, link encoders, sensors."""
        names = [joint.name for joint in self.joints]
        return (*names, *(f"{name}.arm" for name in names), *(sensor.name for sensor in self.sensors))

    @property
    def all_springs(self) -> tuple[SpringSection, ...]:
        """The gears of the joints, then the springs of their own."""
        gears = (
            SpringSection(name=f"gear_{joint.name}", joint=joint.name, place="transmission", **joint.gear.model_dump())
            for joint in self.joints
            if joint.gear is not None
        )
        return (*gears, *self.springs)

    @property
    def held(self) -> dict[str, float]:
        """Positions of the joints of `model` that do not move [rad, or m]."""
        return {name: float(np.deg2rad(angle)) for name, angle in self.locked_deg.items()} | self.locked_m

    @property
    def joint_units(self) -> tuple[str, ...] | None:
        """Unit of each joint's position; None where all are angles."""
        return tuple(METRES if joint.slides else RADIANS for joint in self.joints) if any(self.slides) else None

    @property
    def without_motor(self) -> tuple[str, ...]:
        """Names of the joints whose torque is measured at the joint."""
        return tuple(joint.name for joint in self.joints if not joint.has_motor)

    @property
    def slides(self) -> list[bool]:
        """Which joints are prismatic."""
        return [joint.slides for joint in self.joints]

    @property
    def is_complete(self) -> bool:
        """Whether every joint knows its frame, link and limits: not before a `model` is read."""
        return all(
            (joint.dh or joint.frame) and joint.link and joint.stated_limits
            for joint in self.joints
        )  # fmt: skip

    @property
    def lacks_model(self) -> bool:
        """Whether its `model` could not be read, as the data folder that it lies in is not there."""
        return self.model is not None and not self.is_complete

    @property
    def model_notes(self) -> tuple[str, ...]:
        """The notes that the model brought: what of it could not stay."""
        name = "" if self.model is None else Path(self.model).name
        return tuple(note for note in self.notes if name and note.startswith(f"{name}: "))

    def model_path(self, folder: Path) -> Path | None:
        """Returns the path of `model`; `folder` is that of the robot file."""
        return None if self.model is None else data_path(self.model, folder)

    def to_robot(self, payload_kg: float | None = None) -> Robot:
        """Returns the plain description; another payload mass [kg] scales the file's inertia, its centre of mass stays.

        Raises:
            SettingsError: If a payload is asked for and the file has none to scale.
            DataError: If its `model` was not there to be read.
        """
        if self.lacks_model:
            raise DataError(MODEL_NOT_THERE, where=str(self.model), remedy=SET_DATA_FOLDER)
        return Robot(
            name=self.name,
            gravity_m_s2=np.array(self.gravity_m_s2),
            joints=self._joints(),
            springs=tuple(spring.spring(self.joints) for spring in self.all_springs),
            payload=self._payload(payload_kg),
            base=None if self.base is None else self.base.inertial(),
            sensors=tuple(sensor.sensor(self.joints) for sensor in self.sensors),
            rotor=self.rotor,
            assumed=assumed_names(self),
            notes=self.notes,
            nuisance_std=self.doubts,
            file_frames=self._file_frames(),
            loop_links=tuple(
                link.loop_link(self.joints, roll_pitch_yaw(self.base_rpy_deg)) for link in self.loop_links
            ),
        )

    def joint_frames(self) -> list[tuple[FloatArray, FloatArray]]:
        """Returns position (3,) [m] and orientation (3, 3) of each joint frame in the previous one."""
        frames: list[tuple[FloatArray, FloatArray]] = []
        position: FloatArray = np.zeros(3)
        rotation: FloatArray = roll_pitch_yaw(self.base_rpy_deg)
        for section in self.joints:
            offset, turn = section.geometry.joint_frame()
            frames.append((position + rotation @ offset, rotation @ turn))
            position, rotation = section.geometry.link_frame()
        return frames

    def links(self) -> list[Inertial]:
        """Returns each link's mass properties in its joint frame."""
        return [section.into_joint_frame(given(section.link).inertial()) for section in self.joints]

    def _joints(self) -> tuple[Joint, ...]:
        joints = []
        for section, (position, rotation), link in zip(self.joints, self.joint_frames(), self.links(), strict=True):
            limits = np.array(given(section.stated_limits))
            lower, upper = limits if section.slides else np.deg2rad(limits)
            balance = section.counterbalance
            joint = Joint(
                name=section.name,
                position_m=position,
                rotation=rotation,
                link=link,
                lower=float(lower),
                upper=float(upper),
                type=section.type,
                motor=section.plain_motor,
                couplings=dict(section.couplings),
                counterbalance=None if balance is None else balance.counterbalance(*section.geometry.link_frame()),
                arm_viscous=section.arm_viscous,
                nuisance_std=section.doubts.over(self.doubts),
                torque_at=section.torque_measured_at,
            )
            joints.append(joint)
        return tuple(joints)

    def state_axes(self, axes: Sequence[FloatArray]) -> None:
        """Notes the axes (3, 3) of the frames that a `model` states links in, and last the payload's."""
        self._model_axes = [one.tolist() for one in axes]

    def _file_frames(self) -> FileFrames:
        links = tuple(section.geometry.link_frame()[1] for section in self.joints)
        if self._model_axes is None:
            return FileFrames(links, links[-1] if links else np.eye(3))
        *links_of_model, payload = (np.array(axes) for axes in self._model_axes)
        return FileFrames(tuple(links_of_model), payload)

    def _payload(self, payload_kg: float | None) -> Inertial:
        if self.payload is None or self.payload.mass_kg == 0:
            if payload_kg:
                what = f"S330 a payload of {payload_kg} kg is asked for, but the robot file has none to scale"
                remedy = "give the robot file a `payload` with mass, centre of mass and inertia"
                raise SettingsError(what, where=self.name, remedy=remedy)
            return Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
        body = self.payload.inertial()
        scale = 1.0 if payload_kg is None else payload_kg / body.mass_kg
        scaled = Inertial(scale * body.mass_kg, body.com_m, scale * body.inertia_kgm2)
        return self.joints[-1].into_joint_frame(scaled)


class UnknownRobot(RobotFile):
    """A robot of which nothing is known but its logs: it has no joints."""

    schema_version: Literal[1, 2] = 2
    joints: tuple[JointSection, ...] = Field(default=(), max_length=0)


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
        if isinstance(value, GearSection) and isinstance(section, JointSection):
            yield from assumed_sections(value, f"gear_{section.name}.", (*field, key))
        elif isinstance(value, Assumed):
            yield from assumed_sections(value, f"{prefix}{key}.", (*field, key))
        elif isinstance(value, tuple):
            for index, item in enumerate(value):
                if isinstance(item, JointSection | SpringSection | SensorSection | LoopLinkSection):
                    yield from assumed_sections(item, f"{item.name}.", (*field, key, index))
