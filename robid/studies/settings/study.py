"""What the study section of an experiment file may be, and its checks; those of responses, elastic fits and fleets."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args, get_type_hints

from pydantic import Field

from robid.arrays import option
from robid.frf.options import EstimateOptions
from robid.frf.residual import EstimatorKind
from robid.models.elastic.fit.options import ElasticOptions, WeightsKind
from robid.models.known import load_experiment
from robid.robot.parameters import ElasticKind
from robid.settings.base import Name, Place, Section
from robid.settings.checks.configurations import configuration_count
from robid.settings.checks.experiment import Studies
from robid.settings.experiment import Experiment
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import given
from robid.settings.yaml import FieldPath
from robid.studies.experiments import Count, Positive, Problems, Whole, campaign_problem, entry, name_problems, unknown
from robid.studies.settings import parts
from robid.studies.settings.defects import MistakesStudy, check_mistakes
from robid.studies.settings.encoders import EncodersStudy, check_encoders
from robid.studies.settings.responses import ResponsesStudy
from robid.studies.settings.rough import RoughStudy, check_rough
from robid.studies.settings.trust import TrustStudy, check_trust


@dataclass(frozen=True)
class StepOptions:
    """Short steps of one axis at a time, as fast as the motors allow."""

    configurations: int = option(5, "Random configurations in which every axis is stepped.", ge=1, le=10_000)
    seed: int = option(1, "Seed of the configurations.", ge=0)
    step_deg: float = option(1.0, "Size of a step, arm side [deg].", gt=0)
    step_m: float = option(0.01, "The same of prismatic joints [m].", gt=0)
    peak_motor_speed_rad_s: float = option(20.0, "Largest speed of any motor during a step [rad/s].", gt=0)
    torque_share: float = option(0.8, "Share of the torque limits that a step may need; feedback has the rest.", gt=0)
    shortest_ramp_s: float = option(0.1, "Shortest time in which a step reaches its speed [s].", gt=0)
    duration_s: float = option(1.0, "Time that is compared, from the beginning of a step [s].", gt=0)


class ModelChoice(Section):
    """The data of one model of a design study, and what it frees beyond the others."""

    configurations: tuple[Place, ...] | None = entry(
        "Numbers, from 1, of the campaigns' configurations; all when not given.", None, min_length=1
    )
    count: Count | None = entry("How many of these are taken; all when not given.", None)
    seed: Whole = entry("Seed of the draw that takes them.", 1)
    low_torque: Name | None = entry(
        "Name of a joint. The configurations with its smallest gravity torques are taken, not drawn.", None
    )
    free: tuple[ElasticKind, ...] = entry("Kinds that it estimates in addition to those of `fit`.", ())
    fixed: tuple[str, ...] = entry("Parameters that it fixes in addition to those of `fit`.", ())


class ZimmermannStudy(Section):
    """Models from few configurations, chosen in different ways, against the model from all of them."""

    kind: Literal["zimmermann2023"] = entry("What is studied.")
    estimation: tuple[Name, ...] = entry(
        "Names of simulated campaigns, one for each individual of the robot, in the same configurations.", min_length=1
    )
    validation: tuple[Name, ...] = entry(
        "Names of the campaigns that validate: the same individuals in this order, all in the same configurations, best"
        " ones that no model has used.",
        min_length=1,
    )
    revisited: tuple[Name, ...] = entry(
        "Campaigns that repeat the first validations in the configurations of the estimation, where the reference is"
        " judged beside.",
        (),
    )
    fit: ElasticOptions = entry(
        "Options that all fits share.",
        default_factory=lambda: ElasticOptions(free=("stiffness", "viscous"), estimator="lls"),
    )
    models: dict[Name, ModelChoice] = entry("The models, by name.", min_length=1)
    axes: tuple[Name, ...] = entry(
        "Joints by whose first resonance, of the motor's own response, the models are judged.",
        ("axis_2", "axis_3"),
        min_length=1,
    )
    reference: Name = entry("The model with all configurations.", "m49")
    optimal: Name = entry("The model with the configurations of `design`.", "opt2")
    predictive: Name | None = entry(
        "The model with configurations chosen for prediction, which is compared with random sets of as many.", None
    )
    guess: Name = entry("The model with the configurations that an engineer would choose.", "guess")
    nonlinear: Name | None = entry("The model whose gears stiffen, which explains the others' springs.", None)
    design: Name = entry("The design of the study.")
    steps: StepOptions = entry("Steps that compare the models in the time domain.", default_factory=StepOptions)
    stepped: tuple[Name, ...] = entry("Models that control the steps, in addition to the robot file.", ())
    paper: str | None = entry("File with the paper's figures, relative to this one.", None, min_length=1)


def check_zimmermann2023(study: ZimmermannStudy, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of designs."""
    unusable: list[tuple[FieldPath, str]] = [
        (("study", key, index), message)
        for key in ("estimation", "validation", "revisited")
        for index, name in enumerate(getattr(study, key))
        if (message := campaign_problem(experiment, name, "robot"))
    ]
    yield from unusable
    yield from _check_names(experiment, study, robot)
    if len(study.validation) != len(study.estimation):
        counts = f"{len(study.validation)} campaigns for the {len(study.estimation)} of `estimation`"
        yield ("study", "validation"), f"S391 has {counts}: one for each"
    elif len(study.revisited) > len(study.estimation):
        counts = f"{len(study.revisited)} campaigns for the {len(study.estimation)} of `estimation`"
        yield ("study", "revisited"), f"S607 has {counts}: one for each of the first ones"
    elif not unusable:
        yield from _check_pairs(experiment, study)
    if not unusable:
        count = configuration_count(experiment, experiment.campaigns[study.estimation[0]])
        for name, model in study.models.items():
            field = ("study", "models", name)
            for index, chosen in enumerate(model.configurations or ()):
                if count is not None and chosen >= count:
                    yield (*field, "configurations", index), f"S394 {experiment.numbered(count)}"
            there = count if model.configurations is None else len(model.configurations)
            if model.count is not None and there is not None and model.count > there:
                yield (*field, "count"), f"S395 cannot take {model.count} of {there} configurations"


