"""The linear robots of the study of trust: exact responses plus noise, with doubted values off or as in the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.files import solution_content
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.settings import elastic_fit, model_settings
from robid.models.elastic.truth import true_values
from robid.pipeline import Run
from robid.robot.description import Joint, Robot
from robid.settings.robot_parts import delay_s, plain_settings, require_controller, robot_settings
from robid.signals.quantities import motor_channels
from robid.simulate.options import Imperfections, Truth
from robid.simulate.truth import TrueRobot
from robid.stages.simulate_or_acquire import simulated_experiment
from robid.studies.changed import changed_simulation
from robid.studies.study import Earlier
from robid.studies.tasks import Content, Task
from robid.studies.trust.doubted import as_file, doubted_responses, draw_doubted
from robid.studies.trust.individuals import LINEAR, Individual, individuals
from robid.studies.trust.models import with_truth
from robid.studies.trust.responses import REFUSAL
from robid.studies.trust.study import RANDOM, Machine, machines, study_of

_NOISE_DRAWS, _ROTOR_DRAWS = 4, 5  # keep these draws apart from the others
_KNOWN = 1e6  # degrees of freedom of a covariance that is known


@dataclass(frozen=True)
class LinearFit:
    """A linear robot to be measured and fitted.

    Attributes:
        nominal: The robot as its file describes it.
        robot: With the true springs and dampers.
        drawn: Whether its doubted values are drawn.
        seed: Seed of them and of the noise.
        configurations (n_conf, n_joint): Its places [rad, or m].
        lines (n_freq,): Excited lines.
        period_s: Length of a period [s].
        sampling: Sampling period and nominal delay [s].
        relative_noise: Deviation of an element's noise over the median response of its output.
        options: Options of the fit.
    """

    nominal: Robot
    robot: Robot
    drawn: bool
    seed: int
    configurations: FloatArray
    lines: IntArray
    period_s: float
    sampling: tuple[float, float]
    relative_noise: float
    options: ElasticOptions


def linear_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each linear robot."""
    study = study_of(run.loaded)
    if study.linear is None:
        return []
    machine = machines(run)["heavy"]
    own = [one for one in individuals(study) if one.kind == "linear"]
    return list(
        _tasks(machine, own, elastic_fit(run.loaded.experiment, study.fit).options(), study.linear.relative_noise)
    )


def _tasks(machine: Machine, robots: list[Individual], options: ElasticOptions, noise: float) -> Iterator[Task]:
    loaded, campaign = machine.loaded, machine.places[RANDOM].campaign
    nominal = loaded.robot.to_robot(campaign.payload_kg)
    period = require_controller(loaded).sampling_period_s
    for one in robots:
        places = machine.places_of(one, RANDOM)
        truth = changed_simulation(campaign, {}, one.seed)
        experiment = simulated_experiment(loaded, campaign, truth, places.content)
        length = experiment.reference.shape[2] * period
        sampling = period, delay_s(loaded, campaign)
        fit = LinearFit(
            nominal, experiment.robot, one.group == LINEAR, one.seed, places.content.configurations,
            experiment.excited_lines, length, sampling, noise, options,
        )  # fmt: skip
        decides = {
            "drawn": fit.drawn,
            "seed": one.seed,
            "truth": plain_settings(truth.truth),
            "configurations": fit.configurations.tolist(),
            "lines": fit.lines.tolist(),
            "period_s": length,
            "sampling": list(sampling),
            "noise": noise,
            "options": plain_settings(options),
            "settings": model_settings(loaded, places.owner),
            **robot_settings(loaded, "friction", "controller"),
        }
        yield Task(one.key, decides, fit)


def fit_linear(one: LinearFit) -> Content:
    """Measures a linear robot and fits it."""
    n_place = len(one.configurations)
    robot, off = one.robot, as_file(one.nominal, one.options, n_place)
    if one.drawn:
        robot = _with_rotors_off(robot, one.options, one.seed)
        off = draw_doubted(one.nominal, one.options, n_place, one.seed)
    frequency_hz = one.lines / one.period_s
    exact = doubted_responses(robot, off, one.configurations, frequency_hz, one.sampling)
    frf = noisy_frf(robot, exact, one)
    truth = TrueRobot(robot, Truth(), Imperfections(), one.sampling[1], one.seed, None)
    try:
        solution = fit_elastic(one.nominal, frf, one.options, one.sampling[1])
    except DataError as error:
        return Content({}, {REFUSAL: str(error)})
    return with_truth(Content(*solution_content(solution)), true_values(one.nominal, truth))


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
    n_conf, n_freq, n_motor, _ = exact.shape
    names = tuple(joint.name for joint in robot.joints)
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
