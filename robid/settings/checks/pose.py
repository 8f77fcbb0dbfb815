"""What must hold of a robot's pose interface and of campaigns that command poses."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeAlias

from robid.design.excitation.options import PoseChirpOptions
from robid.settings.experiment import Campaign
from robid.settings.pose import commanded_channels, robot_channels
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.signals.pose import ANGLES

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]
_ROUNDING = 1e-9


def check_pose_interface(robot: RobotFile) -> _Found:
    """Yields what is wrong with the pose interface of a robot file."""
    interface, field = robot.pose_interface, ("pose_interface",)
    if interface is None:
        return
    joints = [joint.name for joint in robot.joints]
    for index, name in enumerate(interface.external_axes):
        place = (*field, "external_axes", index)
        if name not in joints:
            yield place, f"there is no joint `{name}`; {suggest(name, joints)}"
        elif joints.index(name) != index:
            yield place, f"external axes carry the root: they are the first joints, in their order ({joints[index]})"
        elif not robot.joints[index].slides:
            yield place, f"`{name}` is revolute: only what slides can be an external axis"
    if len(interface.external_axes) == len(joints):
        yield (*field, "external_axes"), "leave no joint for the arm"
    controller = robot.controller
    if controller is not None:
        ratio = interface.sampling_period_s / controller.sampling_period_s
        if ratio < 1 - _ROUNDING or abs(ratio - round(ratio)) > _ROUNDING * ratio:
            message = f"must be a whole multiple of the controller's {controller.sampling_period_s:g} s"
            yield (*field, "sampling_period_s"), f"{message} (found {interface.sampling_period_s:g})"


def check_pose_campaign(field: FieldPath, campaign: Campaign, robot: RobotFile) -> _Found:
    """Yields what is wrong with a campaign's pose commands, or with what only such campaigns have."""
    options = campaign.excitation
    simulated = None if campaign.source is None else campaign.source.simulate
    if not isinstance(options, PoseChirpOptions):
        if simulated is not None and simulated.measured_pose != "motors":
            yield (*field, "source", "simulate", "measured_pose"), "is for the excitation `signal: pose_chirp`"
        return
    if campaign.experiments is not None:
        message = "a pose chirp is one experiment for each channel: leave it out, or say `channels` of the excitation"
        yield (*field, "experiments"), message
    if campaign.outputs != ("motors",):
        yield (*field, "outputs"), "a pose chirp measures the channels that it moves: leave it out"
    if campaign.estimate.compensation != "none":
        message = "friction is subtracted from motor torques, not from pose commands: use `compensation: none`"
        yield (*field, "estimate", "compensation"), message
    if robot.pose_interface is None and (campaign.source is None or campaign.source.acquire is None):
        yield (*field, "excitation", "signal"), "a pose chirp needs the robot file's `pose_interface`, which is missing"
        return
    yield from _channels((*field, "excitation"), options, commanded_channels(campaign, robot) or (), robot)


def _channels(field: FieldPath, options: PoseChirpOptions, channels: tuple[str, ...], robot: RobotFile) -> _Found:
    known = robot_channels(robot)
    for index, name in enumerate(options.channels):
        if name not in known:
            yield (*field, "channels", index), f"there is no channel `{name}`; {suggest(name, known)}"
        elif name in options.channels[:index]:
            yield (*field, "channels", index), f"`{name}` is there twice"
    for key, stated, turns in (
        ("amplitude_mm", options.amplitude_mm, False),
        ("amplitude_deg", options.amplitude_deg, True),
    ):
        own = [name for name in channels if (name in ANGLES) == turns]
        if not isinstance(stated, dict):
            if stated <= 0:
                yield (*field, key), f"must be above 0 (found {stated:g})"
            continue
        for name, value in stated.items():
            if name not in own:
                yield (*field, key, name), f"is no channel of this kind; {suggest(name, own)}"
            elif value <= 0:
                yield (*field, key, name), f"must be above 0 (found {value:g})"
        missing = [name for name in own if name not in stated]
        if missing:
            yield (*field, key), f"lacks {', '.join(missing)}"