def _check_pairs(experiment: Experiment, study: ZimmermannStudy) -> Problems:
    like = {"estimation": study.estimation[0], "validation": study.validation[0], "revisited": study.estimation[0]}
    for key, first in like.items():
        for index, name in enumerate(getattr(study, key)):
            if experiment.campaigns[name].configurations != experiment.campaigns[first].configurations:
                yield ("study", key, index), f"S392 `{name}` has other configurations than `{first}`"
    for key in ("validation", "revisited"):
        for index, pair in enumerate(zip(study.estimation, getattr(study, key), strict=False)):
            own, other = (given(given(experiment.campaigns[name].source).simulate) for name in pair)
            if own.truth != other.truth:
                message = f"S393 `{pair[1]}` simulates another individual than `{pair[0]}`: give both the same `truth`"
                yield ("study", key, index), message


_NAMED = ("reference", "optimal", "predictive", "guess", "nonlinear")
"""Settings of the study of designs that name a model."""


def _check_names(experiment: Experiment, study: ZimmermannStudy, robot: RobotFile | None) -> Problems:
    if message := unknown("design", study.design, experiment.designs):
        yield ("study", "design"), message
    named: list[tuple[str, FieldPath, str | None]] = [
        *(("model", (key,), getattr(study, key)) for key in _NAMED),
        *(("model", ("stepped", index), name) for index, name in enumerate(study.stepped)),
    ]
    if robot is not None:
        named += [("joint", ("models", name, "low_torque"), one.low_torque) for name, one in study.models.items()]
        named += [("joint", ("axes", index), joint) for index, joint in enumerate(study.axes)]
    known = {"model": list(study.models), "joint": [] if robot is None else [joint.name for joint in robot.joints]}
    for kind, place, name in named:
        if name is not None and (message := unknown(kind, name, known[kind])):
            yield ("study", *place), message


class EstimatorChoice(Section):
    """One estimator of the parameters."""

    estimator: EstimatorKind = entry("As in a fit.")
    weights: WeightsKind = entry("As `kind` in the weights of a fit.", "user")
    configurations: Literal["all", "best"] = entry("All, or the one with the smallest predicted covariance.", "all")


class WernholtStudy(Section):
    """Estimators of springs and dampers by the models that they reach from many starts."""

    kind: Literal["wernholt2008"] = entry("What is studied.")
    campaign: Name = entry("Name of the simulated campaign whose responses are fitted.")
    fit: ElasticOptions = entry(
        "Options that all estimators share: free parameters, starts, strategy. All starts are random, the"
        " same for all estimators.",
        default_factory=lambda: ElasticOptions(free=("stiffness", "damping"), correct_torques=False, starts=100),
    )
    estimators: dict[Name, EstimatorChoice] = entry("Estimators to compare, by name.", min_length=1)
    reference: Name = entry("Estimator whose best model divides the parameters of the others.", "lls15u")
    wide: tuple[Name, ...] = entry("Estimators that also start over `wide_decades`.", ())
    wide_decades: Positive = entry("Spread of these starts [decades].", 2.0)
    plain: bool = entry("Whether every start is also fitted with `strategy: plain`, as in the paper.", True)
    starts_per_task: Count = entry("Starts fitted in one task.", 25)
    individuals: tuple[Name, ...] = entry(
        "Names of further simulated campaigns, one for each individual of the robot. The study compares "
        "estimates from all configurations with the truth there.",
        (),
    )
    individual_estimators: tuple[Name, ...] = entry(
        "Estimators of this comparison; all with all configurations when not given.", ()
    )
    individual_starts: Count = entry("Starts of each of these fits, the robot file's values the first one.", 3)
    element: tuple[int, int] = entry(
        "Numbers, from 1, of the output and the input of the response that is drawn.", (1, 1)
    )
    paper: str | None = entry("File with the paper's figures, relative to this one.", None, min_length=1)


