"""Studies of elastic fits, wernholt2008 and zimmermann2023: their sections, and their checks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from robid.arrays import option
from robid.frf.residual import EstimatorKind
from robid.models.elastic.fit.options import ElasticOptions, WeightsKind
from robid.robot.parameters import ElasticKind
from robid.settings.base import Name, Section
from robid.settings.checks.configurations import configuration_count
from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import given
from robid.settings.yaml import FieldPath
from robid.studies.experiments import Count, Positive, Problems, Whole, campaign_problem, entry, name_problems, unknown


@dataclass(frozen=True)
class StepOptions:
    """Short steps of one axis at a time, as fast as the motors allow."""

    configurations: int = option(5, "Random configurations in which every axis is stepped.", ge=1)
    seed: int = option(1, "Seed of the configurations.", ge=0)
    step_deg: float = option(1.0, "Size of a step, arm side [deg].", gt=0)
    step_m: float = option(0.01, "The same of prismatic joints [m].", gt=0)
    peak_motor_speed_rad_s: float = option(20.0, "Largest speed of any motor during a step [rad/s].", gt=0)
    torque_share: float = option(0.8, "Share of the torque limits that a step may need; feedback has the rest.", gt=0)
    shortest_ramp_s: float = option(0.1, "Shortest time in which a step reaches its speed [s].", gt=0)
    duration_s: float = option(1.0, "Time that is compared, from the beginning of a step [s].", gt=0)


class ModelChoice(Section):
    """The data of one model of a design study, and what it frees beyond the others."""

    configurations: tuple[Whole, ...] | None = entry(
        "Indices, from 0, of the campaigns' configurations; all when not given.", None, min_length=1
    )
    count: Count | None = entry("How many of these are taken; all when not given.", None)
    seed: Whole = entry("Seed of the draw that takes them.", 1)
    low_torque: Name | None = entry(
        "Name of the joint with whose smallest gravity torques they are taken, not drawn.", None
    )
    free: tuple[ElasticKind, ...] = entry("Kinds that it frees beside those of `fit`.", ())
    fixed: tuple[str, ...] = entry("Parameters that it fixes beside those of `fit`.", ())


class ZimmermannStudy(Section):
    """Models from few configurations, chosen in different ways, against the model from all of them."""

    kind: Literal["zimmermann2023"] = entry("What is studied.")
    estimation: tuple[Name, ...] = entry(
        "Names of simulated campaigns, one for each individual of the robot, in the same configurations.", min_length=1
    )
    validation: tuple[Name, ...] = entry(
        "Names of the campaigns that validate: the same individuals and configurations, in this order.", min_length=1
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
    reference: Name = entry("The model that has all configurations.", "m49")
    optimal: Name = entry("The model that has those of `design`.", "opt2")
    guess: Name = entry("The model that has those an engineer would choose.", "guess")
    nonlinear: Name | None = entry("The model whose gears stiffen, which explains the others' springs.", None)
    design: Name = entry("The design of the study.")
    steps: StepOptions = entry("Steps that compare the models in the time domain.", default_factory=StepOptions)
    stepped: tuple[Name, ...] = entry("Models that control the steps, the robot file beside.", ())
    paper: str | None = entry("File with the paper's figures, relative to this one.", None, min_length=1)


def check_zimmermann2023(study: ZimmermannStudy, experiment: Experiment, robot: RobotFile | None) -> Problems:
    """Yields the field and the message of everything that is wrong with a study of designs."""
    unusable: list[tuple[FieldPath, str]] = [
        (("study", key, index), message)
        for key, names in (("estimation", study.estimation), ("validation", study.validation))
        for index, name in enumerate(names)
        if (message := campaign_problem(experiment, name, "robot"))
    ]
    yield from unusable
    yield from _check_names(experiment, study, robot)
    if len(study.validation) != len(study.estimation):
        counts = f"{len(study.validation)} campaigns for the {len(study.estimation)} of `estimation`"
        yield ("study", "validation"), f"S391 has {counts}: one for each"
    elif not unusable:
        yield from _check_pairs(experiment, study)
    if not unusable:
        count = configuration_count(experiment, experiment.campaigns[study.estimation[0]])
        yield from _check_configurations(study, count)


def _check_pairs(experiment: Experiment, study: ZimmermannStudy) -> Problems:
    first = experiment.campaigns[study.estimation[0]]
    for key, names in (("estimation", study.estimation), ("validation", study.validation)):
        for index, name in enumerate(names):
            if experiment.campaigns[name].configurations != first.configurations:
                yield ("study", key, index), f"S392 `{name}` has other configurations than `{study.estimation[0]}`"
    for index, pair in enumerate(zip(study.estimation, study.validation, strict=True)):
        own, other = (given(given(experiment.campaigns[name].source).simulate) for name in pair)
        if own.truth != other.truth:
            message = f"S393 `{pair[1]}` simulates another individual than `{pair[0]}`: give both the same `truth`"
            yield ("study", "validation", index), message


def _check_names(experiment: Experiment, study: ZimmermannStudy, robot: RobotFile | None) -> Problems:
    if message := unknown("design", study.design, experiment.designs):
        yield ("study", "design"), message
    named: list[tuple[str, FieldPath, str | None]] = [
        *(("model", (key,), getattr(study, key)) for key in ("reference", "optimal", "guess", "nonlinear")),
        *(("model", ("stepped", index), name) for index, name in enumerate(study.stepped)),
    ]
    if robot is not None:
        named += [("joint", ("models", name, "low_torque"), one.low_torque) for name, one in study.models.items()]
        named += [("joint", ("axes", index), joint) for index, joint in enumerate(study.axes)]
    known = {"model": list(study.models), "joint": [] if robot is None else [joint.name for joint in robot.joints]}
    for kind, place, name in named:
        if name is not None and (message := unknown(kind, name, known[kind])):
            yield ("study", *place), message


def _check_configurations(study: ZimmermannStudy, n_conf: int | None) -> Problems:
    for name, model in study.models.items():
        field = ("study", "models", name)
        for index, chosen in enumerate(model.configurations or ()):
            if n_conf is not None and chosen >= n_conf:
                yield (*field, "configurations", index), f"S394 there are {n_conf} configurations, numbered from 0"
        there = n_conf if model.configurations is None else len(model.configurations)
        if model.count is not None and there is not None and model.count > there:
            yield (*field, "count"), f"S395 cannot take {model.count} of {there} configurations"


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
    estimators: dict[Name, EstimatorChoice] = entry("What is compared, by name.", min_length=1)
    reference: Name = entry("The estimator whose best model the others' parameters are divided by.", "lls15u")
    wide: tuple[Name, ...] = entry("Estimators that also start over `wide_decades`.", ())
    wide_decades: Positive = entry("Spread of these starts [decades].", 2.0)
    plain: bool = entry("Whether every start is also fitted with `strategy: plain`, as in the paper.", True)
    starts_per_task: Count = entry("Starts that are fitted in one go.", 25)
    individuals: tuple[Name, ...] = entry(
        "Names of further simulated campaigns, one for each individual of the robot, on which estimates"
        " from all configurations are held against the truth.",
        (),
    )
    individual_estimators: tuple[Name, ...] = entry(
        "Estimators that are held against them; all with all configurations when not given.", ()
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
    """Estimators that use one configuration alone."""
    return [
        (index, f"`{name}` does not use all configurations")
        for index, name in enumerate(names)
        if name in study.estimators and study.estimators[name].configurations != "all"
    ]
