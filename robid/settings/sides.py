"""One name for each side of a joint: an experiment's logs as the rest of the house reads them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import TypeVar

from robid.settings.acquire import Acquire
from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.signals.log_channels import InputChannel, OutputChannel, ReferenceChannel

ARM = ".arm"
_One = TypeVar("_One", InputChannel, OutputChannel, ReferenceChannel)


def with_sides(experiment: Experiment, robot: RobotFile) -> Experiment:
    """Returns an experiment whose channels of a joint's arm side are named alike, however the file wrote them.

    `A1.arm`, `A1` with `side: arm`, and `A1` of a joint without a motor are the same. An output is then called
    `A1.arm`, since the motor's angle may stand beside it; an input or a reference is the one of its joint, `A1` with
    its side.
    """
    changed = {}
    for name, campaign in experiment.campaigns.items():
        source = campaign.source
        acquire = None if source is None else source.acquire
        if source is None or acquire is None:
            continue
        found = _in_robot(acquire, robot)
        if found != acquire:
            changed[name] = campaign.model_copy(update={"source": source.model_copy(update={"acquire": found})})
    return experiment.model_copy(update={"campaigns": {**experiment.campaigns, **changed}}) if changed else experiment


def _in_robot(acquire: Acquire, robot: RobotFile) -> Acquire:
    joints, sensed = [joint.name for joint in robot.joints], robot.without_motor
    return replace(
        acquire,
        inputs=tuple(_drive(one, joints, sensed) for one in acquire.inputs),
        references=tuple(_drive(one, joints, sensed) for one in acquire.references),
        outputs=tuple(_output(one, joints, sensed) for one in acquire.outputs),
    )


def _drive(channel: _One, joints: Collection[str], sensed: Collection[str]) -> _One:
    name = channel.name.removesuffix(ARM)
    is_arm = _is_arm(channel, joints, sensed)
    return replace(channel, name=name, side="arm") if is_arm else channel


def _output(channel: OutputChannel, joints: Collection[str], sensed: Collection[str]) -> OutputChannel:
    is_arm = _is_arm(channel, joints, sensed) and not channel.name.endswith(ARM)
    return replace(channel, name=f"{channel.name}{ARM}", side=None) if is_arm else channel


def _is_arm(channel: _One, joints: Collection[str], sensed: Collection[str]) -> bool:
    """Whether a channel is of the arm side of a joint; one that contradicts itself stays for the checks."""
    name = channel.name.removesuffix(ARM)
    if name not in joints:
        return False
    if channel.name.endswith(ARM):
        return channel.side in (None, "arm")
    return channel.side == "arm" or (channel.side is None and name in sensed)
