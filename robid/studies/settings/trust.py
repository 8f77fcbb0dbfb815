"""The study of trust: its section of an experiment file, the robots that it describes, and what must hold around it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np
from pydantic import Field

from robid.results.finding import CAUSES
from robid.settings.base import Name, Section
from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import SpringSection
from robid.simulate.options import Imperfections
from robid.studies.experiments import (
    Count,
    Positive,
    Problems,
    Whole,
    campaign_problem,
    fit_problem,
    physics_problems,
    unknown,
)
from robid.studies.settings.mistakes import Physics


class Defects(Physics):
    """What the robots of a set have and their model lacks, each in sizes of its own."""

    robot: Literal["heavy", "light"] = Field(
        "heavy", description="Whose robots they are: this file's or that of `light`."
    )
    springs: tuple[SpringSection, ...] = Field(
        (), description="Springs that the robot file lacks, from which each robot has some."
    )
    springs_each: Whole = Field(0, description="How many of these a robot has, drawn without return.")
    size_factor: float = Field(
        1.5,
        description="Sizes of the imperfections that stand here, and stiffness and damping of the springs, are"
        " multiplied log-uniformly by up to this factor.",
        ge=1,
    )
    listed: bool = Field(
        False,
        description="Whether nuisance parameters have these defects, so that intervals must hold the true springs.",
    )
    robots: Count = Field(description="Number of robots.")
    referenced: Whole = Field(
        0,
        description="How many of them, the first ones, are measured in fresh and in designed configurations too.",
    )


class LinearRobots(Section):
    """Robots with exact responses plus noise, in as many random configurations as the others."""

    drawn: Whole = Field(40, description="Robots whose nuisance parameters are drawn from their priors.")
    file: Whole = Field(10, description="Robots that are, but for springs and dampers, what their file says.")
    relative_noise: Positive = Field(
        0.01,
        description="Standard deviation of an element's noise over the median response of its output.",
    )


class CauseKind(Physics):
    """A defect that the tool is to name."""

    named: tuple[str, ...] = Field(
        description="Causes that count as right: several where they cannot be told apart.", min_length=1
    )


class TrustSeeds(Section):
    """Seeds of true robots, configurations and noise, consecutive over all robots of the study."""

    first: Whole = Field(description="The first seed.")
    robots: Count | None = Field(None, description="At most as many robots of each set and kind; all when not given.")


class TrustSeedChoice(Section):
    """Two disjoint sets of seeds: everything is chosen with one, the stated figures come from the other."""

    judge: TrustSeeds = Field(description="Those of the stated figures.")
    choose: TrustSeeds = Field(description="Those that everything is chosen with.")


class TrustStudy(Section):
    """Whether intervals hold, on robots whose defects their model does not contain."""

    kind: Literal["trust"] = Field(description="What is studied.")
    fit: Name = Field(
        description="Name of the fit: its campaign has the random configurations of a robot, the one to validate on the"
        " fresh ones of the reference. Each robot's configurations are drawn anew."
    )
    designed: Name | None = Field(
        None,
        description="Name of the campaign in designed configurations, which all robots share; none when not given.",
    )
    validated_in: Count = Field(
        4, description="Fresh configurations, the first ones, in which every robot is validated."
    )
    light: str | None = Field(
        None,
        description="Experiment file, relative to this one, of a light robot, fit and campaigns named alike.",
        min_length=1,
    )
    sets: dict[Name, Defects] = Field(description="The sets of robots, by name.", min_length=1)
    linear: LinearRobots | None = Field(None, description="Linear robots; none when not given.")
    causes: dict[Name, CauseKind] = Field(default_factory=dict, description="Defects that are to be named, by name.")
    cause_robots: Count = Field(5, description="Robots of each of these.")
    cause_places: Count = Field(4, description="Random configurations, the first ones, in which these are measured.")
    seeds: TrustSeedChoice = Field(description="Seeds of the robots.")
    use: Literal["judge", "choose"] = Field("judge", description="Which of the seeds are used.")

    @property
    def chosen(self) -> TrustSeeds:
        """The seeds that are used."""
        return self.seeds.judge if self.use == "judge" else self.seeds.choose


_DEFECT_DRAWS = 2  # keeps these draws apart from those of springs and masses
_SIZES = frozenset(field.name for field in fields(Imperfections) if field.type == "float")

_OF_SPRINGS = ("stiffness_nm_rad", "damping_nms_rad")

LINEAR, FILE = "linear", "linear_file"
"""Names of the linear robots: those whose nuisance parameters are drawn, and those that are as their file says."""


@dataclass(frozen=True)
class Individual:
    """One robot of the study."""

    group: str  # Name of its set, of its cause, or one of the linear robots
    kind: str  # `set`, `cause` or `linear`
    robot: str  # `heavy` or `light`
    seed: int  # Seed of its truth, its defects, its configurations and its noise
    physics: Mapping[str, Any]  # What is simulated otherwise than the campaigns say: `imperfections` and `truth`
    referenced: bool = False  # Whether it is measured in fresh and designed configurations too

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
    """Returns the imperfections and the truth of one robot, its sizes and springs drawn."""
    generator = np.random.default_rng([seed, _DEFECT_DRAWS])

    def factor() -> float:
        return float(np.exp(np.log(defects.size_factor) * generator.uniform(-1, 1)))

    sizes = dict(defects.imperfections)
    sizes |= {key: value * factor() for key, value in sizes.items() if key in _SIZES and isinstance(value, int | float)}
    chosen = np.sort(generator.permutation(len(defects.springs))[: defects.springs_each])
    springs = []
    for spring in (defects.springs[index] for index in chosen.tolist()):
        plain = spring.model_dump(mode="json", exclude_none=True)
        share = factor()
        springs.append({**plain, **{key: plain[key] * share for key in _OF_SPRINGS if key in plain}})
    truth = {**defects.truth, **({"springs": springs} if springs else {})}
    return {key: value for key, value in (("imperfections", sizes), ("truth", truth)) if value}


def check_trust(study: TrustStudy, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of trust."""
    yield from robot_problems(study, "heavy", experiment, robot)
    yield from _check_groups(study)
    ends = [_end(study, use) for use in ("judge", "choose")]
    if max(study.seeds.judge.first, study.seeds.choose.first) < min(ends):
        yield ("study", "seeds"), "S422 the seeds of `judge` and `choose` overlap"


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
            message = (
                f"S423 campaign `{name}` needs `random` configurations: each robot's configurations are drawn anew"
            )
            yield ("study", "fit"), message
        elif chosen.random.count < least:
            yield ("study", "validated_in"), f"S424 campaign `{name}` has {chosen.random.count} configurations only"
    if study.designed is not None and (message := campaign_problem(experiment, study.designed, "robot")):
        yield ("study", "designed"), message


def _check_groups(study: TrustStudy) -> Problems:
    for name, defects in study.sets.items():
        field = ("study", "sets", name)
        if defects.robot == "light" and study.light is None:
            yield (*field, "robot"), "S425 the study has no `light` robot"
        if defects.referenced > defects.robots:
            yield (*field, "referenced"), f"S426 the set has {defects.robots} robots only"
        if defects.springs_each > len(defects.springs):
            yield (*field, "springs_each"), f"S427 there are {len(defects.springs)} springs to draw from"
    for name, kind in study.causes.items():
        field = ("study", "causes", name)
        if name in study.sets:
            yield field, "S428 a set has this name too"
        for index, cause in enumerate(kind.named):
            if message := unknown("cause", cause, CAUSES):
                yield (*field, "named", index), message


def _end(study: TrustStudy, use: str) -> int:
    found = individuals(study.model_copy(update={"use": use}))
    return max((one.seed for one in found), default=0) + 1
