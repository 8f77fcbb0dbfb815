"""Linear robots of the study of trust: exact responses plus noise.

They are off by what their file may have wrong: by amounts drawn from the priors of nuisance parameters, or by nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.frf.frf import Frf
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance import effects, listing
from robid.models.elastic.fit.nuisance.columns import bristle_share
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.rest_model import NO_LOAD_RAD
from robid.models.elastic.fitting import true_values
from robid.models.elastic.settings import elastic_fit, model_settings
from robid.pipeline.graph import Run
from robid.pipeline.simulate_or_acquire import simulated_experiment
from robid.robot.description import Joint, Robot
from robid.robot.linearize import LinearModel, axial_inertia, linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import ElasticParameters, nominal_parameters, response
from robid.robot.sampling import hold_factor
from robid.settings.robot_parts import delay_s, plain_settings, require_controller, robot_settings
from robid.signals.quantities import motor_channels
from robid.simulate.options import Imperfections, Truth
from robid.simulate.truth import TrueRobot
from robid.studies.experiments import changed_simulation
from robid.studies.settings.trust import LINEAR, TrustStudy, individuals
from robid.studies.simulated import kept_or_refused, with_truth
from robid.studies.study import Content, Earlier, Task, study_of
from robid.studies.trust.responses import RANDOM, machines

_PERCENT = 100.0
_Value = TypeVar("_Value")
_TURN_10_HZ = 20 * np.pi
_DRAWS = 3  # keeps these draws apart from those of springs, masses and defects


@dataclass(frozen=True)
class Perturbed:
    """A robot file's nuisance parameters, and how far one robot is off."""

    nuisances: tuple[effects.Nuisance, ...]
    amounts: FloatArray  # (n_nuisance, n_conf) how far the robot is off in each configuration


def draw_perturbed(robot: Robot, options: ElasticOptions, n_configuration: int, seed: int) -> Perturbed:
    """Draws how far a robot is off in each configuration: what all of them share, and what each adds.

    Amounts that have a sign keep it.
    """
    generator = np.random.default_rng([seed, _DRAWS])
    nuisances = listing.list_nuisances(robot, options)
    amounts = np.empty((len(nuisances), n_configuration))
    for row, nuisance in zip(amounts, nuisances, strict=True):
        common, each = generator.standard_normal(), generator.standard_normal(n_configuration)
        row[:] = nuisance.common_std * common + nuisance.cluster_std * each
        row[:] = np.abs(row) if nuisance.least == 0 else np.clip(row, nuisance.least, nuisance.most)
    return Perturbed(nuisances, amounts)


def as_file(robot: Robot, options: ElasticOptions, n_configuration: int) -> Perturbed:
    """Returns the nuisance parameters of a robot that is right in everything."""
    nuisances = listing.list_nuisances(robot, options)
    return Perturbed(nuisances, np.zeros((len(nuisances), n_configuration)))


def perturbed_responses(
    robot: Robot, off: Perturbed, configurations: FloatArray, frequency_hz: FloatArray, sampling: tuple[float, float]
) -> ComplexArray:
    """Computes the exact responses of a robot that is off, as they are recorded; bristles are the same in all.

    Springs and dampers are the true ones. Responses (n_conf, n_freq, n_motor, n_motor) are from recorded torques to
    motor accelerations, in configurations (n_conf, n_joint) [rad, or m] at frequencies (n_freq,) [Hz]; sampling is
    the period for which torques are held, and the delay to the applied torque [s].
    """
    shares = load_shares(robot, configurations)
    found = []
    for index, configuration in enumerate(configurations):
        amounts = {
            nuisance.name: amount
            for nuisance, amount in zip(off.nuisances, off.amounts[:, index].tolist(), strict=True)
        }
        own = off_robot(robot, off.nuisances, amounts, shares[index])
        model = build_model(own)
        linear = linearize(model, solve_statics(model, configuration[None]))
        late = (amounts[each.name] for each in off.nuisances if each.effect == effects.ValueOff("delay", 0))
        delay_s = sampling[1] + sum(effects.MICRO * amount for amount in late)
        bristles = _bristles(off.nuisances, amounts, own, frequency_hz)
        parameters = nominal_parameters(own, linear, delay_s)
        exact = _with_bristles(linear, parameters, bristles, frequency_hz, sampling[0])
        hold = hold_factor(2 * np.pi * frequency_hz, delay_s, sampling[0])
        found.append(_recorded(own, off, amounts, exact, frequency_hz, hold))
    return np.array(found)


