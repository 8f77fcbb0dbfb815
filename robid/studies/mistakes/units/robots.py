"""The robots whose logs are read, and the individuals that are simulated of each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from pydantic import ValidationError

from robid.errors import SettingsError
from robid.models.files import load_experiment
from robid.pipeline.graph import Run
from robid.settings.load import LoadedExperiment
from robid.settings.problems import format_field
from robid.settings.yaml import FieldPath
from robid.studies.changed import changed_simulation
from robid.studies.mistakes.check import fit_problem
from robid.studies.mistakes.study import campaigns_of, study_of
from robid.studies.settings.study import MistakesStudy
from robid.studies.settings.unit_mistakes import UnitRobot


@dataclass(frozen=True)
class UnitSubject:
    """One of the robots: its experiment in a run folder of its own."""

    name: str
    run: Run
    settings: UnitRobot

    @property
    def campaigns(self) -> dict[str, str]:
        """Names of the campaigns that its fit is fitted to and validated on."""
        return campaigns_of(self.run.loaded, self.settings.fit)


@dataclass(frozen=True)
class Individual:
    """One true robot, whose logs are read.

    Attributes:
        robot: Name of its robot.
        seed: Seed of its truth and its noise.
        number: Which of its robot's it is, from 0.
        rough: Whether its logs are sound and its robot file is rough; else its logs are read in wrong units.
    """

    robot: str
    seed: int
    number: int
    rough: bool

    @property
    def key(self) -> str:
        """A name that no other has."""
        return f"{self.robot}_{'rough' if self.rough else 'units'}_{self.seed}"

    def physics(self, settings: UnitRobot) -> Mapping[str, Any]:
        """Returns what is simulated otherwise than its campaigns say."""
        return settings.variants[self.number % len(settings.variants)].model_dump()

    def joint(self, n_joint: int) -> int:
        """Returns the joint of a mistake of one joint alone."""
        return self.seed % n_joint


def unit_subjects(run: Run) -> dict[str, UnitSubject]:
    """Returns the robots whose logs are read, each in a folder below."""
    study = study_of(run.loaded)
    if study.units is None or not study.reads_units:
        return {}
    return {name: _subject(run, study, name, settings) for name, settings in study.units.chosen.items()}


def individuals(study: MistakesStudy) -> list[Individual]:
    """Returns all individuals: for each robot those whose logs are read in wrong units, then those of rough files."""
    if study.units is None or not study.reads_units:
        return []
    seeds = study.chosen
    counts = {False: seeds.units, True: seeds.rough}
    return [
        Individual(robot, seeds.first + number, number, rough)
        for robot in study.units.chosen
        for rough, count in counts.items()
        for number in range(count)
    ]


def needed_by_units(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns the experiments of the robots, with the outputs of their chains that the tasks read."""
    return tuple(
        (one.run, tuple(f"{owner}/excitation.h5" for owner in one.campaigns.values()))
        for one in unit_subjects(run).values()
    )


def _subject(run: Run, study: MistakesStudy, name: str, settings: UnitRobot) -> UnitSubject:
    loaded = load_experiment(run.loaded.path.parent / settings.experiment)
    told = [f"{format_field(field)}: {what}" for field, what in _problems(loaded, study, name, settings)]
    if told:
        raise SettingsError("; ".join(told), where=str(loaded.path), remedy="correct the file, or the study's `units`")
    return UnitSubject(name, replace(run, loaded=loaded, folder=run.folder / "units" / name), settings)


def _problems(
    loaded: LoadedExperiment, study: MistakesStudy, name: str, settings: UnitRobot
) -> Iterator[tuple[FieldPath, str]]:
    """Yields what a robot's experiment lacks."""
    place: FieldPath = ("study", "units", "robots", name)
    problem = fit_problem(loaded.experiment, settings.fit)
    if problem:
        yield (*place, "fit"), problem
        return
    campaigns = [loaded.experiment.campaigns[one] for one in campaigns_of(loaded, settings.fit).values()]
    mistakes = {} if study.units is None else study.units.mistakes
    read = {signal for one in mistakes.values() for signal in one.log.get(name, settings.log)} | set(settings.log)
    arms = {f"{joint.name}.arm" for joint in loaded.robot.joints}
    if "arm" in read and any(not arms <= set(campaign.outputs) for campaign in campaigns):
        yield (*place, "log"), f"the campaigns' `outputs` lack {', '.join(sorted(arms))}"
    for index, variant in enumerate(settings.variants):
        try:
            changed_simulation(campaigns[0], variant.model_dump())
        except ValidationError as error:
            for each in error.errors():
                yield (*place, "variants", index, *each["loc"][1:3]), each["msg"]
