"""Settings as plain values, as stages hash them, and what follows from a robot file: parameters, poses of the tool."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import numpy as np

from robid.design.excitation.options import PoseChirpOptions
from robid.errors import SettingsError
from robid.later import later
from robid.robot.description import Robot
from robid.robot.parameters import names_of
from robid.settings.experiment import Campaign
from robid.settings.robot import RobotFile
from robid.signals.pose import POSE, RAIL, rotation_from_zyx
from robid.simulate.options import PoseInterface

if TYPE_CHECKING:
    from robid.settings.load import LoadedExperiment
    from robid.simulate.options import Controller

with later(__name__):
    from robid.robot.kinematics import ToolArm


Part: TypeAlias = Literal[
    "mechanics",
    "rigid",
    "range",
    "motor_limits",
    "friction",
    "friction_std",
    "inertia_std",
    "torque_constant",
    "rated_torque",
    "doubts",
    "timing",
    "controller",
    "sensors",
    "pose",
]

_MOTOR: dict[str, Part] = {
    **dict.fromkeys(("inertia_kgm2", "gear_ratio", "gear_ratio_rad_m"), "mechanics"),
    **{"inertia_relative_std": "inertia_std", "torque_constant_nm_a": "torque_constant"},
    "rated_torque_nm": "rated_torque",
    **dict.fromkeys(("max_speed_rad_s", "max_torque_nm"), "motor_limits"),
    **dict.fromkeys(("ripple_nm", "ripple_order"), "friction"),
}
_ONLY_STATED = ("torque_constant_nm_a", "rated_torque_nm")
"""What is left out where no file states it, so that what was made before it could be stated stays fresh."""

_FRICTION: dict[str, Part] = {
    **{"viscous_nms_rad": "mechanics", "relative_std": "friction_std"},
    **dict.fromkeys(("coulomb_nm", "static_nm", "stribeck_rad_s", "presliding_rad"), "friction"),
}
_JOINT: dict[str, Part] = {
    **dict.fromkeys(("dh", "frame", "type", "rigid", "link", "gear", "couplings"), "mechanics"),
    **dict.fromkeys(("arm_viscous_nms_rad", "arm_viscous_ns_m"), "mechanics"),
    **{"limits_deg": "range", "limits_m": "range", "counterbalance": "rigid", "doubts": "doubts"},
}
_ROBOT: dict[str, Part] = {
    **dict.fromkeys(("gravity_m_s2", "base_rpy_deg", "rotor", "springs", "payload", "base"), "mechanics"),
    **{"loop_links": "rigid", "controller": "controller", "sensors": "sensors"},
    **{"pose_interface": "pose", "floor_m": "range", "doubts": "doubts"},
}

_TIMING = ("sampling_period_s", "delay_samples")


def robot_settings(loaded: LoadedExperiment, *parts: Part) -> dict[str, Any]:
    """Returns the named parts of the robot file as `{"robot": ...}`; what no stage computes with is left out."""
    plain = loaded.plain["robot"]
    chosen = _pick(plain, _ROBOT, parts)
    if "timing" in parts and plain["controller"] is not None:
        chosen["controller"] = {key: plain["controller"][key] for key in _TIMING}
    chosen["joints"] = []
    for joint in plain["joints"]:
        motor = None if joint["motor"] is None else _pick(joint["motor"], _MOTOR, parts)
        if motor is not None:
            motor["friction"] = _pick(joint["motor"]["friction"], _FRICTION, parts)
        chosen["joints"].append({"name": joint["name"], **_pick(joint, _JOINT, parts), "motor": motor})
    return {"robot": _without_assumed(chosen)}


def line_settings(campaign: Campaign) -> dict[str, Any]:
    """Returns what decides a campaign's lines, how it is sampled left out."""
    return {name: getattr(campaign.excitation, name) for name in campaign.excitation.decides_lines}


def log_sampling_settings(name: str, campaign: Campaign) -> dict[str, float]:
    """Returns the sampling period of a campaign's log by the name of its setting; nothing without a log."""
    acquire = None if campaign.source is None else campaign.source.acquire
    key = f"campaigns.{name}.source.acquire.sampling_period_s"
    return {} if acquire is None else {key: acquire.sampling_period_s}


def require_controller(loaded: LoadedExperiment) -> Controller:
    """Returns the robot file's controller.

    Raises:
        SettingsError: If it has none.
    """
    if loaded.robot.controller is None:
        what = "S332 the robot file has no `controller`, which gives the sampling period"
        remedy = "add a `controller` section"
        raise SettingsError(what, where=loaded.experiment.robot or str(loaded.path), remedy=remedy)
    return loaded.robot.controller


def delay_s(loaded: LoadedExperiment, campaign: Campaign) -> float:
    """Returns the nominal delay to the applied torque: the controller's, a response's as stated, none in a log [s]."""
    if campaign.source is not None and campaign.source.response is not None:
        return campaign.source.response.delay_s
    if campaign.source is not None and campaign.source.acquire is not None:
        return 0.0
    controller = require_controller(loaded)
    return controller.delay_samples * controller.sampling_period_s


def _pick(plain: dict[str, Any], belongs: dict[str, Part], parts: tuple[Part, ...]) -> dict[str, Any]:
    chosen = {key: plain[key] for key, part in belongs.items() if part in parts}
    return {key: value for key, value in chosen.items() if value is not None or key not in _ONLY_STATED}


def _without_assumed(plain: Any) -> Any:  # noqa: ANN401
    if isinstance(plain, dict):
        return {key: _without_assumed(value) for key, value in plain.items() if key != "assumed"}
    return [_without_assumed(value) for value in plain] if isinstance(plain, list) else plain


def plain_settings(settings: object) -> Any:  # noqa: ANN401
    """Returns a settings model, an options dataclass or a container of them as values that JSON knows."""
    from pydantic_core import to_jsonable_python

    return to_jsonable_python(settings, by_alias=True)


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
        what = "S331 the robot file has no `pose_interface`, which takes pose commands"
        remedy = "add a `pose_interface` section"
        raise SettingsError(what, where=robot.name, remedy=remedy)
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
