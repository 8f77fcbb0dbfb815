"""What moves the middle of a physical interval away from the estimate: its parts add up, and it goes without them."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.middles import middle_rows
from robid.models.elastic.page.middles import middle_section, middle_sentence

FREQUENCY_HZ = np.geomspace(1, 60, 30)
PLACES = np.array([[-0.3, 0.5], [0.4, -0.8], [0.9, 1.2], [-1.1, 0.3], [0.2, 1.6], [1.3, -0.4]])
GEARS = [0, 1]


def _fitted(**nuisance_std):
    robot = two_joint_robot()
    frf = exact_frf(robot, PLACES, FREQUENCY_HZ, relative_noise=1e-3, seed=3)
    # What the robot file says of gears is the robot's, unless a joint says otherwise.
    joints = (replace(each, nuisance_std=replace(each.nuisance_std, **nuisance_std)) for each in robot.joints)
    robot = replace(robot, joints=tuple(joints), nuisance_std=replace(robot.nuisance_std, **nuisance_std))
    return fit_elastic(robot, frf, ElasticOptions(starts=1), 0.0)


@pytest.fixture(scope="module")
def solution():
    return _fitted()


def _moved(solution):
    estimate = solution.estimate
    return np.log(estimate.physical_value[GEARS] / estimate.value[GEARS])


def test_what_moves_a_middle_adds_up_to_its_distance_from_the_estimate(solution):
    assert np.all(_moved(solution) < -0.02)
    np.testing.assert_allclose(solution.doubts.moves[GEARS].sum(axis=1), _moved(solution), atol=0.005)


def test_a_middle_that_one_nuisance_moves_goes_back_without_it(solution):
    # Hysteresis stiffens a gear, never the other way: its prior is one-sided.
    without = _moved(_fitted(loss_factor=0.0))
    hysteresis = ["hysteresis" in name for name in solution.doubts.names]
    predicted = solution.doubts.moves[GEARS][:, hysteresis].sum(axis=1)
    np.testing.assert_allclose(_moved(solution) - without, predicted, atol=0.005)


def test_the_nuisance_that_moves_a_middle_most_is_named_with_what_would_tell(solution):
    rows = {row.name: row for row in middle_rows(solution)}
    for name in ("gear_1.stiffness", "gear_2.stiffness"):
        assert rows[name].by[0][1] == "gear_nonlinearity"
        assert rows[name].by[0][2] < 0
        assert rows[name].settled_by
        assert name in middle_sentence(list(rows.values()))
    (section,) = middle_section(list(rows.values()))
    assert [row[0] for row in section.tables[0].rows] == list(rows)


def test_an_estimate_outside_its_interval_is_said_to_be(solution):
    estimate = solution.estimate
    upper = np.where(np.arange(estimate.upper.size) == 0, 0.999 * estimate.value, estimate.upper)
    rows = middle_rows(replace(solution, estimate=replace(estimate, upper=upper)))
    assert [row.name for row in rows if row.outside] == ["gear_1.stiffness"]


def test_where_nothing_moves_middles_nothing_is_said(solution):
    still = replace(solution.doubts, moves=0 * solution.doubts.moves)
    assert middle_rows(replace(solution, doubts=still)) == ()
    assert middle_rows(replace(solution, doubts=None)) == ()
    assert middle_sentence(()) == ""
    assert middle_section(()) == ()
