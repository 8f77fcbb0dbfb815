"""The elastic family's fit and validation: settings and artifacts in, artifacts out; true values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.artifacts.results import START, estimate_from_artifact, grade_from_artifact, outcome_from_artifact
from robid.errors import DataError
from robid.models.elastic.files import model_of, solution_from_artifact, validation_from_artifact, validation_of
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.known_gears import with_known_gears
from robid.models.elastic.fit.nuisance.effects import MICRO, PerturbedRobot
from robid.models.elastic.fit.nuisance.moves import with_estimated_springs
from robid.models.elastic.fit.nuisance.wording import options_of
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.elastic.fit.uncertainty import bootstrap_tasks
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.fitted import FittedModel, fitted_model
from robid.models.elastic.judge.power import detectable_defects
from robid.models.elastic.judge.resonances import tabulate_resonances
from robid.models.elastic.judge.validating import validate_elastic
from robid.models.elastic.kept_starts import count_ended, resuming_map
from robid.models.elastic.settings import elastic_fit
from robid.models.family import Data, Work
from robid.models.handed_on import RigidSource, gears_of, rigid_source
from robid.results.finding import blamed
from robid.results.outcome import recovery_sentence
from robid.results.plausible.findings import data_findings
from robid.robot.description import HarmonicBalance, Joint, Robot
from robid.robot.in_line import with_chains
from robid.robot.linearize import axial_inertia
from robid.robot.model import build_model
from robid.settings.experiment import Campaign, payload_kg
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s
from robid.simulate.options import Imperfections
from robid.simulate.truth import TrueRobot


def fit(data: Data, work: Work) -> Artifact:
    """Fits an elastic model and grades it by itself."""
    return _fitted(data, work, None)


def refit(data: Data, model: Artifact, work: Work) -> Artifact:
    """Goes on from the minimum of a model, with what the data's experiment now frees."""
    solution = solution_from_artifact(model)
    return _fitted(data, work, dict(zip(solution.estimate.names, solution.internal.values.tolist(), strict=True)))


def _fitted(data: Data, work: Work, near: Mapping[str, float] | None) -> Artifact:
    settings, campaign = elastic_fit(data.loaded.experiment, data.name), _campaign(data)
    repeated = bootstrap_tasks(settings.bootstrap)
    kept = None if work.kept is None or near is not None else work.kept(START)
    unit = "tasks" if repeated else "starts"
    work.progress.expect(settings.starts + repeated, unit, done=count_ended(kept, settings.starts))
    robot, delay = _robot(data, campaign), delay_s(data.loaded, campaign)
    perturbed = _perturbed(data, campaign)
    try:
        solution = fit_elastic(
            robot, data.response, settings.options(), delay, resuming_map(work, kept), perturbed, near
        )
    except DataError as error:
        raise blamed(error, data_findings(robot, data.response, delay)) from error
    work.progress.expect(0, "intervals and findings")
    given = data.response, settings.options(), delay
    solution = replace(solution, detectable=detectable_defects(robot, solution, *given))
    fitted = robot, solution, *given
    return model_of(solution, assess_fit(*fitted), tabulate_resonances(*fitted))


def model_at(data: Data, solution: ElasticSolution, campaign: str) -> FittedModel:
    """Evaluates a fit's model in the configurations of a response, with the payload of the campaign that it is of.

    Raises:
        DataError: If the data and the model do not belong together.
    """
    robot, options, delay = _given(data, campaign)
    return fitted_model(robot, solution, data.response, options, delay)


def _given(data: Data, campaign: str) -> tuple[Robot, ElasticOptions, float]:
    """What a model is evaluated with on the response of a campaign: robot, options, and the fit's nominal delay [s]."""
    robot = _robot(data, data.loaded.experiment.campaigns[campaign])
    options = elastic_fit(data.loaded.experiment, data.name).options()
    return robot, options_of(robot, options), delay_s(data.loaded, _campaign(data))


def validate(data: Data, model: Artifact, true: TrueRobot | None) -> Artifact:
    """Holds an elastic model against a response that it never saw, and against the true robot where it is known."""
    settings = elastic_fit(data.loaded.experiment, data.name)
    robot, options, delay = _given(data, settings.validate_on or settings.campaign)
    fitted = robot, solution_from_artifact(model), data.response, options, delay
    validation = validate_elastic(
        *fitted,
        None if true is None else dict(values_in(data.loaded, data.name, true)),
        grade_from_artifact(model).findings,
        str(settings.validate_on),
    )
    return validation_of(validation, tabulate_resonances(*fitted))


