"""The study of trust: its two machines, and the places in which each robot is measured."""

from __future__ import annotations

from dataclasses import dataclass, replace

from robid.arrays import FloatArray
from robid.artifacts.kinds import EXCITATION, excitation_from_artifact
from robid.artifacts.store import read_artifact
from robid.design.excitation.excitation import CampaignExcitation
from robid.errors import SettingsError
from robid.models.files import load_experiment
from robid.pipeline import Run
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.problems import format_field
from robid.stages.configurations import draw_in_reach
from robid.studies.settings.trust import TrustStudy
from robid.studies.trust.check import experiment_problems, physics_problems
from robid.studies.trust.individuals import Individual

RANDOM, FRESH, DESIGNED = "random", "fresh", "designed"
"""What places are for: the fit, the reference, the fit in places that a design chose."""


@dataclass(frozen=True)
class Places:
    """A campaign that a robot is measured with, in places of its own.

    Attributes:
        use: `random`, `fresh` or `designed`.
        owner: Name of the campaign.
        campaign: The campaign.
        content: Its excitation and configurations.
    """

    use: str
    owner: str
    campaign: Campaign
    content: CampaignExcitation


@dataclass(frozen=True)
class Machine:
    """One of the two kinds of robot, in a run folder of its own.

    Attributes:
        run: Its experiment.
        places: Its campaigns by what they are for, with the configurations of their settings.
    """

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


def study_of(loaded: LoadedExperiment) -> TrustStudy:
    """Returns the study of an experiment that has one of this kind."""
    study = loaded.experiment.study
    if not isinstance(study, TrustStudy):
        message = "the study is of another kind"
        raise TypeError(message)
    return study


def campaigns_of(loaded: LoadedExperiment, study: TrustStudy) -> dict[str, str]:
    """Returns the names of an experiment's campaigns by what they are for."""
    fit = loaded.experiment.fits[study.fit]
    named = {RANDOM: fit.campaign, FRESH: str(fit.validate_on)}
    return named if study.designed is None else {**named, DESIGNED: study.designed}


def needs(loaded: LoadedExperiment, study: TrustStudy | None = None) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read."""
    names = campaigns_of(loaded, study or study_of(loaded))
    return tuple(f"{name}/excitation.h5" for name in names.values())


def further(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns the light robot's experiment, whose chain must be there, with the outputs that the tasks read."""
    study = study_of(run.loaded)
    if study.light is None:
        return ()
    light = _light_run(run, study, study.light)
    return ((light, needs(light.loaded, study)),)


def machines(run: Run) -> dict[str, Machine]:
    """Returns the two kinds of robot by name, once their chains are there."""
    study = study_of(run.loaded)
    runs = {"heavy": run}
    if study.light is not None:
        runs["light"] = _light_run(run, study, study.light)
    return {name: Machine(one, _places(one, study)) for name, one in runs.items()}


def _places(run: Run, study: TrustStudy) -> dict[str, Places]:
    found = {}
    for use, owner in campaigns_of(run.loaded, study).items():
        content = excitation_from_artifact(read_artifact(run.path(f"{owner}/excitation.h5"), EXCITATION))
        found[use] = Places(use, owner, run.loaded.experiment.campaigns[owner], content)
    return found


def _light_run(run: Run, study: TrustStudy, name: str) -> Run:
    loaded = load_experiment(run.loaded.path.parent / name)
    told = [
        f"{format_field(('study', *place))}: {what}" for place, what in experiment_problems(loaded.experiment, study)
    ]
    if not told:
        campaign = loaded.experiment.campaigns[campaigns_of(loaded, study)[RANDOM]]
        found = physics_problems(study, "light", campaign, loaded.robot)
        told = [f"{format_field(field)}: {what}" for field, what in found]
    if told:
        raise SettingsError("; ".join(told), where=str(loaded.path), remedy="correct the file, or the study's sets")
    return replace(run, loaded=loaded, folder=run.folder / "light")
