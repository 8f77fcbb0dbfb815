"""Machines whose motors do not move each other: what the model has exactly nothing of counts for nothing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exact_systems import exact_frf
from robid.frf.residual import RESIDUALS
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.assessment import assess_fit, uncoupled_findings
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.known import load_experiment

GANTRY = load_experiment(Path(__file__).parents[5] / "configs" / "gantry.yaml").robot.to_robot()
FREQUENCY_HZ = np.geomspace(2, 60, 25)
DELAY_S = 1e-3


def with_gears_alone(robot=GANTRY):
    return replace(robot, springs=tuple(spring for spring in robot.springs if spring.place == "transmission"))


def measured(robot, noise=0.003):
    share = np.random.default_rng(1).uniform(0.1, 0.9, (5, len(robot.joints)))
    places = robot.lower + (robot.upper - robot.lower) * share
    frf = exact_frf(robot, places, FREQUENCY_HZ, delay_s=DELAY_S)
    level = noise * np.median(np.abs(np.diagonal(frf.response, axis1=2, axis2=3)), axis=(0, 1))
    real, imaginary = np.random.default_rng(2).standard_normal((2, *frf.response.shape)) / np.sqrt(2)
    covariance = np.broadcast_to(np.diag(level**2 + 0j), (*frf.response.shape[:2], len(level), len(level)))
    return replace(
        frf,
        response=frf.response + level[:, None] * (real + 1j * imaginary),
        total_covariance=covariance,
        total_degrees_of_freedom=1e6,
    )


def softer(robot):
    springs = tuple(replace(spring, stiffness=0.8 * spring.stiffness) for spring in robot.springs)
    return replace(robot, springs=springs)


@pytest.mark.parametrize("estimator", RESIDUALS)
def test_axes_that_do_not_move_each_other_are_fitted(estimator):
    robot = with_gears_alone()
    frf = measured(softer(robot))
    options = ElasticOptions(estimator=estimator, starts=2)
    solution = fit_elastic(robot, frf, options, DELAY_S)
    estimate = solution.estimate
    assert estimate.status == "converged"
    stiffness = np.array([kind == "stiffness" for kind in estimate.kinds])
    np.testing.assert_allclose(estimate.value[stiffness], 0.8 * estimate.nominal[stiffness], rtol=5e-3)
    assert (estimate.lower <= estimate.value + 1e-12).all()
    if RESIDUALS[estimator].parts == 2:  # magnitudes alone leave the phases of motors that do not move each other open
        assert assess_fit(robot, solution, frf, options, DELAY_S).findings == ()


def test_motion_that_the_model_cannot_have_is_doubted():
    robot = with_gears_alone()
    frf = measured(softer(GANTRY))
    options = ElasticOptions(starts=1)
    solution = fit_elastic(robot, frf, options, DELAY_S)
    (finding,) = uncoupled_findings(fitted_model(robot, solution, frf, options, DELAY_S))
    assert finding.cause == "missing_spring"
    assert "the torque of y moves z by 14 %" in finding.message  # 2.55 over the root of 135 times 968, and as much back
    assert finding.strength == pytest.approx(13.5, abs=1)
    assert "missing_spring" in [each.cause for each in assess_fit(robot, solution, frf, options, DELAY_S).findings]
