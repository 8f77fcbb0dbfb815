"""What must hold of a campaign that is imported from logs."""

from __future__ import annotations

import string
from collections.abc import Iterator
from typing import TypeAlias

from robid.settings.base import DATA_VARIABLE
from robid.settings.experiment import Acquire, Campaign
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]
_PLACES = ("configuration", "realization", "experiment")
_UNITS = {"speed_reference": ("rad/s", "deg/s", "rpm"), "position_reference": ("rad", "deg"), "torque": ("N m",)}


def check_logs(field: FieldPath, campaign: Campaign, acquire: Acquire, n_configuration: int | None) -> _Found:
    """Finds what is wrong with the logs of a campaign whatever the robot is.

    Args:
        field: Place of the campaign.
        campaign: The campaign.
        acquire: Its logs.
        n_configuration: Its number of configurations, None where that is not known.
    """
    inside = (*field, "source", "acquire")
    counts = {"configuration": n_configuration or 1, "realization": campaign.realizations}
    yield from _file(
        (*inside, "file"), acquire.file, {**counts, "experiment": campaign.experiments or len(acquire.inputs)}
    )
    every = (("inputs", acquire.inputs), ("outputs", acquire.outputs), ("references", acquire.references))
    for key, channels in every:
        names = [channel.name for channel in channels]
        for index, channel in enumerate(names):
            if channel in names[:index]:
                yield (*inside, key, index, "name"), f"`{channel}` is there twice"
    known = _UNITS[campaign.excitation.inject]
    for index, reference in enumerate(acquire.references):
        if reference.unit not in known:
            message = f"{reference.unit} is no unit of a {campaign.excitation.inject}: use {' or '.join(known)}"
            yield (*inside, "references", index, "unit"), message
    if len({channel.normalised for channel in acquire.inputs}) > 1:
        yield (*inside, "inputs"), "either all torques are normalised currents, or none"
    if len({channel.hold for channel in acquire.inputs}) > 1:
        yield (*inside, "inputs"), "all must have the same `hold`"
    if campaign.estimate.compensation == "nominal" and any(channel.normalised for channel in acquire.inputs):
        message = "friction in N m cannot be subtracted from a normalised current: use `compensation: none`"
        yield (*field, "estimate", "compensation"), message


def check_channels(field: FieldPath, acquire: Acquire, robot: RobotFile) -> _Found:
    """Finds channels that are not those of the robot, and what a match with its excitation lacks."""
    inside = (*field, "source", "acquire")
    joints = [joint.name for joint in robot.joints]
    for key, channels in (("inputs", acquire.inputs), ("references", acquire.references)):
        if channels and [channel.name for channel in channels] != joints:
            yield (*inside, key), f"must be one channel per joint, named in this order: {', '.join(joints)}"
    known = [*joints, *(f"{joint}.arm" for joint in joints)]
    for index, channel in enumerate(acquire.outputs):
        if channel.name not in known:
            message = f"`{channel.name}` is not an angle of the robot; {suggest(channel.name, known)}"
            yield (*inside, "outputs", index, "name"), message
        slides = any(joint.slides and channel.name == f"{joint.name}.arm" for joint in robot.joints)
        if channel.name in known and slides != (channel.unit in ("m", "mm")):
            side = "the arm side of a prismatic joint is in m or mm" if slides else "angles are in rad or deg"
            yield (*inside, "outputs", index, "unit"), f"{channel.unit} is no unit of `{channel.name}`: {side}"
    if not acquire.references:
        return
    if robot.controller is None:
        yield (*inside, "references"), "the excitation is designed for the robot file's `controller`, which is missing"
    elif abs(robot.controller.sampling_period_s / acquire.sampling_period_s - 1) > 1e-9:
        message = f"must be the controller's, {robot.controller.sampling_period_s:g} s, to be matched to its excitation"
        yield (*inside, "sampling_period_s"), message


def _file(field: FieldPath, file: str, counts: dict[str, int]) -> _Found:
    """Finds numbers that a path cannot hold, and several logs under one name."""
    rest = file.removeprefix(DATA_VARIABLE)
    if "$" in rest:
        yield field, f"only `{DATA_VARIABLE}`, at the start, is replaced in a path"
        return
    try:
        used = {name for _, name, _, _ in string.Formatter().parse(rest) if name is not None}
        rest.format(**dict.fromkeys(_PLACES, 1))
    except (ValueError, KeyError, IndexError, AttributeError):
        yield field, f"only {', '.join(f'`{{{name}}}`' for name in _PLACES)} stand for numbers in a path"
        return
    for name, count in counts.items():
        if count > 1 and name not in used:
            yield field, f"there is one log for each of {count} {name}s: put `{{{name}}}` into its name"
