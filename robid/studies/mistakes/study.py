"""The study of mistakes: its robots, and the cases that are made of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from robid.artifacts.artifact import canonical_hash
from robid.errors import SettingsError
from robid.models.files import load_experiment
from robid.pipeline import Run
from robid.settings.load import LoadedExperiment
from robid.settings.problems import format_field
from robid.settings.robot_parts import plain_settings
from robid.studies.mistakes.check import fit_problem, mistake_problems
from robid.studies.settings.study import Mistake, MistakesStudy

SOUND = "sound"
"""Name of a robot with which nothing is wrong."""


@dataclass(frozen=True)
class Subject:
    """One of the two robots: its experiment in a run folder of its own.

    Attributes:
        name: `heavy` or `light`.
        run: Its experiment.
        sound: Seeds of its sound individuals.
    """

    name: str
    run: Run
    sound: range

    @property
    def loaded(self) -> LoadedExperiment:
        """Its experiment and robot file."""
        return self.run.loaded


@dataclass(frozen=True)
class Case:
    """One mistake, or none, with one individual.

    Attributes:
        name: Name of the mistake, or `sound`.
        mistake: What is wrong; nothing where it is a sound one.
        subject: Whose robot.
        seed: Seed of the individual.
    """

    name: str
    mistake: Mistake
    subject: Subject
    seed: int

    @property
    def key(self) -> str:
        """A name that no other case has."""
        return f"{self.name}_{self.subject.name}_{self.seed}"

    @property
    def simulation(self) -> str:
        """Name of what is simulated for it, shared with the cases that reuse the record."""
        physics = self.mistake.physics
        of = f"physics_{canonical_hash(physics)[:8]}" if physics else SOUND
        return f"{of}_{self.subject.name}_{self.seed}"

    @property
    def response(self) -> str:
        """Name of its response among those of one simulation, shared with the cases that read the record alike."""
        return f"response_{canonical_hash(read_with(self.mistake))[:8]}"


def study_of(loaded: LoadedExperiment) -> MistakesStudy:
    """Returns the study of an experiment that has one of this kind."""
    study = loaded.experiment.study
    if not isinstance(study, MistakesStudy):
        message = "the study is of another kind"
        raise TypeError(message)
    return study


def campaigns_of(loaded: LoadedExperiment, fit: str) -> dict[str, str]:
    """Returns the names of the campaigns that a fit is fitted to and validated on."""
    chosen = loaded.experiment.fits[fit]
    if chosen.validate_on is None:
        message = "the settings' checks let a fit without validation pass"
        raise RuntimeError(message)
    return {"estimation": chosen.campaign, "validation": chosen.validate_on}


def needs(loaded: LoadedExperiment, fit: str | None = None) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read."""
    if fit is None and not study_of(loaded).makes_mistakes:
        return ()
    names = campaigns_of(loaded, fit or study_of(loaded).fit)
    return tuple(f"{name}/excitation.h5" for name in names.values())


def subjects(run: Run) -> dict[str, Subject]:
    """Returns the robots of the study, the light one in a folder below."""
    study = study_of(run.loaded)
    seeds = study.chosen
    found = {"heavy": Subject("heavy", run, range(seeds.first, seeds.first + seeds.heavy))}
    if study.light is not None:
        loaded = _light(run.loaded, study, study.light)
        sound = range(seeds.first, seeds.first + seeds.light)
        found["light"] = Subject("light", replace(run, loaded=loaded, folder=run.folder / "light"), sound)
    return found


def further(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns the other experiments whose chains must be there, with the outputs that the tasks read."""
    study = study_of(run.loaded)
    if not study.makes_mistakes:
        return ()
    return tuple((one.run, needs(one.loaded, study.fit)) for name, one in subjects(run).items() if name != "heavy")


def _light(loaded: LoadedExperiment, study: MistakesStudy, name: str) -> LoadedExperiment:
    light = load_experiment(loaded.path.parent / name)
    problems = [fit_problem(light.experiment, study.fit)]
    for key, mistake in study.mistakes.items():
        if mistake.robot == "light":
            found = mistake_problems(mistake, light.experiment, study.fit, light.robot)
            problems += [f"{format_field(('study', 'mistakes', key, *field))}: {what}" for field, what in found]
    told = [problem for problem in problems if problem]
    if told:
        raise SettingsError("; ".join(told), where=str(light.path), remedy="correct the file, or the study's mistakes")
    return light


def cases(run: Run) -> list[Case]:
    """Returns every case: the sound individuals, then each mistake with the first of them."""
    study = study_of(run.loaded)
    if not study.makes_mistakes:
        return []
    robots = subjects(run)
    nothing = Mistake()
    found = [Case(SOUND, nothing, robot, seed) for robot in robots.values() for seed in robot.sound]
    seeds = range(study.chosen.first, study.chosen.first + study.chosen.mistakes)
    for name, mistake in study.mistakes.items():
        found += [Case(name, mistake, robots[mistake.robot], seed) for seed in seeds]
    return found


def read_with(mistake: Mistake) -> dict[str, Any]:
    """Returns what of a mistake decides its response beyond what is simulated."""
    keys = ("torque_factor", "angle_factor", "swapped", "delay_samples", "gear_ratio_factor", "friction_factor")
    return {key: plain_settings(getattr(mistake, key)) for key in keys}
