"""Cubic gears, spring locations and soft robots fitted to exact responses; what the data cannot tell is said."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.errors import DataError
from robid.frf.joined import join
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.parameters import map_parameters
from robid.models.elastic.fit.problem import make_problem
from robid.models.elastic.fit.rest_model import rest_model, spring_load
from robid.models.elastic.fit.solution import fitted_robot
from robid.models.elastic.judge.fitted import fitted_model
from robid.robot.derivatives import with_springs_at
from robid.robot.response import nominal_parameters, response
from tolerances import FINITE_DIFFERENCE, RECOVERY

FREQUENCY_HZ = np.geomspace(2.0, 60.0, 25)
CONFIGURATIONS = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.2], [-1.2, 1.4]])
DELAY_S = 1e-3
CUBIC = ("stiffness", "damping", "cubic")


def floor_standing():
    """Two joints whose first axis is vertical and carries no gravity torque."""
    robot = two_joint_robot()
    upright = replace(robot.joints[0], rotation=np.eye(3))
    tilted = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    return replace(robot, joints=(upright, replace(robot.joints[1], rotation=tilted)))


def stiffened(robot, *per_rad2):
    springs = list(robot.springs)
    for index, share in enumerate(per_rad2):
        springs[index] = replace(springs[index], cubic=share * springs[index].stiffness)
    return replace(robot, springs=tuple(springs))


def loaded_frf(robot, torque_nm, configurations=CONFIGURATIONS):
    """The response of a robot that swings under torques of this RMS, found until both agree."""
    frf = exact_frf(robot, configurations, FREQUENCY_HZ, delay_s=DELAY_S)
    generator = np.random.default_rng(1)
    phases = np.exp(2j * np.pi * generator.uniform(size=(len(configurations), FREQUENCY_HZ.size, 2, 8)))
    frf = replace(frf, input_amplitude=torque_nm * phases / np.sqrt(2 * FREQUENCY_HZ.size))
    for _ in range(30):
        model = rest_model(robot, frf, ElasticOptions(), DELAY_S)
        values = nominal_parameters(robot, model, DELAY_S)
        frf = replace(frf, response=response(model, values, FREQUENCY_HZ, frf.hold_period_s).sampled)
    return frf


def relative_errors(solution, robot, kind):
    field = {"cubic": "cubic", "stiffness": "stiffness"}[kind]
    return {s.name: solution.estimate.found[f"{s.name}.{kind}"] / getattr(s, field) - 1
            for s in robot.springs if f"{s.name}.{kind}" in solution.estimate.found}  # fmt: skip


def test_power_through_a_gear_is_that_of_its_own_spring():
    """With the model's own response, what the rotor leaves over is what bends the spring."""
    robot = two_joint_robot()
    frf = loaded_frf(robot, 3.0)
    model = rest_model(robot, frf, ElasticOptions(), DELAY_S)
    values = nominal_parameters(robot, model, DELAY_S)
    bare = response(model, values, FREQUENCY_HZ, None)
    deflection = bare.inputs[:, :, 2:4] @ frf.input_amplitude * frf_hold()[:, None, None]
    dynamic = values.stiffness[:2] + 2j * np.pi * FREQUENCY_HZ[:, None] * values.damping[:2]
    wanted = 2 * (np.abs(dynamic[..., None] * deflection) ** 2).mean(axis=-1)
    found = spring_load(robot, frf, values)
    # What differs are the aliases of the held response, at the highest lines.
    np.testing.assert_allclose(found.power[:, :20, :2], wanted[:, :20], rtol=1e-3)
    assert not found.power[..., 2:].any()
    assert (model.rest.shape == 1).all(), "nothing swings where no spring is cubic or free to be"
    shape = rest_model(robot, frf, ElasticOptions(free=CUBIC), DELAY_S).rest.shape
    assert (shape[:, 2:] == 1).all()
    # Lines that are not odd only let the square of the swing mix in, by chance with either sign.
    assert (np.abs(shape[:, :2] - 0.9) < 0.4).all()


def frf_hold():
    half = np.pi * FREQUENCY_HZ * 1e-3
    return np.sinc(half / np.pi) * np.exp(-1j * half)


@pytest.mark.parametrize("statics", ["updates", pytest.param("every_iterate", marks=pytest.mark.slow)])
def test_cubic_gears_come_back_from_two_amplitudes(statics):
    nominal = floor_standing()
    true = stiffened(with_spring_factors(nominal, 1.2, 0.9), 200.0, 100.0)
    frfs = [loaded_frf(true, torque) for torque in (1.0, 0.3)]
    options = ElasticOptions(free=CUBIC, statics=statics, statics_updates=10, prior_decades=3)
    solution = fit_elastic(nominal, join(frfs, ("high", "low")), options, DELAY_S)
    for kind in ("cubic", "stiffness"):
        assert max(map(abs, relative_errors(solution, true, kind).values())) < RECOVERY
    robot = fitted_robot(nominal, solution.estimate)
    assert robot.springs[1].cubic == solution.estimate.found["gear_2.cubic"]
    fitted = fitted_model(nominal, solution, frfs[1], options, DELAY_S)
    found = fitted.problem.model_response(fitted.internal)
    np.testing.assert_allclose(found, frfs[1].response, rtol=1e-3)


