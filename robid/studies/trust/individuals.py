"""The robots of the study of trust: which sizes their defects have, and what must hold of their files."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from robid.results.doubt import CAUSES
from robid.settings.experiment import Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.simulate.options import Imperfections
from robid.studies.experiments import Problems, campaign_problem, fit_problem, physics_problems
from robid.studies.settings.trust import Defects, TrustStudy

_DEFECT_DRAWS = 2  # keeps these draws apart from those of springs and masses
_SIZES = frozenset(field.name for field in fields(Imperfections) if field.type == "float")

_OF_SPRINGS = ("stiffness_nm_rad", "damping_nms_rad")

LINEAR, FILE = "linear", "linear_file"
"""Names of the linear robots: those whose doubted values are drawn, and those that are as their file says."""


@dataclass(frozen=True)
class Individual:
    """One robot of the study."""

    group: str  # Name of its set, of its cause, or one of the linear robots
    kind: str  # `set`, `cause` or `linear`
    robot: str  # `heavy` or `light`
    seed: int  # Seed of its truth, its defects, its places and its noise
    physics: Mapping[str, Any]  # What is simulated otherwise than the campaigns say: `imperfections` and `truth`
    referenced: bool = False  # Whether it is measured in fresh and designed places too

    @property
    def key(self) -> str:
        """A name that no other robot has."""
        return f"{self.group}_{self.seed}"


def individuals(study: TrustStudy) -> list[Individual]:
    """Returns all robots: those of the sets, of the causes, then the linear ones; each has a seed of its own."""
    limit, seed = study.chosen.robots, study.chosen.first
    found: list[Individual] = []
    for group in _groups(study):
        count = group.count if limit is None else min(group.count, limit)
        found += [group.individual(number, seed + number) for number in range(count)]
        seed += count
    return found


@dataclass(frozen=True)
class _Group:
    """Robots of one kind, with what they lack in their model."""

    name: str
    kind: str
    count: int
    defects: Defects
    referenced: int = 0

    def individual(self, number: int, seed: int) -> Individual:
        physics = drawn_physics(self.defects, seed)
        return Individual(self.name, self.kind, self.defects.robot, seed, physics, number < self.referenced)


def _groups(study: TrustStudy) -> Iterator[_Group]:
    for name, defects in study.sets.items():
        yield _Group(name, "set", defects.robots, defects, defects.referenced)
    for name, kind in study.causes.items():
        stated = Defects(imperfections=kind.imperfections, truth=kind.truth, size_factor=1.0, robots=study.cause_robots)
        yield _Group(name, "cause", study.cause_robots, stated)
    for name, count in () if study.linear is None else ((LINEAR, study.linear.drawn), (FILE, study.linear.file)):
        yield _Group(name, "linear", count, Defects(robots=max(count, 1)))


def drawn_physics(defects: Defects, seed: int) -> dict[str, Any]:
    """Returns the imperfections and the truth of one robot, its sizes and springs drawn.

    Args:
        defects: What the robots of its set have.
        seed: Seed of the robot.
    """
    generator = np.random.default_rng([seed, _DEFECT_DRAWS])

    def factor() -> float:
        return float(np.exp(np.log(defects.size_factor) * generator.uniform(-1, 1)))

    sizes = {key: value * factor() if _is_size(key, value) else value for key, value in defects.imperfections.items()}
    chosen = np.sort(generator.permutation(len(defects.springs))[: defects.springs_each])
    springs = []
    for spring in (defects.springs[index] for index in chosen.tolist()):
        plain = spring.model_dump(mode="json", exclude_none=True)
        share = factor()
        springs.append({**plain, **{key: plain[key] * share for key in _OF_SPRINGS if key in plain}})
    truth = {**defects.truth, **({"springs": springs} if springs else {})}
    return {key: value for key, value in (("imperfections", sizes), ("truth", truth)) if value}


def _is_size(key: str, value: object) -> bool:
    return key in _SIZES and isinstance(value, int | float)


def check_trust(study: TrustStudy, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of trust."""
    yield from robot_problems(study, "heavy", experiment, robot)
    yield from _check_groups(study)
    ends = [_end(study, use) for use in ("judge", "choose")]
    if max(study.seeds.judge.first, study.seeds.choose.first) < min(ends):
        yield ("study", "seeds"), "the seeds of `judge` and `choose` overlap"


def robot_problems(study: TrustStudy, name: str, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields why an experiment cannot be that of the study's robot `heavy` or `light`.

    Its campaigns may not fit, or sets and causes may name what its robot or its simulation does not have.
    """
    told = list(_campaign_problems(experiment, study))
    yield from told
    if told:
        return
    campaign, seen = experiment.campaigns[experiment.fits[study.fit].campaign], set[str]()
    for one in individuals(study):
        if one.robot == name and one.kind != "linear" and one.group not in seen:
            seen.add(one.group)
            field = ("study", "sets" if one.kind == "set" else "causes", one.group)
            found = physics_problems(campaign, one.physics, robot)
            yield from (((*field, *place), message) for place, message in found)


def _campaign_problems(experiment: Experiment, study: TrustStudy) -> Problems:
    if message := fit_problem(experiment, study.fit):
        yield ("study", "fit"), message
        return
    fit = experiment.fits[study.fit]
    for name, least in ((fit.campaign, 1), (str(fit.validate_on), study.validated_in)):
        chosen = experiment.campaigns[name].configurations
        if chosen is None or chosen.random is None:
            message = f"campaign `{name}` needs `random` configurations: each robot's places are drawn anew"
            yield ("study", "fit"), message
        elif chosen.random.count < least:
            yield ("study", "validated_in"), f"campaign `{name}` has {chosen.random.count} places only"
    if study.designed is not None and (message := campaign_problem(experiment, study.designed, "robot")):
        yield ("study", "designed"), message


def _check_groups(study: TrustStudy) -> Problems:
    for name, defects in study.sets.items():
        field = ("study", "sets", name)
        if defects.robot == "light" and study.light is None:
            yield (*field, "robot"), "the study has no `light` robot"
        if defects.referenced > defects.robots:
            yield (*field, "referenced"), f"the set has {defects.robots} robots only"
        if defects.springs_each > len(defects.springs):
            yield (*field, "springs_each"), f"there are {len(defects.springs)} springs to draw from"
    for name, kind in study.causes.items():
        field = ("study", "causes", name)
        if name in study.sets:
            yield field, "a set has this name too"
        for index, cause in enumerate(kind.named):
            if cause not in CAUSES:
                yield (*field, "named", index), f"there is no cause `{cause}`; {suggest(cause, CAUSES)}"


def _end(study: TrustStudy, use: str) -> int:
    found = individuals(study.model_copy(update={"use": use}))
    return max((one.seed for one in found), default=0) + 1