def _bristles(
    nuisances: Sequence[effects.Nuisance], amounts: Mapping[str, float], robot: Robot, frequency_hz: FloatArray
) -> ComplexArray:
    """What bristles add to each spring (n_freq, n_spring), over its stiffness."""
    omega = 2 * np.pi * frequency_hz
    found = np.zeros((omega.size, len(robot.springs)), complex)
    for nuisance in nuisances:
        if isinstance(nuisance.effect, effects.Hysteresis):
            share = bristle_share(omega, np.zeros((1, omega.size)), nuisance.effect.slip)[0]
            found[:, nuisance.effect.spring] += 2 * amounts[nuisance.name] / _PERCENT * share
    return found


def _with_bristles(
    linear: LinearModel,
    parameters: ElasticParameters,
    bristles: ComplexArray,
    frequency_hz: FloatArray,
    period_s: float,
) -> ComplexArray:
    """Response (n_freq, n_motor, n_motor), springs at each frequency as its bristles make them."""
    if not bristles.any():
        return np.asarray(response(linear, parameters, frequency_hz, period_s).sampled[0])
    found = []
    for line, added in zip(frequency_hz, parameters.stiffness * bristles, strict=True):
        damping = parameters.damping + added.imag / (2 * np.pi * line)
        own = replace(parameters, stiffness=parameters.stiffness + added.real, damping=damping)
        found.append(response(linear, own, np.array([line]), period_s).sampled[0, 0])
    return np.array(found)


def off_robot(
    robot: Robot, nuisances: Sequence[effects.Nuisance], amounts: Mapping[str, float], shares: FloatArray
) -> Robot:
    """Returns the robot with everything that is off, by its name, and belongs to its mechanics.

    The load of each gear here (n_spring,) is from -1 to 1 over the configurations.
    """
    inertia = axial_inertia(build_model(robot))
    further = []
    for nuisance in nuisances:
        share, direction = amounts[nuisance.name] / _PERCENT, nuisance.effect
        if share == 0:
            continue
        if isinstance(direction, effects.RobotMove):
            robot = direction.moved(robot, amounts[nuisance.name])
        elif isinstance(direction, effects.LoadStiffness):
            spring = robot.springs[direction.spring]
            softer = replace(spring, stiffness=spring.stiffness * (1 + share * float(shares[direction.spring])))
            robot = replace(robot, springs=_with(robot.springs, direction.spring, softer))
        elif isinstance(direction, effects.Compliance):
            spring = direction.spring
            further.append(replace(spring, stiffness=spring.stiffness / share, damping=spring.damping / share))
        elif isinstance(direction, effects.ValueOff) and direction.kind in ("stiffness", "damping"):
            spring = robot.springs[direction.element]
            size = (1 + share) * float(getattr(spring, direction.kind))
            held = replace(spring, stiffness=size) if direction.kind == "stiffness" else replace(spring, damping=size)
            robot = replace(robot, springs=_with(robot.springs, direction.element, held))
        elif isinstance(direction, effects.ValueOff) and direction.kind != "delay":
            joint = robot.joints[direction.element]
            off = _with_off_drive(joint, direction, share, float(inertia[direction.element]))
            robot = replace(robot, joints=_with(robot.joints, direction.element, off))
    return replace(robot, springs=(*robot.springs, *further))