def test_a_gear_without_gravity_torque_needs_a_second_amplitude():
    true = stiffened(floor_standing(), 200.0, 100.0)
    frfs = [loaded_frf(true, torque, CONFIGURATIONS[:2]) for torque in (1.0, 0.3)]
    options = ElasticOptions(free=CUBIC)
    one = fit_elastic(floor_standing(), frfs[0], options, DELAY_S)
    two = fit_elastic(floor_standing(), join(frfs, ("high", "low")), options, DELAY_S)
    one, two = one.estimate, two.estimate
    index = one.names.index("gear_1.cubic")
    assert not one.identifiable[index]
    assert two.identifiable[index]
    assert "gear_1.cubic" in " ".join(one.undetermined)
    assert two.covariance[index, index] < 0.1 * one.covariance[index, index]


def test_location_comes_back():
    nominal = two_joint_robot()
    true = with_springs_at(nominal, {"forearm": np.array([0.36, 0.0, 0.0])})
    frf = exact_frf(true, CONFIGURATIONS, FREQUENCY_HZ, delay_s=DELAY_S)
    options = ElasticOptions(free=("stiffness", "location"), statics_updates=10)
    solution = fit_elastic(nominal, frf, options, DELAY_S)
    assert solution.estimate.names[-2:] == ("forearm.location_x", "forearm.location_y")
    np.testing.assert_allclose(solution.estimate.value[-2:], [0.36, 0.0], atol=RECOVERY)
    np.testing.assert_allclose(
        fitted_robot(nominal, solution.estimate).springs[3].point_m, [0.36, 0.0, 0.0], atol=RECOVERY
    )


def test_tied_springs_move_together_and_a_bound_holds():
    nominal = two_joint_robot()
    true = with_spring_factors(nominal, [1.4, 1.2, 1.2, 0.9])
    frf = exact_frf(true, CONFIGURATIONS, FREQUENCY_HZ, delay_s=DELAY_S)
    tied = {"bearing_1.stiffness": "gear_2.stiffness"}
    options = ElasticOptions(free=("stiffness",), tied=tied, statics_updates=6)
    solution = fit_elastic(nominal, frf, options, DELAY_S)
    assert solution.estimate.tied.names == ("bearing_1.stiffness",)
    for spring, wanted in zip(fitted_robot(nominal, solution.estimate).springs, true.springs, strict=True):
        assert spring.stiffness == pytest.approx(wanted.stiffness, rel=RECOVERY)
    held = replace(options, bounds={"gear_1.stiffness": (1e4, 2.5e4)})
    solution = fit_elastic(nominal, frf, held, DELAY_S)
    assert solution.estimate.found["gear_1.stiffness"] == pytest.approx(2.5e4)
    assert solution.estimate.status == "converged"
    assert "ended at a bound" in solution.estimate.advice
    assert "gear_1.stiffness" in solution.estimate.advice


@pytest.mark.parametrize("estimator", ["lls", "nls"])
def test_derivative_of_the_residual_by_loaded_and_tied_parameters(estimator):
    robot = stiffened(two_joint_robot(), 500.0, 800.0)
    frf = loaded_frf(robot, 4.0)
    options = ElasticOptions(
        estimator=estimator,
        weights=Weights("user"),
        free=("stiffness", "damping", "cubic", "location", "delay"),
        tied={"forearm.damping": "gear_1.damping", "gear_2.stiffness": "gear_1.stiffness"},
    )
    model = rest_model(robot, frf, options, DELAY_S)
    parameters = map_parameters(robot, nominal_parameters(robot, model, DELAY_S), options, (), np.zeros(0))
    problem = make_problem(frf, model, parameters, options)[0]
    point = np.random.default_rng(2).uniform(-0.02, 0.02, len(parameters.names))
    derivative = problem.linear(point)[1]
    for index in range(point.size):
        step = np.zeros(point.size)
        step[index] = 2e-5
        ends = [problem.residual(point + f * step, problem.model_response(point + f * step)) for f in (1, -1, 2, -2)]
        difference = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * 2e-5)
        np.testing.assert_allclose(
            -derivative[..., index], difference, atol=FINITE_DIFFERENCE * np.abs(difference).max()
        )


def test_a_response_without_its_torque_is_refused_for_cubic_gears():
    frf = exact_frf(two_joint_robot(), CONFIGURATIONS, FREQUENCY_HZ)
    with pytest.raises(DataError, match="torques of its experiments") as caught:
        fit_elastic(two_joint_robot(), frf, ElasticOptions(free=CUBIC), DELAY_S)
    assert "estimate the response again" in caught.value.remedy
