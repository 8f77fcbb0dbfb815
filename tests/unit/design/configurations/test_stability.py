"""Choices repeated with other data, and what a visit costs."""

import numpy as np
import pytest

from exact_systems import two_joint_robot
from robid.design.configurations.candidates import visit_cost_s
from robid.design.configurations.information import design_configurations
from robid.design.configurations.options import DesignOptions
from robid.design.configurations.stability import Trial, halves, stability
from tolerances import IDENTITY

NAMES = ("a", "b")


@pytest.mark.parametrize(("n_real", "ways"), [(1, 0), (3, 0), (4, 3), (5, 3), (6, 3)])
def test_halves_share_nothing_and_leave_nothing_out(n_real, ways):
    found = halves(n_real)
    assert len({first for first, _ in found}) == len(found) == ways
    for first, second in found:
        assert sorted((*first, *second)) == list(range(n_real))
        assert min(len(first), len(second)) >= 2


def design_by(matrices, options):
    return design_configurations(matrices, np.zeros((len(matrices), 1)), NAMES, options)


def test_the_same_information_chooses_the_same():
    generator = np.random.default_rng(1)
    root = generator.standard_normal((12, 2, 3))
    matrices, options = root @ root.swapaxes(1, 2), DesignOptions(count=3)
    design = design_by(matrices, options)
    found = stability("draws", [Trial(matrices, 5 * matrices)], design, options)
    np.testing.assert_array_equal(found.kept, 1)
    np.testing.assert_allclose(found.efficiency, design.efficiency, rtol=1e-6)
    np.testing.assert_array_equal(np.flatnonzero(found.chosen_often), design.chosen)


def test_a_choice_by_misleading_information_is_worth_what_is_true_of_it():
    # Candidates see one parameter each: truly the first two best, in the trial the last two.
    true = np.array([np.diag(each) for each in ([4.0, 0.0], [0.0, 4.0], [1.0, 0.0], [0.0, 1.0])])
    options = DesignOptions(count=2)
    design = design_by(true, options)
    found = stability("realizations", [Trial(true[[2, 3, 0, 1]], true)], design, options)
    np.testing.assert_array_equal(design.chosen, [0, 1])
    np.testing.assert_array_equal(found.kept, 0)
    np.testing.assert_allclose(found.efficiency, 0.25, rtol=1e-6)
    np.testing.assert_allclose(found.chosen_often, [0, 0, 1, 1], rtol=IDENTITY)


def test_the_joint_that_needs_longest_decides_the_way():
    robot = two_joint_robot()
    speed = np.array([joint.motor.max_speed_rad_s / joint.motor.gear_ratio for joint in robot.joints])
    angles = np.array([[0.1, 0.2], [0.1, 0.2], [0.1 + 2 * speed[0], 0.2 - speed[1]]])
    np.testing.assert_allclose(visit_cost_s(robot, angles, 30.0, 0.25), [30, 30, 38], rtol=IDENTITY)
