"""The robots of the fleet, what is wrong with some of them, and what that makes of their logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from robid.errors import require_module
from robid.fleet.table import require_table
from robid.pipeline.graph import Run
from robid.settings.load import LoadedExperiment
from robid.studies.settings.study import KINDS, FleetStudy
from robid.studies.study import study_of

_WHERE = (0.1, 0.6)
"""Shares of the log between which faults lie: in its periods that are used, not in those that follow them."""

_VARIANTS = {"sign": ("torque", "angle"), "dead": ("constant", "noise"), "file": ("truncated", "overwritten")}


@dataclass(frozen=True)
class Fault:
    """What is wrong with a robot or its log."""

    kind: str
    variant: str  # Which of its forms, of the kinds that have several
    joint: int  # Index of the joint
    channel: str  # `torque` or `angle` of that joint
    at: float  # Where in its file or its samples, as a share
    samples: int  # How many are lost
    seed: int  # Seed of noise


@dataclass(frozen=True)
class FleetRobot:
    """A robot of the fleet."""

    name: str  # Its row in the manifest
    seed: int  # Seed of its springs, its friction and its noise
    fault: Fault | None  # What is wrong; None of a sound one

    @property
    def log(self) -> str:
        """Its log, from the run folder on."""
        return f"logs/{self.name}.mat"

    @property
    def kind(self) -> str:
        """Kind of its fault; empty of a sound one."""
        return "" if self.fault is None else self.fault.kind


def fleet_robots(run: Run) -> tuple[FleetRobot, ...]:
    """Returns the robots, in the order of the manifest."""
    study, n_joint = study_of(run.loaded, FleetStudy), len(run.loaded.robot.joints)
    return plan_robots(study, n_joint)


def plan_robots(study: FleetStudy, n_joint: int) -> tuple[FleetRobot, ...]:
    """Draws which robots have a fault, and what.

    Args:
        study: The study.
        n_joint: Number of joints of the robot.
    """
    generator = np.random.default_rng(study.faults.seed)
    chosen = generator.permutation(study.robots)[: len(KINDS) * study.faults.each]
    faults = {int(index): _fault(study, n_joint, number, generator) for number, index in enumerate(chosen)}
    width = max(len(str(study.robots)), 4)
    return tuple(
        FleetRobot(f"r{index + 1:0{width}d}", study.first_seed + index, faults.get(index))
        for index in range(study.robots)
    )


def _fault(study: FleetStudy, n_joint: int, number: int, generator: np.random.Generator) -> Fault:
    """One of each kind after the other; the forms of a kind take turns."""
    kind, turn = KINDS[number % len(KINDS)], number // len(KINDS)
    variants = _VARIANTS.get(kind, ("",))
    variant = variants[turn % len(variants)]
    joint, fewest_most = int(generator.integers(n_joint)), study.faults.lost_samples
    channel = variant if kind == "sign" else str(generator.choice(["torque", "angle"]))
    at, samples = float(generator.uniform(*_WHERE)), int(generator.integers(*fewest_most, endpoint=True))
    return Fault(kind, variant, joint, channel, at, samples, int(generator.integers(2**31)))


def template_path(run: Run) -> Path:
    """Returns the experiment file that reads the logs."""
    return run.loaded.path.parent / study_of(run.loaded, FleetStudy).experiment


Log: TypeAlias = dict[str, dict[str, NDArray[np.int32]]]
"""Samples (n_sample,) of each channel, as `torque_<joint>`, of each experiment of a log."""

_NOISE = 2.0
_OVERWRITTEN = 512


def faulty_log(log: Log, fault: Fault, joints: Sequence[str]) -> Log:
    """Returns a log as a fault in its signals leaves it.

    Args:
        log: The log of the robot.
        fault: What is wrong; other kinds of faults leave the signals as they are.
        joints: Names of the joints.
    """
    channel = f"{fault.channel}_{joints[fault.joint]}"
    if fault.kind == "sign":
        return {name: {**one, channel: -one[channel]} for name, one in log.items()}
    if fault.kind == "dead":
        return _dead(log, fault, channel)
    if fault.kind == "gap":
        return _with_gap(log, fault)
    return log


def faulty_bytes(content: bytes, fault: Fault) -> bytes:
    """Returns a file as a fault leaves it: cut off, or a part of it overwritten; other kinds leave it as it is."""
    at = int(fault.at * len(content))
    if fault.kind != "file":
        return content
    if fault.variant == "truncated":
        return content[:at]
    part = content[at : at + _OVERWRITTEN]
    return content[:at] + bytes(255 - byte for byte in part) + content[at + len(part) :]


def _dead(log: Log, fault: Fault, channel: str) -> Log:
    """A channel stays at its first number, or shows a few counts of noise around it."""
    generator = np.random.default_rng(fault.seed)
    first = next(iter(log.values()))[channel][0]
    spread = _NOISE if fault.variant == "noise" else 0.0

    def dead(one: Mapping[str, NDArray[np.int32]]) -> NDArray[np.int32]:
        noise = spread * generator.normal(size=one[channel].shape)
        return np.asarray(first + np.rint(noise), dtype=np.int32)

    return {name: {**one, channel: dead(one)} for name, one in log.items()}


def _with_gap(log: Log, fault: Fault) -> Log:
    """All channels of one experiment lack the same samples."""
    name = list(log)[fault.seed % len(log)]
    length = len(next(iter(log[name].values())))
    at = int(fault.at * (length - fault.samples))
    lost = slice(at, at + fault.samples)
    return {**log, name: {channel: np.delete(values, lost) for channel, values in log[name].items()}}


def require_packages(loaded: LoadedExperiment) -> None:
    """Refuses to start without the packages that tables and Dask need."""
    require_table()
    study = study_of(loaded, FleetStudy)
    if study.speed is not None or study.scheduled:
        require_module("distributed", "dask", "What the study measures of Dask")
