"""The stages of the default experiment against the least that each would have to do."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest
from mujoco import rollout

from exact_systems import exact_frf
from robid.artifacts.artifact import Provenance
from robid.artifacts.record import RECORD, record_from_artifact, record_to_artifact
from robid.artifacts.store import read_artifact, write_artifact
from robid.design.lines import choose_lines
from robid.fit.options import ElasticOptions
from robid.fit.parameters import map_parameters
from robid.fit.problem import make_problem
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters
from robid.settings.load import load_experiment
from robid.signals.friction import TorqueLaw
from robid.signals.multisine import multisine, time_signal
from robid.simulate.experiment import Experiment, simulate
from robid.simulate.truth import true_robot, with_imperfections

LOADED = load_experiment(Path(__file__).parents[2] / "configs/kr300.yaml")
CAMPAIGN = LOADED.experiment.campaigns["estimation"]
ROBOT = LOADED.robot.to_robot(CAMPAIGN.payload_kg)
CONFIGURATION = np.deg2rad([10.0, -60.0, 70.0, 30.0, 40.0, 20.0])
DELAY_S = LOADED.robot.controller.delay_samples * LOADED.robot.controller.sampling_period_s


def default_experiment(period_s, periods):
    """The estimation campaign of the default experiment, of another length."""
    options = CAMPAIGN.source.simulate
    excitation = replace(CAMPAIGN.excitation, period_s=period_s, count=min(60, int(20 * period_s)))
    sampling_period_s = LOADED.robot.controller.sampling_period_s
    lines, detection = choose_lines(excitation, sampling_period_s)
    generator = np.random.default_rng(1)
    n_motor = len(ROBOT.joints)
    level = np.broadcast_to(excitation.rms, n_motor) * np.sqrt(2 / lines.size)
    phases = generator.uniform(0, 2 * np.pi, (CAMPAIGN.realizations, n_motor, lines.size))
    spectrum = multisine(np.tile(level[:, None], lines.size), phases)
    return Experiment(
        robot=true_robot(ROBOT, options.truth),
        controller=LOADED.robot.controller,
        options=options,
        reference=time_signal(spectrum, lines, round(period_s / sampling_period_s)),
        inject="speed_reference",
        excited_lines=lines,
        detection_lines=detection,
        periods=periods,
    )


def same_model(experiment):
    """The true robot's model with friction and ripple, and its rest."""
    options, controller = experiment.options, experiment.controller
    model = build_model(
        with_imperfections(experiment.robot, options.imperfections),
        friction=True,
        ripple=True,
        timestep_s=controller.sampling_period_s / options.steps_per_sample,
    )
    return model.mujoco, solve_statics(model, CONFIGURATION[None])


def test_closed_loop_against_raw_rollout(compare):
    experiment = default_experiment(1.0, 1)
    record = simulate(experiment, CONFIGURATION, 0)
    model, rest = same_model(experiment)
    n_sample, n_motor = record.torque.shape[4:]
    played = record.torque.reshape(-1, n_sample, n_motor)
    torque = np.concatenate([played] * (experiment.options.transient_periods + experiment.periods), axis=1)
    data, kind = mujoco.MjData(model), mujoco.mjtState.mjSTATE_FULLPHYSICS
    data.qpos[:], data.ctrl[:] = rest.position[0], rest.motor_torque[0]
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    states = np.tile(state, (len(torque), 1))
    reached, _ = rollout.rollout(model, [data], states, torque)
    assert np.isfinite(reached).all(), "the open loop must not blow up: it would cost something else"
    compare(
        "simulate.vs_rollout",
        ours=lambda: simulate(experiment, CONFIGURATION, 0),
        reference=lambda: rollout.rollout(model, [data], states, torque),
        rounds=9,
    )


@pytest.fixture(scope="module")
def problem():
    """Eight configurations, sixty lines, all springs, dampers, viscous terms and the delay free."""
    generator = np.random.default_rng(2)
    configurations = generator.uniform(ROBOT.lower_rad, ROBOT.upper_rad, (8, len(ROBOT.joints)))
    frf = exact_frf(ROBOT, configurations, np.geomspace(2, 80, 60), delay_s=DELAY_S, relative_noise=0.02)
    model = build_model(ROBOT)
    linear = linearize(model, solve_statics(model, configurations))
    options = ElasticOptions()
    parameters = map_parameters(ROBOT, nominal_parameters(ROBOT, linear, DELAY_S), options, (), np.zeros(0))
    return make_problem(frf, linear, parameters, options)[0]


def finite_differences(problem, internal, step=1e-6):
    """Residual and its negative derivative by two-point differences."""
    here = problem.residual(internal, problem.model_response(internal))
    columns = []
    for index in range(internal.size):
        moved = internal.copy()
        moved[index] += step
        columns.append((here - problem.residual(moved, problem.model_response(moved))) / step)
    return here, np.stack(columns, axis=-1)


def test_analytic_jacobian_against_finite_differences(compare, keep, problem):
    internal = np.full(len(problem.parameters.names), 0.01)
    exact, differences = problem.linear(internal)[1], finite_differences(problem, internal)[1]
    error = np.abs(differences - exact).max(axis=(0, 1, 2, 3)) / np.abs(exact).max(axis=(0, 1, 2, 3))
    assert error.max() < 1e-2, "they must be the same derivative"
    keep("fit.finite_differences_error", float(error.max()), "(worst column, relative to the analytic one)")
    compare(
        "fit.jacobian_vs_finite_differences",
        ours=lambda: problem.linear(internal),
        reference=lambda: finite_differences(problem, internal),
        rounds=9,
    )


def test_normal_equations_against_the_cost_alone(compare, problem):
    internal = np.full(len(problem.parameters.names), 0.01)
    compare(
        "fit.normal_vs_cost",
        ours=lambda: problem.normal(internal),
        reference=lambda: problem.cost(internal),
        rounds=25,
    )


@pytest.fixture(scope="module")
def record_file(tmp_path_factory):
    """The record of one configuration, as long as in the default experiment."""
    record = simulate(default_experiment(CAMPAIGN.excitation.period_s, CAMPAIGN.periods), CONFIGURATION, 0)
    path = tmp_path_factory.mktemp("bench") / "record.h5"
    write_artifact(path, record_to_artifact(record, Provenance(stage="bench")))
    return path


def law(motor):
    friction = motor.friction
    return TorqueLaw(
        coulomb_nm=friction.coulomb_nm,
        static_nm=friction.static_nm,
        stribeck_rad_s=friction.stribeck_rad_s,
        presliding_rad=friction.presliding_rad,
        relative_std=friction.relative_std,
        ripple_nm=motor.ripple_nm,
        ripple_order=motor.ripple_order,
    )


@pytest.mark.parametrize(
    ("key", "compensation"), [("frf.vs_read_fft", "nominal"), ("frf.uncompensated_vs_read_fft", "none")]
)
def test_estimate_against_reading_and_transforming(compare, record_file, key, compensation):
    record = record_from_artifact(read_artifact(record_file, RECORD))
    options = EstimateOptions(compensation=compensation)
    laws = tuple(law(joint.motor) for joint in ROBOT.joints)

    def read_and_transform():
        samples = record_from_artifact(read_artifact(record_file, RECORD))
        return np.fft.rfft(samples.torque, axis=4), np.fft.rfft(samples.position, axis=4)

    compare(key, ours=lambda: estimate_frf(record, options, laws, DELAY_S), reference=read_and_transform, rounds=9)
