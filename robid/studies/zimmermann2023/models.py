"""The campaigns of the study of configurations, its models, and how well each holds on all others."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.artifacts.artifact import Dataset
from robid.artifacts.kinds import DESIGN, design_from_artifact
from robid.artifacts.store import read_artifact
from robid.design.configurations.information import ConfigurationDesign
from robid.design.configurations.measured import measured_information
from robid.design.configurations.options import ALONG
from robid.frf.frf import Frf
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import make_problem
from robid.models.elastic.fit.solution import ElasticSolution, fitted_robot
from robid.models.elastic.fit.uncertainty import sandwich
from robid.models.elastic.judge.extrema import first_resonances
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.validating import weighted_costs
from robid.models.elastic.settings import model_settings
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.robot.rest import settle_springs
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s, plain_settings
from robid.settings.sources import true_robot_of
from robid.simulate.truth import with_imperfections
from robid.studies.experiments import excitations, paper_figures
from robid.studies.settings.study import ModelChoice, ZimmermannStudy
from robid.studies.simulated import measurements, played, read_responses, simulate_options, stated_std, threads_of
from robid.studies.study import Content, Earlier, Task, study_of


def chosen_designs(run: Run) -> dict[str, ConfigurationDesign]:
    """Returns the designs that the study's configurations come from, by name."""
    names = run.loaded.experiment.campaigns[study_of(run.loaded, ZimmermannStudy).estimation[0]].designs
    paths = {name: run.path(f"designs/{name}.h5") for name in names}
    return {name: design_from_artifact(read_artifact(path, DESIGN)) for name, path in paths.items()}


def campaigns(study: ZimmermannStudy) -> tuple[str, ...]:
    """Returns the campaigns of all pairs, each estimation before its validation, then those that are revisited."""
    paired = (name for pair in zip(study.estimation, study.validation, strict=True) for name in pair)
    return (*paired, *study.revisited)


def needs(loaded: LoadedExperiment) -> tuple[str, ...]:
    """Returns the outputs of the chain that the tasks read, once the paper's figures can be read."""
    paper_figures(loaded)
    return excitations(campaigns(study_of(loaded, ZimmermannStudy)))


@dataclass(frozen=True)
class Pair:
    """One individual: its two campaigns, and where the responses of all configurations lie."""

    estimation: str
    validation: str
    configurations: FloatArray
    estimation_paths: tuple[Path, ...]
    validation_paths: tuple[Path, ...]
    revisited_paths: tuple[Path, ...] = ()


def pairs(run: Run, earlier: Earlier) -> list[Pair]:
    """Returns the pairs of campaigns with the results of the first step."""
    study = study_of(run.loaded, ZimmermannStudy)
    left = list(earlier[0].paths)

    def taken(name: str) -> tuple[tuple[Path, ...], FloatArray]:
        """The paths of the next campaign, and its configurations."""
        configurations = played(run, name).configurations
        paths = tuple(left[: len(configurations)])
        del left[: len(configurations)]
        return paths, configurations

    found = []
    for names in zip(study.estimation, study.validation, strict=True):
        (own, configurations), (other, _) = taken(names[0]), taken(names[1])
        found.append(Pair(*names, configurations, own, other))
    again = [taken(name)[0] for name in study.revisited]
    return [replace(pair, revisited_paths=paths) for pair, paths in zip(found, again, strict=False)] + found[
        len(again) :
    ]


