"""What follows from a robot file: parameters of an elastic fit; commands of the tool's pose, with its frame."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from robid.design.excitation.options import PoseChirpOptions
from robid.errors import SettingsError
from robid.robot.description import Robot
from robid.robot.kinematics import ToolArm
from robid.robot.parameters import names_of
from robid.settings.experiment import Campaign
from robid.settings.robot import RobotFile
from robid.signals.pose import POSE, RAIL, rotation_from_zyx
from robid.simulate.options import PoseInterface


def robot_channels(robot: RobotFile) -> tuple[str, ...]:
    """Returns the names of what of a robot's pose can be commanded."""
    external = () if robot.pose_interface is None else robot.pose_interface.external_axes
    return (*POSE[:3], *((RAIL,) if len(external) == 1 else external), *POSE[3:])


def commanded_channels(campaign: Campaign, robot: RobotFile) -> tuple[str, ...] | None:
    """Returns the names of a campaign's pose commands; None where its excitation is no pose chirp."""
    options = campaign.excitation
    return (options.channels or robot_channels(robot)) if isinstance(options, PoseChirpOptions) else None


def input_count(campaign: Campaign, robot: RobotFile) -> int:
    """Returns how many inputs an excitation has: motors, or channels of the pose."""
    channels = commanded_channels(campaign, robot)
    return len(robot.joints) if channels is None else len(channels)


def require_pose_interface(robot: RobotFile) -> PoseInterface:
    """Returns the robot file's pose interface.

    Raises:
        SettingsError: If it has none.
    """
    if robot.pose_interface is None:
        raise SettingsError(
            "S331 the robot file has no `pose_interface`, which takes pose commands",
            where=robot.name,
            remedy="add a `pose_interface` section",
        )
    return robot.pose_interface


def tool_arm(file: RobotFile, robot: Robot) -> ToolArm:
    """Returns the rigid arm with its tool; `robot` is the file's."""
    interface = require_pose_interface(file)
    position, rotation = file.joints[-1].geometry.link_frame()
    return ToolArm(
        robot=robot,
        external=len(interface.external_axes),
        tool_m=position + rotation @ np.array(interface.tool_m),
        tool_rotation=rotation @ rotation_from_zyx(np.deg2rad(interface.tool_abc_deg)),
    )


def parameter_names(robot: RobotFile, kinds: Iterable[str]) -> list[str]:
    """Returns the name of every parameter of these kinds that an elastic fit of this robot has."""
    return list(kinds_by_name(robot, kinds))


def kinds_by_name(robot: RobotFile, kinds: Iterable[str]) -> dict[str, str]:
    """Returns every parameter of these kinds with its kind; shifts along an axis too, which have no effect."""
    joints = [joint.name for joint in robot.joints]
    pairs = ((name, kind) for kind in kinds for name in names_of(kind, robot.all_springs, joints))
    return {name: kind for name, kind in pairs if name is not None}
