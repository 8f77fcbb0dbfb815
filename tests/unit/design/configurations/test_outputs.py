"""Errors of outputs by columns of the log response, against finite differences and eigenvalues."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import eigh

from robid.design.configurations.candidates import choose_parameters, relative_derivatives
from robid.design.configurations.options import InformationOptions
from robid.design.configurations.outputs import ResonanceLines, output_errors
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.known import load_experiment
from robid.pipeline.design_outputs import undamped
from robid.pipeline.design_prediction import lacking_at, nominal_frf
from robid.pipeline.design_tasks import AssumedTask
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import motion_matrices, nominal_parameters

DELAY_S, PERIOD_S, BAND_HZ = 1e-3, 2e-3, np.array([2.0, 80.0])
FREE = ("stiffness", "damping")


def drawn(*shape, seed):
    generator = np.random.default_rng(seed)
    return generator.normal(size=shape) + 1j * generator.normal(size=shape)


@pytest.mark.parametrize(("output", "n_out"), [("response", 2), ("tool_displacement", 3), ("feedforward_torque", 2)])
def test_errors_of_outputs_are_differences_of_these(output, n_out):
    response, columns, step = drawn(4, n_out, 2, seed=1), drawn(4, n_out, 2, 5, seed=2), 1e-6

    def value(moved):
        if output == "feedforward_torque":
            return np.linalg.inv(moved)
        return np.log(moved) if output == "response" else moved

    size = 1.0
    if output == "tool_displacement":
        size = np.linalg.norm(response, axis=1)[:, None]
    if output == "feedforward_torque":
        size = np.linalg.norm(np.linalg.inv(response), axis=2)[:, :, None]
    found = output_errors(output, response, columns).reshape(4, *value(response).shape[1:], 5)
    for index in range(5):
        ahead, behind = (value(response * (1 + side * step * columns[..., index])) for side in (1, -1))
        np.testing.assert_allclose(found[..., index], (ahead - behind) / (2 * step) / size, rtol=1e-6, atol=1e-8)


def frequencies(robot, configurations):
    """Undamped resonances (n_conf, n) of a robot at rest, ascending [rad/s]."""
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, configurations))
    parameters = nominal_parameters(robot, linear, DELAY_S)
    rows = [motion_matrices(linear, parameters, index) for index in range(len(configurations))]
    return np.sqrt(np.maximum([eigh(stiffness, mass, eigvals_only=True) for mass, _, stiffness in rows], 0.0))


@pytest.fixture(params=["kr300", "ur5e"])
def robot(request, data_folder):
    if request.param == "ur5e":  # its model lies there
        data_folder("robot_models")
    loaded = load_experiment(Path(__file__).parents[4] / f"configs/{request.param}.yaml")
    return loaded.robot.to_robot(loaded.experiment.campaigns["candidates"].payload_kg)


def test_errors_of_resonances_are_differences_of_eigenfrequencies(robot):
    configurations = np.random.default_rng(3).uniform(-1.2, 1.2, (3, len(robot.joints)))
    task = AssumedTask((robot,), InformationOptions(), DELAY_S, configurations, BAND_HZ, PERIOD_S)
    bare = undamped(robot)
    model = build_model(bare)
    linear = linearize(model, solve_statics(model, configurations))
    parameters = nominal_parameters(bare, linear, DELAY_S)
    lines = [ResonanceLines.of(linear, parameters, index, BAND_HZ) for index in range(3)]
    task = replace(task, frequency_hz=np.concatenate([each.frequency_hz for each in lines]))
    wanted = choose_parameters(robot, FREE, (), ())
    own = relative_derivatives(bare, configurations, task.frequency_hz, PERIOD_S, DELAY_S, wanted)
    options = ElasticOptions(free=FREE)
    lacking = lacking_at(bare, nominal_frf(bare, task), options, DELAY_S)
    # A spring stiffer by a thousandth, and the payload heavier by a hundredth.
    springs = list(bare.springs)
    springs[1] = replace(springs[1], stiffness=1.001 * springs[1].stiffness)
    own_mass, own_inertia = 1.01 * robot.payload.mass_kg, 1.01 * robot.payload.inertia_kgm2
    payload = replace(robot.payload, mass_kg=own_mass, inertia_kgm2=own_inertia)
    nominal = frequencies(bare, configurations)
    stiffer = frequencies(replace(bare, springs=tuple(springs)), configurations)
    heavier = frequencies(replace(bare, payload=payload), configurations)
    mass = [each.name for each in list_nuisances(robot, options)].index("payload.mass")
    begin = 0
    for index, each in enumerate(lines):
        here = slice(begin, begin + 2 * each.omega.size)
        begin = here.stop
        at = np.abs(nominal[index] - each.omega[:, None]).argmin(axis=1)
        np.testing.assert_allclose(nominal[index, at], each.omega, rtol=1e-9)
        by_spring = np.log(stiffer[index, at] / nominal[index, at]) / np.log(1.001)
        errors = each.errors(own[index, here])[:, 0, wanted.names.index(f"{springs[1].name}.stiffness")]
        np.testing.assert_allclose(errors, by_spring, atol=2e-3)
        by_mass = np.log(heavier[index, at] / nominal[index, at]) / (0.01 * robot.payload.mass_kg)
        errors = each.errors(lacking.columns[index, here])[:, 0, mass]
        np.testing.assert_allclose(errors, by_mass, atol=0.02 * np.abs(by_mass).max())
    assert begin > 20