def response_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each campaign and configuration."""
    found: list[Task] = []
    for name in campaigns(study_of(run.loaded, ZimmermannStudy)):
        campaign = run.loaded.experiment.campaigns[name]
        options, content = simulate_options(campaign), played(run, name)
        found += measurements(run.loaded, campaign, options, content, name, threads_of(run))
    return found


_NOTHING_KNOWN = 1e9
_RESULT = 5  # Version of what a result holds


@dataclass(frozen=True)
class Fitting:
    """One model of one individual."""

    # The robot file's, with the payload of the estimation and with that of the validation
    robots: tuple[Robot, Robot]
    truth: Robot  # The true robot
    estimation: tuple[Path, ...]  # Where the responses to fit lie, of all configurations
    validation: tuple[Path, ...]  # Where those that validate lie; none of a model that is not judged
    used: tuple[int, ...]  # Indices of the configurations that the model is fitted to
    options: ElasticOptions  # Options of the fit
    delay_s: float  # Nominal delay [s]
    axes: tuple[str, ...]  # Joints whose first resonances are compared
    revisited: tuple[Path, ...] = ()  # Where responses lie of the same payload in the configurations of the estimation


def model_sets(study: ZimmermannStudy, torque: dict[str, FloatArray], n_conf: int) -> dict[str, tuple[int, ...]]:
    """Returns the configurations of every model, in rising order; gravity torques (n_conf,) [N m] are by joint."""
    return {name: model_set(choice, torque, n_conf) for name, choice in study.models.items()}


def model_set(choice: ModelChoice, torque: dict[str, FloatArray], n_conf: int) -> tuple[int, ...]:
    """Returns the configurations of one model, see `model_sets`."""
    pool = _pool(choice, n_conf)
    if choice.count is None:
        return tuple(sorted(pool.tolist()))
    if choice.low_torque is not None:
        taken = np.argsort(np.abs(torque[choice.low_torque][pool]), kind="stable")[: choice.count]
        return tuple(sorted(pool[taken].tolist()))
    return tuple(sorted(np.random.default_rng(choice.seed).choice(pool, choice.count, replace=False).tolist()))


def _pool(choice: ModelChoice, n_conf: int) -> IntArray:
    return np.arange(n_conf) if choice.configurations is None else np.array(choice.configurations)


def transmission_torque(robot: Robot, joint: str, configurations: FloatArray) -> FloatArray:
    """Torque (n_conf,) of gravity on the transmission of a joint [N m]."""
    index = [one.name for one in robot.joints].index(joint)
    spring = next(at for at, one in enumerate(robot.springs) if one.joint == index and one.place == "transmission")
    return solve_statics(build_model(robot), configurations).spring_torque[:, spring]


def options_of(study: ZimmermannStudy, choice: ModelChoice) -> ElasticOptions:
    """Returns the options of a model's fit."""
    free = tuple(dict.fromkeys((*study.fit.free, *choice.free)))
    return replace(study.fit, free=free, fixed=(*study.fit.fixed, *choice.fixed))


def model_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each individual and model."""
    study, found = study_of(run.loaded, ZimmermannStudy), list[Task]()
    asked = {choice.low_torque for choice in study.models.values() if choice.low_torque is not None}
    for number, pair in enumerate(pairs(run, earlier), 1):
        robot = run.loaded.robot.to_robot(run.loaded.experiment.campaigns[pair.estimation].payload_kg)
        torques = {name: transmission_torque(robot, name, pair.configurations) for name in asked}
        sets = model_sets(study, torques, len(pair.configurations))
        found += [model_task(run, study, pair, name, used, f"{name}_{number}") for name, used in sets.items()]
    return found


def model_task(
    run: Run, study: ZimmermannStudy, pair: Pair, name: str, used: tuple[int, ...], key: str, *, judged: bool = True
) -> Task:
    """One model of one individual; what is not judged has no validation."""
    own, other = (run.loaded.experiment.campaigns[each] for each in (pair.estimation, pair.validation))
    robots = run.loaded.robot.to_robot(own.payload_kg), run.loaded.robot.to_robot(other.payload_kg)
    simulated = simulate_options(own)
    true = true_robot_of(run.loaded.robot, own.payload_kg, simulated.truth)
    truth = with_imperfections(true, simulated.imperfections)
    settings = model_settings(run.loaded, pair.estimation), model_settings(run.loaded, pair.validation)
    options = options_of(study, study.models[name])
    validation = pair.validation_paths if judged else ()
    revisited = pair.revisited_paths if judged and name == study.reference else ()
    decides = {
        "estimation": [pair.estimation_paths[index].name for index in used],
        "validation": [path.name for path in validation],
        "options": plain_settings(options),
        "settings": settings,
        "axes": study.axes,
        "source": plain_settings(own.source),
        "result": _RESULT,
    }
    if revisited:
        decides["revisited"] = [path.name for path in revisited]
    if "cubic" in options.free:
        decides["slopes"] = [path.name for path in pair.estimation_paths]
    paths = pair.estimation_paths, validation
    delay = delay_s(run.loaded, own)
    return Task(key, decides, (Fitting(robots, truth, *paths, used, options, delay, study.axes, revisited),))


def fit_model(one: Fitting) -> Content:
    """Fits a model and, where it is judged, holds it against the validation's responses."""
    frf = read_responses([one.estimation[index] for index in one.used])
    solution = fit_elastic(one.robots[0], frf, one.options, one.delay_s)
    datasets = fitted_parameters(one, solution)
    if one.validation:
        datasets |= {**_deviations(one, frf, solution), **_judgement(one, solution)}
        datasets["used"] = Dataset(np.array(one.used), "1", ("used",), "Configurations of the fit")
        if one.revisited:
            again = _judgement(replace(one, validation=one.revisited), solution)["cost"]
            datasets["revisited_cost"] = replace(again, axes=("place",))
        if "cubic" in one.options.free:
            every = read_responses(one.estimation)
            model, parameters = fitted_model(one.robots[0], solution, every, one.options, one.delay_s).linear
            slopes = settle_springs(model.rest, parameters.springs).stiffness
            axes = ("configuration", "spring")
            datasets["slope"] = Dataset(slopes, "N m/rad", axes, "Slope under gravity and excitation")
    return Content(datasets, {"status": solution.estimate.status, "misfit": solution.misfit})


