"""Fits of data that no sensible robot gives: a delay of many samples is found, springs that give way end the fit."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.errors import DataError
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.rest_model import rest_model
from robid.models.elastic.judge.assessment import assess_fit
from tolerances import RECOVERY

FREQUENCY_HZ = np.geomspace(1, 60, 30)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2]])


def test_a_delay_of_many_samples_costs_no_spring():
    true = with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])
    frf = exact_frf(true, PLACES, FREQUENCY_HZ, delay_s=24e-3)
    found = fit_elastic(two_joint_robot(), frf, ElasticOptions(), 1e-3)
    stiffness = [spring.stiffness for spring in true.springs]
    assert found.estimate.status == "converged"
    np.testing.assert_allclose(found.estimate.value[:4], stiffness, rtol=RECOVERY)
    np.testing.assert_allclose(found.estimate.found["delay"], 24e-3, rtol=RECOVERY)


def test_springs_that_give_way_under_gravity_end_a_fit_without_an_error():
    floating = replace(
        with_spring_factors(two_joint_robot(), [0.01, 0.01, 1, 1], [0.03, 0.03, 1, 1]), gravity_m_s2=np.zeros(3)
    )
    frf = exact_frf(floating, PLACES, FREQUENCY_HZ, delay_s=1e-3, relative_noise=0.003, seed=3)
    robot, options = two_joint_robot(), ElasticOptions()
    with pytest.raises(DataError, match="D205"):
        rest_model(with_spring_factors(robot, [0.01, 0.01, 1, 1]), frf, options, 1e-3)
    found = fit_elastic(robot, frf, options, 1e-3)
    assert found.estimate.status == "stalled"
    assert "give way under gravity" in found.estimate.advice
    assert np.isfinite(found.costs.total)
    at = with_spring_factors(robot, found.estimate.value[:4] / found.estimate.nominal[:4])
    assert np.isfinite(rest_model(at, frf, options, 1e-3).mass).all()
    grade = assess_fit(robot, found, frf, options, 1e-3)
    assert grade.value == 0
    assert "the fit has not converged" in grade.reasons


def test_a_robot_file_whose_springs_give_way_is_refused():
    soft = with_spring_factors(two_joint_robot(), 0.001)
    frf = exact_frf(two_joint_robot(), PLACES, FREQUENCY_HZ, delay_s=1e-3)
    with pytest.raises(DataError, match="D205"):
        fit_elastic(soft, frf, ElasticOptions(), 1e-3)