def _with_off_drive(joint: Joint, direction: effects.ValueOff, share: float, inertia: float) -> Joint:
    if direction.kind == "arm_viscous":
        return replace(joint, arm_viscous=joint.arm_viscous + share * _TURN_10_HZ * inertia)
    motor = joint.motor
    if direction.kind == "motor_inertia":
        return replace(joint, motor=replace(motor, inertia_kgm2=motor.inertia_kgm2 * (1 + share)))
    viscous = motor.friction.viscous_nms_rad + share * _TURN_10_HZ * motor.inertia_kgm2
    return replace(joint, motor=replace(motor, friction=replace(motor.friction, viscous_nms_rad=viscous)))


def _with(values: tuple[_Value, ...], index: int, value: _Value) -> tuple[_Value, ...]:
    return (*values[:index], value, *values[index + 1 :])


def load_shares(robot: Robot, configurations: FloatArray) -> FloatArray:
    """Returns each spring's load in each configuration (n_conf, n_spring) from its mean, over the largest distance.

    Zero for springs whose loads are alike, as those of an upright axis are.
    """
    load = np.abs(solve_statics(build_model(robot), configurations).deflection)
    spread = load - load.mean(axis=0)
    most = np.abs(spread).max(axis=0)
    return np.asarray(np.where(most > NO_LOAD_RAD, spread, 0.0) / np.maximum(most, NO_LOAD_RAD))


def _recorded(
    robot: Robot,
    off: Perturbed,
    amounts: Mapping[str, float],
    exact: ComplexArray,
    frequency_hz: FloatArray,
    hold: ComplexArray,
) -> ComplexArray:
    """What motors' friction, which waits for no hold (n_freq,), and torque constants make of a response."""
    square = (2 * np.pi * frequency_hz) ** 2
    feedback, constant = np.zeros(exact.shape, complex), np.ones(exact.shape[2])
    for nuisance in off.nuisances:
        direction, share = nuisance.effect, amounts[nuisance.name] / _PERCENT
        if isinstance(direction, effects.MotorFriction):
            size = share * robot.joints[direction.joint].motor.inertia_kgm2 * _TURN_10_HZ**2
            feedback[:, direction.joint, direction.joint] += direction.phase * size / square
        elif isinstance(direction, effects.TorqueScale):
            constant[direction.joint] = 1 + share
    rubbing = np.linalg.solve(np.eye(exact.shape[1]) - exact @ feedback / hold[:, None, None], exact)
    return np.asarray(rubbing / constant)


_NOISE_DRAWS, _ROTOR_DRAWS = 4, 5  # keep these draws apart from the others
_KNOWN = 1e6  # degrees of freedom of a covariance that is known


@dataclass(frozen=True)
class LinearFit:
    """A linear robot to be measured and fitted."""

    nominal: Robot  # The robot as its file describes it
    robot: Robot  # With the true springs and dampers
    drawn: bool  # Whether its nuisanceed values are drawn
    seed: int  # Seed of them and of the noise
    configurations: FloatArray  # (n_conf, n_joint) where it is measured [rad, or m]
    lines: IntArray  # (n_freq,) excited lines
    period_s: float  # Length of a period [s]
    sampling: tuple[float, float]  # Sampling period and nominal delay [s]
    relative_noise: float  # Deviation of an element's noise over the median response of its output
    options: ElasticOptions  # Options of the fit


