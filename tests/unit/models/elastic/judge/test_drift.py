"""Viscous friction that drifts over a campaign: named by its motor, and gone where it is freed."""

import re
from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from finite_differences import check_derivatives
from robid.arrays import part_of
from robid.models.elastic.fit.fitting import fit_elastic, set_up
from robid.models.elastic.fit.nuisance.wording import free_with
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.causes import explain
from robid.models.elastic.judge.fitted import fitted_model

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
OPTIONS, DELAY_S = ElasticOptions(), 1e-3
FIRST, LAST = 0.02, 0.01  # N m s/rad: half of it is left when the robot is warm
LITTLE, NEARLY_NONE = 0.001, 1e-4  # friction, N m s/rad, and relative noise under which no element shows its drift


def rubbing(viscous):
    """The arm with viscous friction in its first motor."""
    robot = two_joint_robot()
    shoulder, elbow = robot.joints
    friction = replace(shoulder.motor.friction, viscous_nms_rad=viscous)
    return replace(robot, joints=(replace(shoulder, motor=replace(shoulder.motor, friction=friction)), elbow))


def measured(first=FIRST, last=LAST, noise=0.002):
    """Each configuration is measured with what friction is left there, all of them with noise of one covariance."""
    levels = np.linspace(first, last, len(PLACES))
    parts = [
        exact_frf(rubbing(level), place, FREQUENCY_HZ, delay_s=DELAY_S).response
        for level, place in zip(levels, PLACES, strict=True)
    ]
    clean, noisy = (
        exact_frf(rubbing(first), PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=each) for each in (0.0, noise)
    )
    return replace(noisy, response=np.concatenate(parts) + noisy.response - clean.response)


def test_friction_that_halves_over_a_campaign_is_named_and_gone_where_it_is_freed():
    stated, frf = rubbing(FIRST), measured()
    before = fit_elastic(stated, frf, OPTIONS, DELAY_S)
    found = explain(fitted_model(stated, before, frf, OPTIONS, DELAY_S))
    assert (found[0].cause, found[0].free) == ("unsteady", ("shoulder.drift",))
    options = replace(OPTIONS, free=free_with(OPTIONS.free, found[0].free))
    after = fit_elastic(stated, frf, options, DELAY_S)
    assert after.costs.total < 1.2 * after.costs.expected.sum() < 0.5 * before.costs.total
    rotor = 20 * np.pi * stated.joints[0].motor.inertia_kgm2
    assert after.estimate.found["shoulder.drift"] == pytest.approx(100 * 0.5 * (LAST - FIRST) / rotor, rel=0.05)
    assert after.estimate.found["shoulder.viscous"] == pytest.approx(0.5 * (FIRST + LAST), rel=0.05)


def graded(frf, **options):
    stated, chosen = rubbing(LITTLE), replace(OPTIONS, **options)
    return assess_fit(stated, fit_elastic(stated, frf, chosen, DELAY_S), frf, chosen, DELAY_S)


@pytest.mark.parametrize("last", [0.85, 1.15])
def test_a_drift_that_hardly_an_element_shows_is_told_with_its_size_and_costs_no_trust(last):
    """A fit by itself predicts at best; its validation takes the findings over."""
    frf = measured(LITTLE, last * LITTLE, NEARLY_NONE)
    grade = graded(frf)
    assert grade.causes == ("unsteady",)
    assert grade.strength[0] < 1
    assert len(grade.reasons) == 1  # that it was not validated
    growth = float(re.search(r": shoulder ([+-]\d+) % from", grade.messages[0])[1])
    assert growth == pytest.approx(100 * (last - 1) / (0.5 + 0.5 * last), rel=0.15)
    assert not graded(frf, free=("unsteady",)).causes


@pytest.mark.parametrize("last", [0.94, 1.0, 1.06])
def test_nothing_is_said_of_friction_that_stays_or_hardly_changes(last):
    assert not graded(measured(2 * LITTLE, 2 * LITTLE * last, NEARLY_NONE)).causes


def test_so_few_configurations_show_no_drift():
    few = part_of(measured(LITTLE, 0.6 * LITTLE, NEARLY_NONE), "configuration", np.arange(3))
    assert "unsteady" not in graded(few).causes


def test_derivatives_by_drift_are_those_of_the_response():
    options = ElasticOptions(free=("shoulder.drift", "gear_1.one_sided"))
    problem = set_up(two_joint_robot(), measured(), options, DELAY_S)[0]
    rows = [problem.parameters.names.index(name) for name in ("shoulder.drift", "gear_1.one_sided")]
    check_derivatives(problem, rows)
