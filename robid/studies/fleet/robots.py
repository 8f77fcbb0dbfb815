"""The robots of the fleet, and what is wrong with some of them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robid.pipeline.graph import Run
from robid.settings.load import LoadedExperiment
from robid.studies.fleet.check import KINDS
from robid.studies.settings.fleet import FleetStudy

_WHERE = (0.1, 0.6)
"""Shares of the log between which faults lie: in its periods that are used, not in those that follow them."""

_VARIANTS = {"sign": ("torque", "angle"), "dead": ("constant", "noise"), "file": ("truncated", "overwritten")}


@dataclass(frozen=True)
class Fault:
    """What is wrong with a robot or its log.

    Attributes:
        kind: One of `KINDS`.
        variant: Which of its forms, of the kinds that have several.
        joint: Index of the joint.
        channel: `torque` or `angle` of that joint.
        at: Where in its file or its samples, as a share.
        samples: How many are lost.
        seed: Seed of noise.
    """

    kind: str
    variant: str
    joint: int
    channel: str
    at: float
    samples: int
    seed: int


@dataclass(frozen=True)
class FleetRobot:
    """A robot of the fleet.

    Attributes:
        name: Its row in the manifest.
        seed: Seed of its springs, its friction and its noise.
        fault: What is wrong; None of a sound one.
    """

    name: str
    seed: int
    fault: Fault | None

    @property
    def log(self) -> str:
        """Its log, from the run folder on."""
        return f"logs/{self.name}.mat"

    @property
    def kind(self) -> str:
        """Kind of its fault; empty of a sound one."""
        return "" if self.fault is None else self.fault.kind


def study_of(loaded: LoadedExperiment) -> FleetStudy:
    """Returns the study of an experiment that has one of this kind."""
    study = loaded.experiment.study
    if not isinstance(study, FleetStudy):
        message = "the study is of another kind"
        raise TypeError(message)
    return study


def fleet_robots(run: Run) -> tuple[FleetRobot, ...]:
    """Returns the robots, in the order of the manifest."""
    study, n_joint = study_of(run.loaded), len(run.loaded.robot.joints)
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
    return run.loaded.path.parent / study_of(run.loaded).experiment
