"""What settings say about commands of the tool's pose: channels, tool frame, the arm above the external axes."""

from __future__ import annotations

import numpy as np

from robid.design.excitation.options import PoseChirpOptions
from robid.errors import SettingsError
from robid.robot.description import Robot
from robid.robot.kinematics import ToolArm
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
            "the robot file has no `pose_interface`, which takes pose commands",
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