def fitted_parameters(one: Fitting, solution: ElasticSolution) -> dict[str, Dataset]:
    """Returns what a fit found, beside the truth."""
    parameter, spring = ("parameter",), ("spring",)
    found = solution.estimate
    both = found, replace(found, value=found.middle)
    springs, middles = (fitted_robot(one.robots[0], each).springs for each in both)
    by_name = {each.name: each for each in one.truth.springs}
    true, cubic = zip(*((by_name[each.name].stiffness, by_name[each.name].cubic) for each in springs), strict=True)
    own, middle = (np.array([each.stiffness for each in some]) for some in (springs, middles))
    deviation = stated_std(found.lower, found.upper, found.confidence)
    predicting = stated_std(*found.effective_interval, found.confidence)
    return {
        "names": Dataset(np.array(found.names), "1", parameter),
        "nominal": Dataset(found.nominal, "SI", parameter, "Values of the robot file"),
        "estimate": Dataset(found.value, "SI", parameter, "Estimated values"),
        "fit_std": Dataset(deviation, "1", parameter, "Deviation of the logarithm that the fit's interval states"),
        "effective_std": Dataset(predicting, "1", parameter, "The same of what infinitely many configurations give"),
        "springs": Dataset(np.array([each.name for each in springs]), "1", spring),
        "stiffness": Dataset(own, "N m/rad", spring),
        "physical_stiffness": Dataset(middle, "N m/rad", spring, "Middle of the interval of each itself"),
        "true_stiffness": Dataset(np.array(true), "N m/rad", spring),
        "true_cubic": Dataset(np.array(cubic), "N m/rad^3", spring),
    }


def _deviations(one: Fitting, frf: Frf, solution: ElasticSolution) -> dict[str, Dataset]:
    robot = fitted_robot(one.robots[0], solution.estimate)
    fixed = [name for name in one.options.fixed if name.endswith((".stiffness", ".viscous", ".motor_inertia"))]
    along = tuple(kind for kind in one.options.free if kind in ALONG)
    matrices, names = measured_information(robot, frf, one.delay_s, kinds=("stiffness",), nuisance=along, fixed=fixed)
    variance = np.diag(np.linalg.inv(matrices.sum(axis=0)))
    if "cubic" in one.options.free:
        # Where all free parameters are estimated along, weights optimal.
        weights = replace(one.options.weights, kind="optimal_full")
        options = replace(one.options, weights=weights, estimator="lls", prior_decades=_NOTHING_KNOWN)
        fitted = fitted_model(one.robots[0], solution, frf, options, one.delay_s)
        covariance = sandwich(fitted.problem, fitted.internal)
        variance = np.diag(covariance)[[fitted.problem.parameters.names.index(name) for name in names]]
    square = ("configuration", "wanted", "other wanted")
    return {
        "wanted": Dataset(np.array(names), "1", ("wanted",), "Springs whose deviations follow"),
        "std": Dataset(np.sqrt(variance), "1", ("wanted",), "Relative deviation, by the total covariance"),
        "information": Dataset(matrices, "1", square, "About the springs' logarithms, nuisances eliminated"),
    }


