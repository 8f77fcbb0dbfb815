"""The repeated response of collocated motors against the general one, and when it applies."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import sensed_everywhere, springs_everywhere, two_joint_robot
from robid.robot.collocated import Collocated, is_collocated
from robid.robot.derivatives import jacobian
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.parameters import DIRECT
from robid.robot.response import nominal_parameters, response
from tolerances import IDENTITY

CONFIGURATIONS = np.array([[-0.3, 0.5], [0.9, 1.2], [0.1, -0.4]])
FREQUENCY_HZ = np.array([2.0, 5.0, 9.0, 14.0, 27.0])
USED = np.array([[True] * 5, [False] * 5, [True, False, True, False, True]])


def linear_of(robot, names=None):
    model = build_model(robot)
    return linearize(model, solve_statics(model, CONFIGURATIONS), names)


def moved_parameters(robot, model, seed):
    generator = np.random.default_rng(seed)
    nominal = nominal_parameters(robot, model, 1.3e-3)
    kinds = ("stiffness", "damping", "motor_inertia", "link_inertia", "delay")
    moved = {
        kind: getattr(nominal, kind) * np.exp(generator.uniform(-1, 1, getattr(nominal, kind).size)) for kind in kinds
    }
    return replace(nominal, viscous=generator.uniform(0, 0.01, 2), arm_viscous=generator.uniform(0, 50, 2), **moved)


@pytest.mark.parametrize(("period_s", "rate"), [(None, 1), (1e-3, 0), (1e-2, 0), (4e-3, 1), (4e-3, 2), (4e-3, None)])
@pytest.mark.parametrize("kinds", [DIRECT, ("stiffness", "damping")])
@pytest.mark.parametrize("robot", [two_joint_robot(), springs_everywhere()], ids=["few springs", "many springs"])
def test_response_and_derivatives_are_the_general_ones(robot, kinds, period_s, rate):
    model = replace(linear_of(robot), rates=(rate, rate))
    ours = Collocated(model, FREQUENCY_HZ, period_s, USED, kinds)
    for seed in range(2):
        values = moved_parameters(robot, model, seed)
        whole = response(model, values, FREQUENCY_HZ, period_s)
        rows, columns = np.triu_indices(2)
        expected = whole.sampled[USED][:, rows, columns].T
        np.testing.assert_allclose(ours.response(values), expected, rtol=IDENTITY)
        slopes = jacobian(model, values, whole, kinds)[USED][:, rows, columns]
        masks = tuple(np.ones(getattr(values, kind).size, bool) for kind in kinds)
        found = ours.derivatives(kinds, masks, np.full(expected.shape, 2j))
        size = np.abs(slopes).max(axis=(0, 1))
        np.testing.assert_allclose(np.moveaxis(found, 0, -1).swapaxes(0, 1) / size / 2j, slopes / size, atol=IDENTITY)


def test_derivatives_need_a_response():
    ours = Collocated(linear_of(two_joint_robot()), FREQUENCY_HZ, None, USED, ("stiffness",))
    with pytest.raises(ValueError, match="there was none"):
        ours.derivatives(("stiffness",), (np.ones(4, bool),), np.ones((3, 8), complex))


def test_other_outputs_are_not_collocated():
    robot = sensed_everywhere()
    assert is_collocated(linear_of(robot))
    assert not is_collocated(replace(linear_of(robot), rates=(0, 1)))  # one speed and one angle are not reciprocal
    assert not is_collocated(linear_of(robot, ("shoulder", "elbow.arm")))
    assert not is_collocated(linear_of(robot, ("elbow", "shoulder")))
    assert not is_collocated(linear_of(robot, ("shoulder", "elbow", "felt")))