def values_in(loaded: LoadedExperiment, name: str, true: TrueRobot) -> dict[str, float]:
    """Returns the true value of every parameter of a fit."""
    campaign = loaded.experiment.campaigns[loaded.experiment.fits[name].campaign]
    return true_values(loaded.robot.to_robot(campaign.payload_kg), true)


def phrase_of_model(model: Artifact) -> str:
    """Says how the fit ended, in a phrase, from its artifact."""
    solution = solution_from_artifact(model)
    best = int(np.sum(solution.starts.minimum == 0))
    estimate = solution.estimate
    found, every = estimate.count
    identified = f"{found} of {_counted(every, 'parameter')} identified"
    known = int(np.sum(estimate.known_beforehand & estimate.of_model))
    identified += f" ({known} more known beforehand)" if known else ""
    expected = float(solution.costs.expected.sum())
    ratio = (
        f", {solution.costs.configuration.sum() / expected:.3g} times what noise alone gives" if expected > 0 else ""
    )
    used = solution.starts.evaluations
    effort = f", {np.median(used):.0f} evaluations each, at most {used.max()}" if used.size else ""
    if solution.starts.cap_share:
        effort += f", {solution.starts.cap_share:.0%} at the iteration limit"
    return (
        f"{estimate.status}, {identified},"
        f" cost {solution.costs.total:.4g}{ratio},"
        f" {best} of {_counted(len(solution.starts.cost), 'start')} at the best minimum{effort}"
    )


def misfits(model: Artifact, validation: Artifact | None) -> dict[str, float]:
    """Cost over what noise and the assumed model error allow, of the fit and of its validation."""
    found = {"misfit": solution_from_artifact(model).misfit}
    if validation is not None:
        found["misfit of the validation"] = validation_from_artifact(validation).cost_ratio
    return found


def verdict_of_validation(validation: Artifact) -> str:
    """Says whether the model holds, from its artifact."""
    outcome = outcome_from_artifact(validation)
    known = recovery_sentence(outcome.recovery)
    return f"{outcome.verdict}. {known}" if known else outcome.verdict


def _campaign(data: Data) -> Campaign:
    return data.loaded.experiment.campaigns[data.settings.campaign]


def _robot(data: Data, campaign: Campaign) -> Robot:
    """The robot that a fit starts from: the robot file's, masses and gears those of the fits that it names."""
    source = _source(data)
    file = data.loaded.robot
    robot = file.to_robot(campaign.payload_kg) if source is None else source.robot(payload_kg(campaign, file))
    return _with_springs(data, robot)


def _with_springs(data: Data, robot: Robot) -> Robot:
    """A robot with the gears that another fit has found, and with the springs that the fit adds to it."""
    settings = elastic_fit(data.loaded.experiment, data.name)
    if settings.springs_from is not None:
        unit = data.response.input_unit
        gears = gears_of(estimate_from_artifact(data.taken["gears"]), settings.springs_from, robot, unit)
        robot = with_known_gears(robot, gears)
    return with_estimated_springs(robot, settings.options())


def nominal_robot(data: Data) -> Robot:
    """Returns the robot that a fit starts from, with the payload of its campaign."""
    return _robot(data, _campaign(data))


def _source(data: Data) -> RigidSource | None:
    name = elastic_fit(data.loaded.experiment, data.name).rigid
    return None if name is None else rigid_source(data.loaded, name, data.taken["standard"])


def _perturbed(data: Data, campaign: Campaign) -> tuple[PerturbedRobot, ...]:
    """Robots that show how far the rigid fit's masses and inertias may be off."""
    source = _source(data)
    if source is None:
        return ()
    found = source.perturbed(payload_kg(campaign, data.loaded.robot))
    return tuple(PerturbedRobot(_with_springs(data, robot), deviations) for robot, deviations in found)


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def true_values(nominal: Robot, true: TrueRobot) -> dict[str, float]:
    """Returns the true value of everything that an elastic fit may estimate, by the fit's own names.

    What the robot file has no spring for is no value of a fit: the springs that it lacks are left out. Where one lies
    in line with a gear, the gear's value is that of both in series: no response tells them apart.

    Args:
        nominal: The robot as its file describes it, with the campaign's payload.
        true: The robot that was simulated.
    """
    known = [spring.name for spring in nominal.springs]
    values: dict[str, float] = {}
    for spring in with_chains(true.robot, nominal.springs):
        values[f"{spring.name}.stiffness"] = spring.stiffness
        values[f"{spring.name}.damping"] = spring.damping
        values[f"{spring.name}.cubic"] = spring.cubic
        place = zip("xyz", spring.point_m.tolist(), strict=True)
        values |= {f"{spring.name}.location_{axis}": x for axis, x in place}
    axial = axial_inertia(build_model(true.without_springs(known), balanced=True))
    for joint, stated, inertia in zip(true.robot.joints, nominal.joints, axial.tolist(), strict=True):
        if true.imperfections.viscous_drift == 1:  # else it has no one value
            values[f"{joint.name}.viscous"] = joint.motor.friction.viscous_nms_rad
        values[f"{joint.name}.arm_viscous"] = joint.arm_viscous
        values[f"{joint.name}.motor_inertia"] = joint.motor.inertia_kgm2
        values[f"{joint.name}.link_inertia"] = inertia
        errors = _torque_errors(joint, stated, true.imperfections)
        values |= {f"{joint.name}.{key}": value for key, value in errors.items()}
    values["delay"] = true.delay_s
    return values | _nuisances(nominal, true.robot) | _drives(nominal, true)