def _judgement(one: Fitting, solution: ElasticSolution) -> dict[str, Dataset]:
    frf = read_responses(one.validation)
    options = replace(one.options, estimator="llsm", weights=replace(one.options.weights, kind="user"))
    fitted = fitted_model(one.robots[1], solution, frf, options, one.delay_s)
    # Weights of the measured response, the same for all models, a motor's own response at 1.
    problem, dropped = make_problem(frf, fitted.problem.model, fitted.problem.parameters, options)
    fitted = replace(fitted, problem=problem, dropped=dropped)
    costs = weighted_costs(one.robots[1], fitted)
    per_element = 1 / (problem.weight.max() * costs.elements)
    measured_hz, model_hz = first_resonances(fitted, one.axes)
    places = [(frf.output_names.index(name), frf.input_names.index(name)) for name in one.axes]
    configuration, resonance = ("configuration",), ("configuration", "axis")
    curve, unit = ("configuration", "frequency", "axis"), frf.unit

    def own(values: FloatArray | ComplexArray) -> FloatArray:
        return np.stack([np.abs(values[..., row, column]) for row, column in places], axis=-1)

    return {
        "cost": Dataset(costs.cost * per_element, "1", configuration, "Weighted log-amplitude error per element"),
        "expected": Dataset(costs.expected_cost * per_element, "1", configuration, "What noise alone gives"),
        "measured_hz": Dataset(measured_hz, "Hz", resonance, "First resonance of each axis' own response"),
        "model_hz": Dataset(model_hz, "Hz", resonance, "The model's"),
        "frequency_hz": Dataset(frf.frequency_hz, "Hz", ("frequency",)),
        "measured": Dataset(own(fitted.measured), unit, curve, "Magnitude of each axis' own response"),
        "deviation": Dataset(own(np.sqrt(frf.element_variance())), unit, curve, "Its standard deviation"),
        "modelled": Dataset(own(costs.modelled), unit, curve, "The model's"),
    }


_FURTHER = 1  # keeps the draw of further sets apart from that of the first


def further_sets(choice: ModelChoice, n_conf: int) -> tuple[tuple[int, ...], ...]:
    """Returns as many further sets of configurations as a drawn model's pool has that share none."""
    if choice.count is None or choice.low_torque is not None:
        return ()
    left = np.setdiff1d(_pool(choice, n_conf), model_set(choice, {}, n_conf))
    left = np.random.default_rng([choice.seed, _FURTHER]).permutation(left)
    count = choice.count
    return tuple(tuple(sorted(left[at : at + count].tolist())) for at in range(0, left.size - count + 1, count))


def set_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each individual and further set of each drawn model, in the order of `owners_of_sets`."""
    study = study_of(run.loaded, ZimmermannStudy)
    return [
        model_task(run, study, pair, name, used, f"{name}_{number}_{further}", judged=False)
        for number, pair in enumerate(pairs(run, earlier), 1)
        for name, choice in _with_sets(study).items()
        for further, used in enumerate(further_sets(choice, len(pair.configurations)), 2)
    ]


def owners_of_sets(study: ZimmermannStudy, n_conf: int) -> list[str]:
    """Returns the model of each further set of one individual, in the order of its tasks."""
    return [name for name, choice in _with_sets(study).items() for _ in further_sets(choice, n_conf)]


def _with_sets(study: ZimmermannStudy) -> dict[str, ModelChoice]:
    """The models that have further sets: the first one of each pool, whose sets take all of it."""
    first: dict[object, str] = {}
    for name, choice in study.models.items():
        first.setdefault((choice.configurations, choice.count), name)
    return {name: study.models[name] for name in first.values()}
