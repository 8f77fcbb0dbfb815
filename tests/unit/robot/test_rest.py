"""Springs under load: closed forms, and derivatives through the equilibrium against the whole chain."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import sensed_everywhere, two_joint_robot
from robid.robot.derivatives import expand, jacobian, with_springs_at
from robid.robot.description import LOCATED
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.robot.rest import Rest, SpringValues, settle_springs, swing_of
from tolerances import FINITE_DIFFERENCE, IDENTITY

FREQUENCY_HZ = np.array([2.0, 7.0, 11.0, 17.0, 29.0, 47.0, 83.0])
CONFIGURATIONS = np.array([[-0.3, 0.5], [0.9, 1.2]])
OUTPUTS = ("shoulder", "elbow", "tip", "felt")
KINDS = ("stiffness", "damping", "cubic", "location")
PERIOD_S = 1e-3


def stiffening(robot, per_rad2=300.0):
    """The robot with cubic gears; it deflects some ten milliradians under gravity."""
    springs = tuple(
        replace(spring, cubic=per_rad2 * spring.stiffness) if spring.place == "transmission" else spring
        for spring in robot.springs
    )
    return replace(robot, springs=springs)


def excited(model, n_spring):
    """The model with a torque through its first two springs, the gears."""
    power = np.zeros((len(CONFIGURATIONS), 3, n_spring))
    power[:, :, :2] = np.array([[900.0, 400.0], [2500.0, 100.0], [400.0, 225.0]])
    omega = 2 * np.pi * np.array([3.0, 9.0, 20.0])
    return replace(model, rest=replace(model.rest, power=power, omega=omega, shape=0.8 + 0 * model.rest.shape))


def settled(robot):
    """The model where it rests while it swings, the statics solved until nothing moves, and what it was made of."""
    elastic = build_model(robot)
    rest = solve_statics(elastic, CONFIGURATIONS)
    for _ in range(5):
        model = excited(linearize(elastic, rest, OUTPUTS), len(robot.springs))
        values = nominal_parameters(robot, model, 0.0).springs
        swing = swing_of(model.rest, values, settle_springs(model.rest, values).stiffness)
        rest = solve_statics(elastic, CONFIGURATIONS, variance=swing.variance)
    return excited(linearize(elastic, rest, OUTPUTS), len(robot.springs)), elastic, rest


def changed(robot, kind, index, by):
    if kind == "location":
        spring = robot.springs[index // 3]
        return with_springs_at(robot, {spring.name: spring.point_m + by * np.eye(3)[index % 3]})
    field = {"stiffness": "stiffness", "damping": "damping", "cubic": "cubic"}[kind]
    springs = list(robot.springs)
    springs[index] = replace(springs[index], **{field: getattr(springs[index], field) + by})
    return replace(robot, springs=tuple(springs))


def step_of(robot, kind, index):
    if kind == "location":
        return 4e-4
    spring = robot.springs[index]
    size = {"stiffness": spring.stiffness, "damping": spring.damping, "cubic": spring.cubic}
    return 1e-3 * size[kind] or 15.0 * spring.stiffness


@pytest.mark.parametrize("kind", KINDS)
def test_derivative_through_the_equilibrium_is_that_of_the_whole_chain(kind):
    robot = stiffening(sensed_everywhere())
    model, elastic, rest = settled(robot)
    places = [spring.place for spring in robot.springs]
    located = np.array([3 * row + axis for row, place in enumerate(places) if place in LOCATED for axis in range(3)])
    model = expand(elastic, rest, model, OUTPUTS, located)
    parameters = nominal_parameters(robot, model, 1e-3)
    here = response(model, parameters, FREQUENCY_HZ, PERIOD_S)
    found = jacobian(model, parameters, here, (kind,))

    def chain(index, by):
        other = changed(robot, kind, index, by)
        fresh = settled(other)[0]
        return response(fresh, nominal_parameters(other, fresh, 1e-3), FREQUENCY_HZ, PERIOD_S).sampled

    chosen = {"location": located[[0, 3, 5, 6, 7, 9]], "cubic": range(4)}
    for index in chosen.get(kind, range(len(places))):
        step = step_of(robot, kind, index)
        ends = [chain(index, factor * step) for factor in (1, -1, 2, -2)]
        difference = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12 * step)
        error = np.abs(found[..., index] - difference).max(axis=1)
        assert (error <= FINITE_DIFFERENCE * np.abs(difference).max(axis=1)).all()


def lone_spring(torque, power=(0.0,), stiffness=1e6, per_rad2=5e4, damping=300.0, shape=1.0):
    """One spring under a constant torque and swinging ones of these powers from 10 Hz upwards, and how it rests."""
    rest = Rest(
        deflection=np.zeros((1, 1)),
        torque=np.array([[-torque]]),
        gradient=np.zeros((1, 1, 1)),
        location=np.zeros(3),
        power=np.reshape(power, (1, -1, 1)),
        omega=20 * np.pi * np.arange(1.0, len(power) + 1),
        shape=np.array([[shape]]),
        factor=np.ones((1, 1)),
    )
    values = SpringValues(np.array([stiffness]), np.array([per_rad2 * stiffness]), np.array([damping]), np.zeros(3))
    return rest, values, settle_springs(rest, values)


def test_a_loaded_spring_shows_its_slope():
    found = lone_spring(torque=4000.0)[2]
    roots = np.roots([5e10, 0.0, 1e6, -4000.0])
    deflection = roots[np.abs(roots.imag) < 1e-9].real
    np.testing.assert_allclose(found.deflection[0], deflection, rtol=IDENTITY)
    np.testing.assert_allclose(found.stiffness[0], 1e6 + 3 * 5e10 * deflection**2, rtol=IDENTITY)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_a_swinging_spring_shows_the_slope_of_its_regression(count):
    """Sinusoids written out over a grid of all their phases: mean torque, and torque regressed on the deflection."""
    power = np.array([1500.0, 900.0, 1200.0])[:count] ** 2
    shape = 1 - 0.5 * (power**2).sum() / power.sum() ** 2
    rest, values, found = lone_spring(2500.0, power, damping=0.0, shape=shape)
    slope, mean = found.stiffness[0, 0], found.deflection[0, 0]
    phases = 2 * np.pi * np.arange(8) / 8
    swing = sum(np.meshgrid(*(np.sqrt(2 * each) / slope * np.cos(phases) for each in power))).ravel()
    torque = 1e6 * (mean + swing) + 5e10 * (mean + swing) ** 3
    assert torque.mean() == pytest.approx(2500.0, rel=IDENTITY)
    assert slope == pytest.approx((torque * swing).mean() / (swing**2).mean(), rel=IDENTITY)
    assert swing_of(rest, values, found.stiffness).variance[0, 0] == pytest.approx((swing**2).mean(), rel=IDENTITY)
    assert slope > 1.2e6


def test_a_spring_that_gives_way_is_not_finite():
    assert not np.isfinite(lone_spring(torque=4000.0, per_rad2=-1e5)[2].stiffness).any()


def test_linear_springs_rest_where_gravity_left_them():
    robot = two_joint_robot()
    model = linearize(build_model(robot), solve_statics(build_model(robot), CONFIGURATIONS))
    parameters = nominal_parameters(robot, model, 0.0)
    loaded = excited(model, 4)
    np.testing.assert_array_equal(
        response(loaded, parameters, FREQUENCY_HZ, PERIOD_S).sampled,
        response(model, parameters, FREQUENCY_HZ, PERIOD_S).sampled,
    )
    springs = settle_springs(loaded.rest, parameters.springs)
    np.testing.assert_allclose(springs.deflection, model.rest.deflection, rtol=IDENTITY, atol=1e-15)
