"""A defect that is most of a small residual is named with its amount, before other configurations show it."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.wording import free_with
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.grading import is_unexplained
from robid.robot.zeros import with_zeros

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, 0.8], [0.9, 1.2], [-1.1, 0.3], [0.2, 1.0]])
OPTIONS, DELAY_S = ElasticOptions(), 1e-3
FEW_TENTHS_DEG, HUNDREDTHS_DEG = 0.35, 0.05
STATED, REAL = 0.02, 1e-4  # relative noise: covariances count what differs from excitation to excitation, too


def judged(zero_deg, **options):
    robot, chosen = two_joint_robot(), replace(OPTIONS, **options)
    truth = with_zeros(robot, {"elbow": zero_deg})
    stated, real = (
        exact_frf(truth, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=noise, seed=5)
        for noise in (STATED, REAL)
    )
    frf = replace(stated, response=real.response)
    solution = fit_elastic(robot, frf, chosen, DELAY_S)
    assert not is_unexplained(solution)  # no element is far enough off to count
    return assess_fit(robot, solution, frf, chosen, DELAY_S)


@pytest.mark.parametrize("zero_deg", [-FEW_TENTHS_DEG, FEW_TENTHS_DEG])
def test_a_zero_that_is_most_of_a_residual_that_is_small_is_named_and_gone_where_it_is_freed(zero_deg):
    found = judged(zero_deg)
    assert found.causes[0] == "zero"
    assert float(found.messages[0].partition("zero of elbow ")[2].split()[0]) == pytest.approx(zero_deg, rel=0.1)
    assert max(found.strength) < 1
    assert not judged(zero_deg, free=free_with(OPTIONS.free, ("elbow.zero",))).causes


@pytest.mark.parametrize("zero_deg", [0.0, HUNDREDTHS_DEG])
def test_nothing_is_said_of_a_robot_that_is_as_its_file_or_nearly(zero_deg):
    assert not judged(zero_deg).causes