def check_wernholt2008(study: WernholtStudy, experiment: Experiment, _robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of parameter estimators."""
    if message := campaign_problem(experiment, study.campaign):
        yield ("study", "campaign"), message
    problems = dict(name_problems(study.individuals, study.individuals))
    campaigns = {index: campaign_problem(experiment, name) for index, name in enumerate(study.individuals)}
    problems |= {index: message for index, message in campaigns.items() if message}
    yield from ((("study", "individuals", index), message) for index, message in problems.items())
    if found := [
        *name_problems((study.reference,), list(study.estimators)),
        *_one_configuration(study, (study.reference,)),
    ]:
        yield ("study", "reference"), found[0][1]
    for key, names in (("wide", study.wide), ("individual_estimators", study.individual_estimators)):
        found = name_problems(names, list(study.estimators))
        if key != "wide":
            found += _one_configuration(study, names)
        yield from ((("study", key, index), message) for index, message in found)


def _one_configuration(study: WernholtStudy, names: tuple[str, ...]) -> list[tuple[int, str]]:
    return [
        (index, f"`{name}` does not use all configurations")
        for index, name in enumerate(names)
        if name in study.estimators and study.estimators[name].configurations != "all"
    ]


class FrfStudy(Section):
    """Estimators against the best linear approximation, and what compensation leaves of the bias."""

    kind: Literal["frf"] = entry("What is studied.")
    campaign: Name = entry("Name of the simulated campaign whose realizations it divides into groups.")
    group: int = entry("Realizations of one estimate.", 4, ge=2, le=10_000)
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
        "Figures to compare with, by their name in summary.json.", default_factory=dict
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
    seed: Whole = entry("Seed of the choice of these robots and of the place of their faults.", 1)
    stiffness_factor: Positive = entry(
        "`spring`: true stiffness of a joint's transmission over that of a sound one.", 0.7
    )
    payload_kg: Positive = entry("`payload`: additional mass beyond the manifest's [kg].", 5.0)
    lost_samples: tuple[int, int] = entry("`gap`: fewest and most samples lost inside an experiment.", (3, 200))


class FleetSpeed(Section):
    """How the speed of `robid reprocess` is measured: backends in turn, again and again."""

    rows: int = entry("Rows of each run, all of sound robots.", 100, ge=3, le=1_000_000)
    repeats: Count = entry("Runs of each backend.", 5)


class FleetStudy(Section):
    """Logs of many simulated robots, some with faults, through `robid reprocess`."""

    kind: Literal["fleet"] = entry("What is studied.")
    campaign: Name = entry("Name of the simulated campaign of which each robot has a log.")
    experiment: str = entry(
        "Experiment file, relative to this one, that reads these logs: its rows have `id`, `log` and `payload_kg`.",
        min_length=1,
    )
    robots: Count = entry("Number of robots.", 1000)
    robots_per_task: Count = entry("Robots simulated in one task.", 10)
    first_seed: Whole = entry("Seed of the first robot and its noise; the others follow.", 1)
    faults: FleetFaults = entry("Faults of some of them.", default_factory=FleetFaults)
    speed: FleetSpeed | None = entry("Measurement of speed; none when null.", default_factory=FleetSpeed)
    scheduled: Whole = entry("Rows without work for a local Dask cluster, to measure its limit; 0 leaves it out.", 0)


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
    | parts.JanotStudy
    | parts.OliveiraStudy
    | ResponsesStudy
    | parts.TurkStudy
    | TrustStudy
    | RoughStudy
    | EncodersStudy
    | FleetStudy,
    Field(discriminator="kind"),
]


_CHECKS: Mapping[str, Callable[[Any, Experiment, RobotFile | None], Problems]] = {
    "frf": check_frf_study,
    "wernholt2008": check_wernholt2008,
    "zimmermann2023": check_zimmermann2023,
    "mistakes": check_mistakes,
    "janot2009": parts.check_janot2009,
    "oliveira2019": parts.check_oliveira2019,
    "turk2018": parts.check_turk2018,
    "trust": check_trust,
    "rough": check_rough,
    "encoders": check_encoders,
    "fleet": check_fleet,
    "responses": lambda _study, _experiment, _robot: iter(()),
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
