"""The study of trust: its section of an experiment file, the robots that it describes, and its checks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from pydantic import model_validator

from robid.results.finding import CAUSES
from robid.settings.base import Name, Section
from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import SpringSection
from robid.settings.yaml import FieldPath
from robid.studies.experiments import (
    Count,
    Positive,
    Problems,
    Whole,
    campaign_problem,
    entry,
    fit_problem,
    physics_problems,
    unknown,
)
from robid.studies.settings.defects import Physics
from robid.studies.settings.singles import (
    OF_SPRINGS,
    SINGLE,
    SIZES,
    SingleDefects,
    check_single,
    every_physics,
    single_physics,
)


class Defects(Physics):
    """What the robots of a set have and their model lacks, each in sizes of its own."""

    robot: Literal["heavy", "light"] = entry("Robots of the set: this file's or those of `light`.", "heavy")
    springs: tuple[SpringSection, ...] = entry("Springs that the robot file lacks, from which each robot has some.", ())
    springs_each: Whole = entry("Number of these of each robot, drawn without replacement.", 0)
    size_factor: float = entry(
        "Sizes of these imperfections, and stiffness and damping of the springs, are multiplied log-uniformly "
        "by up to this factor.",
        1.5,
        ge=1,
    )
    listed: bool = entry(
        "Whether nuisance parameters describe these defects, so that intervals must contain the true springs.", False
    )
    robots: Count = entry("Number of robots.")
    referenced: Whole = entry(
        "How many of them, the first ones, are measured in fresh and in designed configurations too.", 0
    )


class LinearRobots(Section):
    """Robots with exact responses plus noise, in as many random configurations as the others."""

    drawn: Whole = entry("Robots whose nuisance parameters are drawn from their priors.", 40)
    file: Whole = entry("Robots that agree with their file except for springs and dampers.", 10)
    relative_noise: Positive = entry(
        "Standard deviation of an element's noise over the median response of its output.", 0.01
    )


class CauseKind(Physics):
    """A defect that the tool is to name."""

    named: tuple[str, ...] = entry(
        "Causes that count as right: several where they cannot be distinguished.", min_length=1
    )


class TrustSeeds(Section):
    """Seeds of true robots, configurations and noise, consecutive over all robots of the study."""

    first: Whole = entry("The first seed.")
    robots: Count | None = entry("At most as many robots of each set and kind; all when not given.", None)


class TrustSeedChoice(Section):
    """Two disjoint sets of seeds: everything is chosen with one, the stated figures come from the other."""

    judge: TrustSeeds = entry("Seeds of the stated figures.")
    choose: TrustSeeds = entry("Seeds for all choices.")


_PARTS = ("causes", "linear", "single")


class TrustStudy(Section):
    """Whether intervals hold, on robots whose defects their model does not contain."""

    kind: Literal["trust"] = entry("What is studied.")
    fit: Name = entry(
        "Name of the fit: its campaign has the random configurations of a robot, the one to validate on the"
        " fresh ones of the reference. Each robot's configurations are drawn anew."
    )
    designed: Name | None = entry(
        "Name of the campaign in designed configurations, which all robots share; none when not given.", None
    )
    validated_in: Count = entry("Fresh configurations, the first ones, in which every robot is validated.", 4)
    light: str | None = entry(
        "Experiment file, relative to this one, of a light robot, fit and campaigns named alike.", None, min_length=1
    )
    sets: dict[Name, Defects] = entry("The sets of robots, by name.", default_factory=dict)
    linear: LinearRobots | None = entry("Linear robots; none when not given.", None)
    causes: dict[Name, CauseKind] = entry("Defects that should be named, by name.", default_factory=dict)
    cause_robots: Count = entry("Robots of each of these.", 5)
    cause_places: Count = entry("Random configurations, the first ones, in which these are measured.", 4)
    single: SingleDefects | None = entry("Set C: robots with one defect each, and sound ones.", None)
    only: tuple[Name, ...] | None = entry(
        "Parts of the study: names of sets, `causes`, `linear`, `single`; all when not given. Seeds begin anew.",
        None,
        min_length=1,
    )
    seeds: TrustSeedChoice = entry("Seeds of the robots.")
    use: Literal["judge", "choose"] = entry("Which of the seeds are used.", "judge")

    @model_validator(mode="before")
    @classmethod
    def _leave_out(cls, data: Any) -> Any:  # noqa: ANN401
        """A part of the study is a study that says nothing of the others."""
        if not isinstance(data, dict):
            return data
        only, sets = data.get("only"), data.get("sets", {})
        if not isinstance(only, list | tuple) or not isinstance(sets, dict):
            return data
        known = [*sets, *(name for name in _PARTS if name in data)]
        for name in only:
            if message := unknown("part", name, known):
                raise ValueError(message)
        left = {key: value for key, value in data.items() if key not in _PARTS or key in only}
        return {**left, "sets": {key: value for key, value in sets.items() if key in only}}

    @property
    def chosen(self) -> TrustSeeds:
        """The seeds that are used."""
        return self.seeds.judge if self.use == "judge" else self.seeds.choose


_DEFECT_DRAWS = 2  # keeps these draws apart from those of springs and masses
LINEAR, FILE = "linear", "linear_file"
"""Names of the linear robots: those whose nuisance parameters are drawn, and those that are as their file says."""


@dataclass(frozen=True)
class Individual:
    """One robot of the study."""

    group: str  # Name of its set, of its cause, or one of the linear robots
    kind: str  # `set`, `cause`, `linear` or `single`
    robot: str  # `heavy` or `light`
    seed: int  # Seed of its truth, its defects, its configurations and its noise
    physics: Mapping[str, Any]  # What is simulated otherwise than the campaigns say: `imperfections` and `truth`
    referenced: bool = False  # Whether it is measured in fresh and designed configurations too

    @property
    def key(self) -> str:
        """A name that no other robot has."""
        return f"{self.group}_{self.seed}"


def individuals(study: TrustStudy) -> list[Individual]:
    """Returns all robots: of the sets, of the causes, linear ones, those of set C; each has a seed of its own."""
    limit, seed = study.chosen.robots, study.chosen.first
    found: list[Individual] = []
    for name, kind, wanted, defects in _groups(study):
        count = wanted if limit is None else min(wanted, limit)
        for number, own in enumerate(range(seed, seed + count)):
            referenced = kind == "set" and number < defects.referenced
            found.append(Individual(name, kind, defects.robot, own, drawn_physics(defects, own), referenced))
        seed += count
    return [*found, *_single_individuals(study, seed)]


def _single_individuals(study: TrustStudy, seed: int) -> Iterator[Individual]:
    """The robots of set C, from a seed on."""
    if study.single is None:
        return
    for name, counts in study.single.groups.items():
        kinds = counts.turns()[: study.chosen.robots]
        for number, own in enumerate(range(seed, seed + len(kinds))):
            physics = single_physics(study.single, name, number, own)
            yield Individual(name, "single", kinds[number], own, physics)
        seed += len(kinds)


def _groups(study: TrustStudy) -> Iterator[tuple[str, str, int, Defects]]:
    """Robots of one kind each: their name, their kind, how many there are, and what their model lacks."""
    for name, defects in study.sets.items():
        yield name, "set", defects.robots, defects
    for name, cause in study.causes.items():
        physics, count = {"imperfections": cause.imperfections, "truth": cause.truth}, study.cause_robots
        yield name, "cause", count, Defects(**physics, size_factor=1.0, robots=count)
    for name, count in () if study.linear is None else ((LINEAR, study.linear.drawn), (FILE, study.linear.file)):
        yield name, "linear", count, Defects(robots=max(count, 1))


def drawn_physics(defects: Defects, seed: int) -> dict[str, Any]:
    """Returns the imperfections and the truth of one robot, its sizes and springs drawn."""
    generator = np.random.default_rng([seed, _DEFECT_DRAWS])

    def factor() -> float:
        return float(np.exp(np.log(defects.size_factor) * generator.uniform(-1, 1)))

    sizes = dict(defects.imperfections)
    sizes |= {key: value * factor() for key, value in sizes.items() if key in SIZES and isinstance(value, int | float)}
    chosen = np.sort(generator.permutation(len(defects.springs))[: defects.springs_each])
    springs = []
    for spring in (defects.springs[index] for index in chosen.tolist()):
        plain = spring.model_dump(mode="json", exclude_none=True)
        share = factor()
        springs.append({**plain, **{key: plain[key] * share for key in OF_SPRINGS if key in plain}})
    truth = {**defects.truth, **({"springs": springs} if springs else {})}
    return {key: value for key, value in (("imperfections", sizes), ("truth", truth)) if value}


def check_trust(study: TrustStudy, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of trust."""
    yield from trusted_problems(study, "heavy", experiment, robot)
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
    if study.single is not None:
        yield from check_single(study.single, light=study.light is not None)
        if SINGLE in study.sets:
            yield ("study", "sets", SINGLE), f"S519 the robots of `single` are set `{SINGLE}`: choose another name"
    both = [individuals(study.model_copy(update={"use": use})) for use in ("judge", "choose")]
    ends = [max((one.seed for one in found), default=0) + 1 for found in both]
    if max(study.seeds.judge.first, study.seeds.choose.first) < min(ends):
        yield ("study", "seeds"), "S422 the seeds of `judge` and `choose` overlap"


