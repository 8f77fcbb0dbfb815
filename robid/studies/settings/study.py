"""What the study section of an experiment file may be, and its checks; those of responses and of fleets in full."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args, get_type_hints

from pydantic import Field

from robid.frf.options import EstimateOptions
from robid.models.known import load_experiment
from robid.settings.base import Name, Section
from robid.settings.checks.experiment import Studies
from robid.settings.experiment import Experiment
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.studies.experiments import Count, Positive, Problems, Whole, campaign_problem, entry, name_problems, unknown
from robid.studies.settings.elastic import WernholtStudy, ZimmermannStudy, check_wernholt2008, check_zimmermann2023
from robid.studies.settings.mistakes import MistakesStudy, check_mistakes
from robid.studies.settings.parts import (
    JanotStudy,
    OliveiraStudy,
    TurkStudy,
    check_janot2009,
    check_oliveira2019,
    check_turk2018,
)
from robid.studies.settings.trust import TrustStudy, check_trust


class FrfStudy(Section):
    """Estimators against the best linear approximation, and what compensation leaves of the bias."""

    kind: Literal["frf"] = entry("What is studied.")
    campaign: Name = entry("Name of the simulated campaign whose realizations it divides into groups.")
    group: int = entry("Realizations of one estimate.", 4, ge=2)
    groups_per_task: Count = entry("Groups that are simulated at once.", 5)
    estimators: tuple[str, ...] | None = entry(
        "Values of `estimate.estimator` to compare; all when not given.", None, min_length=1
    )
    compensations: tuple[str, ...] | None = entry(
        "Values of `estimate.compensation` to compare; all when not given.", None, min_length=1
    )
    reference_estimator: str = entry(
        "Estimator of the best linear approximation, from all realizations of a task.", "joint"
    )
    references: dict[str, float] = entry(
        "Figures to hold ours against, by their name in summary.json.", default_factory=dict
    )


def choices(option: Literal["estimator", "compensation"]) -> tuple[str, ...]:
    """Returns the values that an option of the estimate may have; `auto` is one of the others, chosen by the data."""
    hint = get_type_hints(EstimateOptions)[option]
    names = [name for member in (hint, *get_args(hint)) for name in get_args(member)]
    return tuple(name for name in names if isinstance(name, str) and name != "auto")


def check_frf_study(study: FrfStudy, experiment: Experiment, _robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of estimators of responses."""
    if message := campaign_problem(experiment, name := study.campaign):
        yield ("study", "campaign"), message
    else:
        campaign = experiment.campaigns[name]
        if campaign.estimate.friction_fit is not None:
            what = "is a fit's, which this study does not compare: name another one"
            yield ("study", "campaign"), f"S417 the friction of `{name}` {what}"
        if campaign.realizations % study.group or campaign.realizations < 2 * study.group:
            what = f"the {campaign.realizations} realizations of `{name}` into groups, two or more"
            yield ("study", "group"), f"S418 does not divide {what}"
    yield from _check_names(study)


def _check_names(study: FrfStudy) -> Problems:
    for key, known, named in (
        ("estimators", choices("estimator"), study.estimators or ()),
        ("compensations", choices("compensation"), study.compensations or ()),
    ):
        yield from ((("study", key, index), message) for index, message in name_problems(named, known))
    if message := unknown("", study.reference_estimator, choices("estimator")):
        yield ("study", "reference_estimator"), message


class FleetFaults(Section):
    """What is wrong with some of the robots: six kinds, as many robots of each."""

    each: Whole = entry("Robots of each kind.", 5)
    seed: Whole = entry("Seed of which robots these are, and of what is wrong where.", 1)
    stiffness_factor: Positive = entry(
        "`spring`: true stiffness of a joint's transmission over that of a sound one.", 0.7
    )
    payload_kg: Positive = entry("`payload`: what is mounted beyond what the manifest says [kg].", 5.0)
    lost_samples: tuple[int, int] = entry(
        "`gap`: fewest and most samples that are lost inside an experiment.", (3, 200)
    )


class FleetSpeed(Section):
    """How the speed of `robid reprocess` is measured: backends in turn, again and again."""

    rows: int = entry("Rows of each run, all of sound robots.", 100, ge=3)
    repeats: Count = entry("Runs of each backend.", 5)


class FleetStudy(Section):
    """Logs of many simulated robots, some with faults, through `robid reprocess`."""

    kind: Literal["fleet"] = entry("What is studied.")
    campaign: Name = entry("Name of the simulated campaign that is logged of each robot.")
    experiment: str = entry(
        "Experiment file, relative to this one, that reads these logs: its rows have `id`, `log` and `payload_kg`.",
        min_length=1,
    )
    robots: Count = entry("Number of robots.", 1000)
    robots_per_task: Count = entry("Robots that are simulated in one go.", 10)
    first_seed: Whole = entry("Seed of the first robot and its noise; the others follow.", 1)
    faults: FleetFaults = entry("What is wrong with some of them.", default_factory=FleetFaults)
    speed: FleetSpeed | None = entry("How speed is measured; not at all when null.", default_factory=FleetSpeed)
    scheduled: Whole = entry(
        "Rows without work that a local Dask cluster is fed with, to see what it bears; 0 leaves it out.", 0
    )


KINDS = ("spring", "sign", "dead", "gap", "payload", "file")
"""Kinds of faults: a softened spring, a wrong sign, a dead channel, lost samples, a wrong payload, a damaged file."""


def check_fleet(study: FleetStudy, experiment: Experiment, _robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of fleets."""
    if message := campaign_problem(experiment, study.campaign):
        yield ("study", "campaign"), message
    sound = study.robots - len(KINDS) * study.faults.each
    if sound < 0:
        yield ("study", "faults", "each"), f"S419 makes {study.robots - sound} robots with a fault, of {study.robots}"
    elif study.speed is not None and study.speed.rows > sound:
        yield ("study", "speed", "rows"), f"S420 must be of sound robots, of which there are {sound}"
    fewest, most = study.faults.lost_samples
    if not 0 < fewest <= most:
        yield ("study", "faults", "lost_samples"), "S421 must rise from a number above 0"


Study: TypeAlias = Annotated[
    FrfStudy
    | WernholtStudy
    | ZimmermannStudy
    | MistakesStudy
    | JanotStudy
    | OliveiraStudy
    | TurkStudy
    | TrustStudy
    | FleetStudy,
    Field(discriminator="kind"),
]


_CHECKS: Mapping[str, Callable[[Any, Experiment, RobotFile | None], Problems]] = {
    "frf": check_frf_study,
    "wernholt2008": check_wernholt2008,
    "zimmermann2023": check_zimmermann2023,
    "mistakes": check_mistakes,
    "janot2009": check_janot2009,
    "oliveira2019": check_oliveira2019,
    "turk2018": check_turk2018,
    "trust": check_trust,
    "fleet": check_fleet,
}


def load_with_study(path: Path) -> LoadedExperiment:
    """Loads an experiment file and the robot file it names, and checks both, with the study where there is one.

    Raises:
        SettingsError: With every problem of both files, each with its line and field.
    """
    return load_experiment(path, studies=Studies(Study, _check_study))


def _check_study(experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields what is wrong with the study, if there is one; the robot file is None where it could not be read."""
    study = experiment.study
    if study is not None:
        yield from _CHECKS[study.kind](study, experiment, robot)
