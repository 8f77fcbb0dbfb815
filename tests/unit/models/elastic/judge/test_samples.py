"""Speeds whose samples are not what was stated are told by what they would be."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_mass_robot, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.judge.causes import explain
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.reversals import try_samples
from robid.signals.quantities import Channel

OPTIONS = ElasticOptions(free=("stiffness", "damping"), weights=Weights("user"))
ROBOT = two_mass_robot(stiffness=700.0, damping=0.05)
DELAY_S = 1e-3


def said(frf, stated, sampled="difference"):
    """A response of positions as that of their differences, which are said to be something else."""
    omega, period_s = 2 * np.pi * frf.frequency_hz, frf.sampling_period_s
    wrong, right = (Channel("drive", "speed", "rad/s", "motor", each) for each in (stated, sampled))
    factor = wrong.to_acceleration(omega, period_s) / right.to_acceleration(omega, period_s)
    return replace(frf, response=frf.response * factor[:, None, None], measured_channels=(wrong,))


def fitted(frf):
    solution = fit_elastic(ROBOT, frf, OPTIONS, DELAY_S)
    return fitted_model(ROBOT, solution, frf, OPTIONS, DELAY_S)


@pytest.fixture(scope="module")
def positions():
    truth = with_spring_factors(ROBOT, [1.3], [0.8])
    return exact_frf(truth, np.zeros((1, 1)), np.geomspace(2, 240, 50), delay_s=DELAY_S, relative_noise=1e-4)


@pytest.mark.parametrize("stated", ["central_difference", "instants"])
def test_differences_are_told(positions, stated):
    model = fitted(said(positions, stated))
    found = try_samples(model)
    assert "`sampled: difference`" in found.correct[0]
    assert "speed of drive" in found.names[0]
    assert found.share > 0.9
    first = explain(model)[0]
    assert first.cause == "samples"
    assert "`sampled: difference`" in first.correct[0]


def test_what_is_right_is_not_told(positions):
    found = try_samples(fitted(said(positions, "difference")))
    assert found is None or found.share < 0.1
    assert try_samples(fitted(positions)) is None
    angles = replace(positions, measured_channels=(Channel("drive", "angle", "rad"),))
    assert try_samples(fitted(angles)) is None
