"""The experiments that studies read: their own and others beside it, what both must have, and the paper's figures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Any, TypeAlias

from pydantic import Field, ValidationError

from robid.errors import SettingsError
from robid.models.known import load_experiment
from robid.pipeline.graph import Run
from robid.settings.checks.campaigns import check_truth
from robid.settings.experiment import Campaign, Experiment, Source
from robid.settings.load import LoadedExperiment
from robid.settings.problems import format_field, suggest
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import given
from robid.settings.sources import SimulateSettings
from robid.settings.yaml import FieldPath, load_yaml

Whole = Annotated[int, Field(ge=0, le=1_000_000)]
Count = Annotated[int, Field(ge=1, le=1_000_000)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


def entry(description: str, *default: Any, **more: Any) -> Any:  # noqa: ANN401
    """Declares a field of a section: what it says, its default where it has one, and what `Field` takes besides."""
    return Field(*default, description=description, **more)


Problems: TypeAlias = Iterator[tuple[FieldPath, str]]  # Fields of a file, each with what is wrong with it

Further: TypeAlias = tuple[tuple[Run, tuple[str, ...]], ...]
"""Runs of other experiments, each with outputs of its chain."""


def paper_figures(loaded: LoadedExperiment) -> dict[str, Any]:
    """Returns the figures of the paper that a study redraws, or nothing where it names no file.

    Raises:
        SettingsError: If the file cannot be read.
    """
    name: str | None = loaded.experiment.study.paper
    return {} if name is None else load_yaml(loaded.path.parent / name).data


def run_of(
    run: Run,
    experiment: str,
    folder: str,
    problems: Callable[[LoadedExperiment], Iterable[tuple[FieldPath, str]]] = lambda _loaded: (),
) -> Run:
    """Returns the run of another experiment file in a folder of the study's own.

    Raises:
        SettingsError: If there is such a thing.
    """
    loaded = load_experiment(run.loaded.path.parent / experiment)
    if told := [f"S341 {format_field(field)}: {what}" for field, what in problems(loaded)]:
        raise SettingsError("; ".join(told), where=str(loaded.path), remedy="correct the file, or the study")
    return replace(run, loaded=loaded, folder=run.folder / folder)


def both_runs(run: Run, light: str | None, problems: Callable[[LoadedExperiment], Problems]) -> dict[str, Run]:
    """Returns the study's run as `heavy`, and that of the `light` robot's experiment where there is one."""
    return {"heavy": run} if light is None else {"heavy": run, "light": run_of(run, light, "light", problems)}


def excitations(campaigns: Iterable[str]) -> tuple[str, ...]:
    """Returns where the chain leaves what campaigns play."""
    return tuple(f"{name}/excitation.h5" for name in campaigns)


def fit_outputs(fit: str) -> tuple[str, str]:
    """Returns where the chain leaves a fit, and its validation."""
    return f"fits/{fit}/model.h5", f"fits/{fit}/validation.h5"


def missing_log(run: Run) -> str:
    """Name of the first log of a run that is not there; empty when all are."""
    sources = (campaign.source for campaign in run.loaded.experiment.campaigns.values())
    logs = (one.acquire.log_path(run.loaded.path.parent) for one in sources if one is not None and one.acquire)
    return next((path.name for path in logs if not path.exists()), "")


def unknown(what: str, name: str, known: Iterable[str]) -> str:
    """Says that something of a name is not there, and what is; empty when it is there."""
    known = list(known)
    return "" if name in known else f"there is no {what and what + ' '}`{name}`; {suggest(name, known)}"


def campaign_problem(experiment: Experiment, name: str, what: str = "response") -> str:
    """Says why a campaign cannot be studied: it is not there, or its truth is not known; empty when it can be."""
    campaign = experiment.campaigns.get(name)
    if campaign is None:
        return unknown("campaign", name, experiment.campaigns)
    simulated = campaign.source is not None and campaign.source.simulate is not None
    return "" if simulated else f"S389 campaign `{name}` is not simulated, so its true {what} is not known"


def fit_problem(experiment: Experiment, name: str) -> str:
    """Says why a fit cannot be studied: it is not there, or its robot's truth is not known."""
    fit = experiment.fits.get(name)
    if fit is None:
        return unknown("fit", name, experiment.fits)
    if fit.validate_on is None or len(fit.campaigns) > 1 or fit.configurations is not None:
        return f"fit `{name}` needs one campaign with all its configurations, and one to `validate_on`"
    problems = (campaign_problem(experiment, each, "robot") for each in (fit.campaign, str(fit.validate_on)))
    return next((problem for problem in problems if problem), "")


def family_problem(experiment: Experiment, name: str, family: str, *, validated: bool) -> str:
    """Says why a fit is none of a family, with a campaign to validate on where one is needed; empty when it is."""
    fit = experiment.fits.get(name)
    if fit is None:
        return unknown("fit", name, experiment.fits)
    if fit.family != family:
        return f"fit `{name}` is of the family `{fit.family}`, not `{family}`"
    return f"fit `{name}` names no campaign in `validate_on`" if validated and fit.validate_on is None else ""


def name_problems(names: Sequence[str], known: Sequence[str], what: str = "") -> list[tuple[int, str]]:
    """Returns what is wrong with a list of names, each with its index: unknown ones, and those that are there twice."""
    twice = (f"`{name}` is there twice" if name in names[:index] else "" for index, name in enumerate(names))
    said = (unknown(what, name, known) or again for name, again in zip(names, twice, strict=True))
    return [(index, message) for index, message in enumerate(said) if message]


def changed_simulation(
    campaign: Campaign, physics: Mapping[str, Any], seed: int | None = None, noise: int = 0
) -> SimulateSettings:
    """Returns how a campaign is simulated with changed imperfections and another truth.

    With a `seed` of the true robot `noise` is the seed of the noise; without one both are the campaign's.

    Raises:
        ValidationError: If there is no such option, or its value is not allowed.
    """
    plain = given(campaign.source).model_dump(mode="json")["simulate"]
    for key in ("imperfections", "truth"):
        changed = physics.get(key) or {}
        plain[key] = {**plain[key], **changed} if isinstance(changed, dict) else plain[key]
    if seed is not None:
        plain["truth"]["seed"], plain["seed"] = seed, noise
    return given(Source.model_validate({"simulate": plain}).simulate)


def physics_problems(campaign: Campaign, physics: Mapping[str, Any], robot: RobotFile | None) -> Problems:
    """Yields what `physics` names that a campaign's simulation, or the robot where it could be read, does not have."""
    try:
        changed = changed_simulation(campaign, physics)
    except ValidationError as error:
        yield from (((*each["loc"][1:3],), each["msg"]) for each in error.errors())
        return
    if robot is not None:
        yield from check_truth((), campaign, changed, robot)
