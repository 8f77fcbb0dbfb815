"""The stages of the default experiment against the least that each would have to do."""

import itertools
from dataclasses import replace

import mujoco
import numpy as np
import pytest
from mujoco import rollout

from default_campaign import CONFIGURATION, DELAY_S, ROBOT, default_experiment
from exact_systems import exact_frf
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.parameters import map_parameters
from robid.models.elastic.fit.problem import make_problem
from robid.robot.friction import LUGRE
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters
from robid.simulate.experiment import simulate
from robid.simulate.truth import with_imperfections


def same_model(experiment):
    """The true robot's model with friction and ripple, and its rest."""
    options, controller = experiment.options, experiment.controller
    model = build_model(
        with_imperfections(experiment.robot, options.imperfections),
        friction=LUGRE,
        ripple=True,
        timestep_s=controller.sampling_period_s / (options.steps_per_sample or 1),
    )
    return model.mujoco, solve_statics(model, CONFIGURATION[None])


def open_loop(experiment, periods):
    """Model, states at rest and the torques that the closed loop commands, over so many periods."""
    record = simulate(replace(experiment, periods=1), CONFIGURATION, 0)
    model, rest = same_model(experiment)
    n_sample, n_motor = record.inputs.shape[4:]
    torque = np.concatenate([record.inputs.reshape(-1, n_sample, n_motor)] * periods, axis=1)
    data, kind = mujoco.MjData(model), mujoco.mjtState.mjSTATE_FULLPHYSICS
    data.qpos[:], data.ctrl[:] = rest.position[0], rest.motor_torque[0]
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    states = np.tile(state, (len(torque), 1))
    reached, _ = rollout.rollout(model, [data], states, torque)
    assert np.isfinite(reached).all(), "the open loop must not blow up: it would cost something else"
    return model, states, torque


@pytest.mark.quick
def test_closed_loop_against_raw_rollout(compare):
    """As many samples as the closed loop runs: from rest, all of them recorded."""
    experiment = default_experiment(1.0, 2)
    experiment = replace(experiment, options=replace(experiment.options, transient_periods=0))
    model, states, torque = open_loop(experiment, 2)
    data = mujoco.MjData(model)
    compare(
        "simulate.vs_rollout",
        ours=lambda: simulate(experiment, CONFIGURATION, 0),
        reference=lambda: rollout.rollout(model, [data], states, torque),
        rounds=9,
    )


def test_kept_samples_against_raw_rollout(compare):
    """Two periods of 5 s as the default experiment records them, what comes before them included."""
    experiment = default_experiment(5.0, 2)
    model, states, torque = open_loop(experiment, experiment.periods)
    data = mujoco.MjData(model)
    compare(
        "simulate.useful_vs_rollout",
        ours=lambda: simulate(experiment, CONFIGURATION, 0),
        reference=lambda: rollout.rollout(model, [data], states, torque),
        rounds=5,
    )


@pytest.fixture(scope="module")
def problem():
    """Eight configurations, sixty lines, all springs, dampers, viscous terms and the delay free."""
    generator = np.random.default_rng(2)
    configurations = generator.uniform(ROBOT.lower, ROBOT.upper, (8, len(ROBOT.joints)))
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


@pytest.mark.quick
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


@pytest.mark.quick
def test_normal_equations_against_the_cost_alone(compare, problem):
    # A problem keeps what it has computed at its last point: no two evaluations are at the same one.
    points = (np.full(len(problem.parameters.names), 0.01 + 1e-6 * number) for number in itertools.count())
    compare(
        "fit.normal_vs_cost",
        ours=lambda: problem.normal(next(points)),
        reference=lambda: problem.cost(next(points)),
        rounds=101,
    )