def _nuisances(nominal: Robot, robot: Robot) -> dict[str, float]:
    """What the robot file has wrong of payload and links, as estimated nuisances count it."""
    bodies = {joint.name: (joint.link, own.link) for joint, own in zip(nominal.joints, robot.joints, strict=True)}
    values = {"payload.mass": robot.payload.mass_kg}
    values |= {
        f"{name}.mass": 100 * (own.mass_kg / stated.mass_kg - 1)
        for name, (stated, own) in bodies.items()
        if stated.mass_kg
    }
    axes = {"payload": nominal.payload_axes}
    axes |= {joint.name: nominal.link_axes(index) for index, joint in enumerate(nominal.joints)}
    for name, (stated, own) in {"payload": (nominal.payload, robot.payload), **bodies}.items():
        shift = 1e3 * axes[name].T @ (own.com_m - stated.com_m)
        values |= {f"{name}.com_{axis}": float(x) for axis, x in zip("xyz", shift.tolist(), strict=True)}
    return values


def _drives(nominal: Robot, true: TrueRobot) -> dict[str, float]:
    """The same of couplings, recorded torques, counterbalances and what gears do beside springs and dampers."""
    values: dict[str, float] = {}
    for joint, stated in zip(true.robot.joints, nominal.joints, strict=True):
        for other in nominal.joints:
            turn = joint.couplings.get(other.name, 0.0) - stated.couplings.get(other.name, 0.0)
            values[f"{joint.name}.coupling_{other.name}"] = 100 * turn * other.motor.gear_ratio
        factor = true.truth.torque_constant_factor.get(joint.name, 1.0)
        values[f"{joint.name}.late_torque"] = true.truth.late_torque_s.get(joint.name, 0.0) / MICRO
        values[f"{joint.name}.late_angle"] = true.truth.late_angle_s.get(joint.name, 0.0) / MICRO
        values[f"{joint.name}.zero"] = true.truth.zero_deg.get(joint.name, 0.0)
        values[f"{joint.name}.torque_constant"] = -100 * float(np.log(factor))
        own = joint.counterbalance
        waves = (own.sine_nm[0], own.cosine_nm[0]) if isinstance(own, HarmonicBalance) else (0.0, 0.0)
        values |= {f"{joint.name}.counterbalance_{n}": float(w) for n, w in zip(("sine", "cosine"), waves, strict=True)}
    flaws = true.imperfections
    for spring in nominal.springs:
        slip = flaws.hysteresis_n if nominal.is_linear(spring) else flaws.hysteresis_nm
        values |= {f"{spring.name}.load_damping": flaws.load_damping_1_rad, f"{spring.name}.hysteresis": slip}
        values[f"{spring.name}.one_sided"] = 100 * flaws.one_sided
    return values


def _torque_errors(joint: Joint, stated: Joint, flaws: Imperfections) -> dict[str, float]:
    """Relative errors of the robot file's friction and ripple, as the response's coefficients count them."""
    errors: dict[str, float] = {}
    law, known = joint.motor.friction, stated.motor.friction
    if known.coulomb_nm > 0 and flaws.friction != "none":
        errors["level"] = law.coulomb_nm / known.coulomb_nm - 1
        errors |= {"shape": law.presliding_rad / known.presliding_rad - 1} if flaws.friction == "lugre" else {}
    if stated.motor.ripple_nm > 0:
        # The ripple drives the motor; what a regressor counts opposes it.
        errors |= {"ripple_sin": -1.0 if flaws.ripple else 0.0, "ripple_cos": 0.0}
    return errors
