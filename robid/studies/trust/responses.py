"""The two machines of the study of trust, and the places in which each robot is measured, one task each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from robid.arrays import FloatArray
from robid.design.excitation.excitation import CampaignExcitation
from robid.pipeline.configurations import draw_in_reach
from robid.pipeline.graph import Run
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.studies.experiments import Further, Problems, changed_simulation, run_of
from robid.studies.settings.trust import TrustStudy
from robid.studies.simulated import measurements, played, threads_of
from robid.studies.study import Earlier, study_of
from robid.studies.tasks import Results, Task
from robid.studies.trust.individuals import Individual, individuals, robot_problems

RANDOM, FRESH, DESIGNED = "random", "fresh", "designed"
"""What places are for: the fit, the reference, the fit in places that a design chose."""


@dataclass(frozen=True)
class Places:
    """A campaign that a robot is measured with, in places of its own."""

    use: str
    owner: str
    campaign: Campaign
    content: CampaignExcitation


@dataclass(frozen=True)
class Machine:
    """One of the two kinds of robot, in a run folder of its own."""

    run: Run
    places: dict[str, Places]

    @property
    def loaded(self) -> LoadedExperiment:
        """Its experiment and robot file."""
        return self.run.loaded

    def places_of(self, one: Individual, use: str) -> Places:
        """Returns a campaign in the places of a robot: drawn for it, but for those that a design chose."""
        places = self.places[use]
        if use == DESIGNED:
            return places
        configurations = self._drawn(places.campaign, len(places.content.configurations), one.seed, use)
        return replace(places, content=replace(places.content, configurations=configurations))

    def _drawn(self, campaign: Campaign, count: int, seed: int, use: str) -> FloatArray:
        stated = None if campaign.configurations is None else campaign.configurations.random
        if stated is None:
            message = "the settings' checks let a campaign without random configurations pass"
            raise RuntimeError(message)
        wanted = stated.model_copy(update={"count": count, "seed": 2 * seed + (use == FRESH)})
        return draw_in_reach(self.loaded, self.loaded.robot.to_robot(campaign.payload_kg), wanted)


def campaigns_of(loaded: LoadedExperiment, study: TrustStudy) -> dict[str, str]:
    """Returns the names of an experiment's campaigns by what they are for."""
    fit = loaded.experiment.fits[study.fit]
    named = {RANDOM: fit.campaign, FRESH: str(fit.validate_on)}
    return named if study.designed is None else {**named, DESIGNED: study.designed}


def needs(loaded: LoadedExperiment, study: TrustStudy | None = None) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read."""
    names = campaigns_of(loaded, study or study_of(loaded, TrustStudy))
    return tuple(f"{name}/excitation.h5" for name in names.values())


def further(run: Run) -> Further:
    """Returns the light robot's experiment, whose chain must be there, with the outputs that the tasks read."""
    study = study_of(run.loaded, TrustStudy)
    return tuple((one, needs(one.loaded, study)) for name, one in _runs(run, study).items() if name == "light")


def machines(run: Run) -> dict[str, Machine]:
    """Returns the two kinds of robot by name, once their chains are there."""
    study = study_of(run.loaded, TrustStudy)
    return {
        name: Machine(
            one,
            {
                use: Places(use, owner, one.loaded.experiment.campaigns[owner], played(one, owner))
                for use, owner in campaigns_of(one.loaded, study).items()
            },
        )
        for name, one in _runs(run, study).items()
    }


def _runs(run: Run, study: TrustStudy) -> dict[str, Run]:
    if study.light is None:
        return {"heavy": run}

    def problems(loaded: LoadedExperiment) -> Problems:
        return robot_problems(study, "light", loaded.experiment, loaded.robot)

    return {"heavy": run, "light": run_of(run, study.light, "light", problems)}


_NOISE = (RANDOM, FRESH, DESIGNED)  # each has noise of its own


def simulated(run: Run) -> list[Individual]:
    """Returns the robots that are simulated."""
    return [one for one in individuals(study_of(run.loaded, TrustStudy)) if one.kind != "linear"]


def response_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each place of each robot that is simulated."""
    study, known, found = study_of(run.loaded, TrustStudy), machines(run), list[Task]()
    for one in simulated(run):
        machine = known[one.robot]
        for use, count in uses(one, study, machine):
            places = machine.places_of(one, use)
            noise = len(_NOISE) * one.seed + _NOISE.index(use)
            options = changed_simulation(places.campaign, one.physics, one.seed, noise)
            content = replace(places.content, configurations=places.content.configurations[:count])
            name = f"{one.key}_{use}"
            found += measurements(machine.loaded, places.campaign, options, content, name, threads_of(run))
    return found


def uses(one: Individual, study: TrustStudy, machine: Machine) -> Iterator[tuple[str, int | None]]:
    """Yields what a robot's places are for, and how many of them are measured; None is all."""
    if one.kind == "cause":
        yield RANDOM, study.cause_places
        return
    yield RANDOM, None
    yield FRESH, None if one.referenced else study.validated_in
    if one.referenced and DESIGNED in machine.places:
        yield DESIGNED, None


def files_of(results: Results, one: Individual, use: str) -> tuple[Path, ...]:
    """Returns where the responses of a robot lie, place by place."""
    prefix = f"{one.key}_{use}_"
    found = {path.name.split(".")[0]: path for path in results.paths if path.name.startswith(prefix)}
    return tuple(found[f"{prefix}{number}"] for number in range(1, len(found) + 1))