def trusted_problems(study: TrustStudy, name: str, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields why an experiment cannot be that of the study's robot `heavy` or `light`.

    Its campaigns may not fit, or sets and causes may name what its robot or its simulation does not have.
    """
    told = list(_campaign_problems(experiment, study))
    yield from told
    if told:
        return
    campaign, seen = experiment.campaigns[experiment.fits[study.fit].campaign], set[str]()
    for one in individuals(study):
        if one.robot == name and one.kind in ("set", "cause") and one.group not in seen:
            seen.add(one.group)
            field: FieldPath = ("study", "sets" if one.kind == "set" else "causes", one.group)
            found = physics_problems(campaign, one.physics, robot)
            yield from (((*field, *place), message) for place, message in found)
    for field, physics in () if study.single is None else every_physics(study.single, name):
        found = physics_problems(campaign, physics, robot)
        yield from (((*field, *place), message) for place, message in found)


def _campaign_problems(experiment: Experiment, study: TrustStudy) -> Problems:
    if message := fit_problem(experiment, study.fit):
        yield ("study", "fit"), message
        return
    fit = experiment.fits[study.fit]
    for name, least in ((fit.campaign, 1), (str(fit.validate_on), study.validated_in)):
        chosen = experiment.campaigns[name].configurations
        if chosen is None or chosen.random is None:
            message = f"S423 campaign `{name}` needs `random` configurations: each robot's are drawn anew"
            yield ("study", "fit"), message
        elif chosen.random.count < least:
            yield ("study", "validated_in"), f"S424 campaign `{name}` has {chosen.random.count} configurations only"
    if study.designed is not None and (message := campaign_problem(experiment, study.designed, "robot")):
        yield ("study", "designed"), message