def linear_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each linear robot."""
    study = study_of(run.loaded, TrustStudy)
    if study.linear is None:
        return []
    machine, found = machines(run)["heavy"], []
    options = elastic_fit(run.loaded.experiment, study.fit).options()
    loaded, campaign = machine.run.loaded, machine.places[RANDOM].campaign
    nominal = loaded.robot.to_robot(campaign.payload_kg)
    period = require_controller(loaded).sampling_period_s
    for one in (one for one in individuals(study) if one.kind == "linear"):
        places, truth = machine.places_of(one, RANDOM), changed_simulation(campaign, {}, one.seed)
        experiment = simulated_experiment(loaded, campaign, truth, places.content)
        fit = LinearFit(
            nominal=nominal,
            robot=experiment.robot,
            drawn=one.group == LINEAR,
            seed=one.seed,
            configurations=places.content.configurations,
            lines=experiment.excited_lines,
            period_s=experiment.reference.shape[2] * period,
            sampling=(period, delay_s(loaded, campaign)),
            relative_noise=study.linear.relative_noise,
            options=options,
        )
        decides = {
            **{"drawn": fit.drawn, "seed": one.seed, "truth": plain_settings(truth.truth)},
            **{"configurations": fit.configurations.tolist(), "lines": fit.lines.tolist(), "period_s": fit.period_s},
            **{"sampling": list(fit.sampling), "noise": fit.relative_noise, "options": plain_settings(options)},
            "settings": model_settings(loaded, places.owner),
            **robot_settings(loaded, "friction", "controller"),
        }
        found.append(Task(one.key, decides, (fit,)))
    return found


def fit_linear(one: LinearFit) -> Content:
    """Measures a linear robot and fits it."""
    n_configuration = len(one.configurations)
    robot, off = one.robot, as_file(one.nominal, one.options, n_configuration)
    if one.drawn:
        robot = _with_rotors_off(robot, one.options, one.seed)
        off = draw_perturbed(one.nominal, one.options, n_configuration, one.seed)
    frequency_hz = one.lines / one.period_s
    exact = perturbed_responses(robot, off, one.configurations, frequency_hz, one.sampling)
    frf = noisy_frf(robot, exact, one)
    truth = TrueRobot(robot, Truth(), Imperfections(), one.sampling[1], one.seed, None)
    content = kept_or_refused(lambda: fit_elastic(one.nominal, frf, one.options, one.sampling[1]))
    return with_truth(content, true_values(one.nominal, truth))


def _with_rotors_off(robot: Robot, options: ElasticOptions, seed: int) -> Robot:
    """The robot with rotor inertias drawn by what the file says of their errors, where the fit estimates them."""
    draws = np.random.default_rng([seed, _ROTOR_DRAWS]).standard_normal(len(robot.joints)).tolist()

    def off(joint: Joint, draw: float) -> Joint:
        if not options.estimates("motor_inertia", f"{joint.name}.motor_inertia"):
            return joint
        inertia = joint.motor.inertia_kgm2 * float(np.exp(joint.motor.inertia_relative_std * draw))
        return replace(joint, motor=replace(joint.motor, inertia_kgm2=inertia))

    return replace(robot, joints=tuple(off(*pair) for pair in zip(robot.joints, draws, strict=True)))


def noisy_frf(robot: Robot, exact: ComplexArray, one: LinearFit) -> Frf:
    """Returns exact responses (n_conf, n_freq, n_motor, n_motor) with circular noise of a known covariance."""
    generator = np.random.default_rng([one.seed, _NOISE_DRAWS])
    level = one.relative_noise * np.median(np.abs(exact), axis=(0, 1, 3))
    noise = generator.standard_normal((2, *exact.shape)) / np.sqrt(2)
    (n_conf, n_freq, n_motor, _), names = exact.shape, tuple(joint.name for joint in robot.joints)
    return Frf(
        frequency_hz=one.lines / one.period_s,
        lines=one.lines,
        configurations=one.configurations,
        response=exact + level[:, None] * (noise[0] + 1j * noise[1]),
        input_factor=np.broadcast_to(np.eye(n_motor, dtype=complex), (n_conf, n_freq, n_motor, n_motor)),
        element_scale=np.ones((n_conf, n_motor, n_motor)),
        total_covariance=np.broadcast_to(np.diag(level.astype(complex) ** 2), (n_conf, n_freq, n_motor, n_motor)),
        noise_covariance=None,
        total_degrees_of_freedom=_KNOWN,
        noise_degrees_of_freedom=0.0,
        sensitivity=np.zeros((n_conf, 0, n_freq, n_motor, n_motor), complex),
        coefficient_names=(),
        coefficient_relative_std=np.zeros(0),
        removed_torque_rms=np.zeros((n_conf, n_motor)),
        sampling_period_s=one.sampling[0],
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(names, "acceleration"),
        joint_units=robot.joint_units,
    )
