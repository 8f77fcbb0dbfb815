"""A drive whose torque acts, or whose angle is read, a sample later than the others': named, and gone where freed."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from finite_differences import check_derivatives
from robid.models.elastic.fit.fitting import fit_elastic, set_up
from robid.models.elastic.fit.nuisance.wording import free_with
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.causes import explain
from robid.models.elastic.judge.fitted import fitted_model

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
OPTIONS, DELAY_S, PERIOD_S = ElasticOptions(), 1e-3, 1e-3


def measured(of, motor, late_s=PERIOD_S):
    """Responses of a robot one of whose motors is late, by its torque or its angle: a column or a row turns."""
    robot = with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])
    frf = exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5)
    turned = np.exp(-2j * np.pi * FREQUENCY_HZ[:, None, None] * late_s * (np.arange(2) == motor))
    return replace(frf, response=frf.response * (turned if of == "torque" else turned.swapaxes(1, 2)))


@pytest.mark.parametrize(("of", "motor", "late_s"), [("torque", 1, PERIOD_S), ("angle", 0, PERIOD_S)])
def test_a_late_drive_is_named_with_its_samples_and_gone_where_it_is_freed(of, motor, late_s):
    robot, frf = two_joint_robot(), measured(of, motor, late_s)
    before = fit_elastic(robot, frf, OPTIONS, DELAY_S)
    found = explain(fitted_model(robot, before, frf, OPTIONS, DELAY_S))
    assert found[0].cause == "delay"
    assert (found[0].units[0], found[0].free) == ("samples", (f"{robot.joints[motor].name}.late_{of}",))
    assert found[0].amounts[0] == pytest.approx(1.0, rel=0.1)
    grade = assess_fit(robot, before, frf, OPTIONS, DELAY_S)
    assert "delay" in grade.causes
    options = replace(OPTIONS, free=free_with(OPTIONS.free, found[0].free))
    after = fit_elastic(robot, frf, options, DELAY_S)
    assert after.costs.total < 1.2 * after.costs.expected.sum() < 0.2 * before.costs.total
    assert after.estimate.found[found[0].free[0]] == pytest.approx(1e6 * late_s, rel=0.05)
    assert after.estimate.found["delay"] == pytest.approx(DELAY_S, rel=0.05)
    gears = [after.estimate.found[f"gear_{number}.stiffness"] for number in (1, 2)]
    np.testing.assert_allclose(gears, [2.6e4, 4.8e3], rtol=0.02)


def test_derivatives_by_late_drives_are_those_of_the_response():
    options = ElasticOptions(free=("shoulder.late", "elbow.late_torque", "elbow.torque_constant"))
    problem = set_up(two_joint_robot(), measured("torque", 1), options, DELAY_S)[0]
    rows = [index for index, name in enumerate(problem.parameters.names) if ".late_" in name or "constant" in name]
    assert len(rows) == 4
    check_derivatives(problem, rows)
