"""What has no motor of its own: joints that are only sensed, the tool's pose."""

from __future__ import annotations

from robid.design.excitation.options import PoseChirpOptions
from robid.settings.experiment import Campaign, Experiment
from robid.settings.problems import Found, suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import commanded_channels, robot_channels
from robid.settings.robot_sections import JointSection
from robid.settings.yaml import FieldPath
from robid.signals.pose import ANGLES

_ROUNDING = 1e-9


def check_pose_interface(robot: RobotFile) -> Found:
    """Yields what is wrong with the pose interface of a robot file."""
    interface, field = robot.pose_interface, ("pose_interface",)
    if interface is None:
        return
    joints = [joint.name for joint in robot.joints]
    for index, name in enumerate(interface.external_axes):
        place = (*field, "external_axes", index)
        if name not in joints:
            yield place, f"S110 there is no joint `{name}`; {suggest(name, joints)}"
        elif joints.index(name) != index:
            message = f"S111 external axes carry the root: they are the first joints, in their order ({joints[index]})"
            yield place, message
        elif not robot.joints[index].slides:
            yield place, f"S112 `{name}` is revolute: only what slides can be an external axis"
    if len(interface.external_axes) == len(joints):
        yield (*field, "external_axes"), "S113 leave no joint for the arm"
    controller = robot.controller
    if controller is not None:
        ratio = interface.sampling_period_s / controller.sampling_period_s
        if ratio < 1 - _ROUNDING or abs(ratio - round(ratio)) > _ROUNDING * ratio:
            message = f"must be a whole multiple of the controller's {controller.sampling_period_s:g} s"
            yield (*field, "sampling_period_s"), f"S114 {message} (found {interface.sampling_period_s:g})"


def check_pose_campaign(field: FieldPath, campaign: Campaign, robot: RobotFile) -> Found:
    """Yields what is wrong with a campaign's pose commands, or with what only such campaigns have."""
    options = campaign.excitation
    simulated = None if campaign.source is None else campaign.source.simulate
    if not isinstance(options, PoseChirpOptions):
        if simulated is not None and simulated.measured_pose != "motors":
            yield (*field, "source", "simulate", "measured_pose"), "S115 is for the excitation `signal: pose_chirp`"
        return
    if campaign.experiments is not None:
        message = "S116 a pose chirp is one experiment a channel: leave it out, or say `channels` of the excitation"
        yield (*field, "experiments"), message
    if campaign.outputs != ("motors",):
        yield (*field, "outputs"), "S117 a pose chirp measures the channels that it moves: leave it out"
    if campaign.estimate.compensation != "none":
        message = "S118 friction is subtracted from motor torques, not from pose commands: use `compensation: none`"
        yield (*field, "estimate", "compensation"), message
    if robot.pose_interface is None and (campaign.source is None or campaign.source.acquire is None):
        message = "S119 a pose chirp needs the robot file's `pose_interface`, which is missing"
        yield (*field, "excitation", "signal"), message
        return
    yield from _channels((*field, "excitation"), options, commanded_channels(campaign, robot) or (), robot)


def _channels(field: FieldPath, options: PoseChirpOptions, channels: tuple[str, ...], robot: RobotFile) -> Found:
    known = robot_channels(robot)
    for index, name in enumerate(options.channels):
        if name not in known:
            yield (*field, "channels", index), f"S120 there is no channel `{name}`; {suggest(name, known)}"
        elif name in options.channels[:index]:
            yield (*field, "channels", index), f"S121 `{name}` is there twice"
    for key, stated, turns in (
        ("amplitude_mm", options.amplitude_mm, False),
        ("amplitude_deg", options.amplitude_deg, True),
    ):
        own = [name for name in channels if (name in ANGLES) == turns]
        if not isinstance(stated, dict):
            if stated <= 0:
                yield (*field, key), f"S122 must be above 0 (found {stated:g})"
            continue
        for name, value in stated.items():
            if name not in own:
                yield (*field, key, name), f"S123 is no channel of this kind; {suggest(name, own)}"
            elif value <= 0:
                yield (*field, key, name), f"S124 must be above 0 (found {value:g})"
        missing = [name for name in own if name not in stated]
        if missing:
            yield (*field, key), f"S125 lacks {', '.join(missing)}"


def check_sensed(field: FieldPath, robot: RobotFile, joint: JointSection) -> Found:
    """Yields what contradicts a sensor that measures a joint's torque behind its gear."""
    why = f"the torque of `{joint.name}` is measured at the joint, behind"
    if joint.motor is not None:
        yield (*field, "motor"), f"S126 {why} motor and gear: leave `motor` out, or `torque_measured_at`"
    if joint.couplings:
        yield (*field, "couplings"), f"S127 {why} all motors that turn it: leave `couplings` out"
    own = [spring for spring in robot.all_springs if spring.joint == joint.name]
    springs = [spring.name for spring in own if spring.place in ("transmission", "shaft")]
    if springs:
        place = "gear" if joint.gear is not None else "name"
        yield (*field, place), f"S128 {why} its gear, whose spring it does not show: leave {', '.join(springs)} out"


def check_experiment_of_sensed(experiment: Experiment, robot: RobotFile) -> Found:
    """Yields simulations, excitations and choices of configurations, which need a motor at every joint."""
    names = robot.without_motor
    if not names:
        return
    told = without_motor_text(names)
    for name, campaign in experiment.campaigns.items():
        what = _needs_motors(campaign)
        if what:
            key, verb = what
            yield ("campaigns", name, *key), f"S129 {verb} a motor at every joint: {told}"
    for name in experiment.designs:
        yield ("designs", name), f"S130 a choice of configurations needs a motor at every joint: {told}"


def without_motor_text(names: tuple[str, ...]) -> str:
    """Says which joints have no motor, and what to do where one is needed."""
    listed = ", ".join(f"`{name}`" for name in names)
    has, of = ("has", "it") if len(names) == 1 else ("have", "them")
    return (
        f"{listed} {has} none (`torque_measured_at: joint`); give {of} a `motor` in a robot file of its own, or import"
        " logs (`acquire`) for fits of family `rigid`"
    )


def _needs_motors(campaign: Campaign) -> tuple[FieldPath, str] | None:
    if campaign.source is None:
        return (), "an excitation needs"
    if campaign.source.acquire is None:
        return ("source", "simulate"), "a simulation needs"
    if campaign.source.acquire.references and not (campaign.is_one_shot or campaign.is_arbitrary):
        return ("source", "acquire", "references"), "an excitation that is designed here needs"
    return None
