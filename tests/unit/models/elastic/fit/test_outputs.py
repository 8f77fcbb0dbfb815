"""Outputs beyond the motors contribute to the fit."""

import numpy as np

from exact_systems import exact_frf, sensed_everywhere, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from tolerances import RECOVERY

CONFIGURATIONS = np.array([[-0.3, 0.5], [0.9, 1.2], [0.2, -0.9]])
FREQUENCY_HZ = np.geomspace(2.0, 80.0, 25)
OUTPUTS = ("shoulder", "elbow", "elbow.arm", "tip", "felt")
OPTIONS = ElasticOptions(free=("stiffness", "damping"), prior_decades=1e6)


def fitted(outputs, noise):
    robot = sensed_everywhere()
    factors = np.exp(np.random.default_rng(3).uniform(-0.4, 0.4, (2, len(robot.springs))))
    true = with_spring_factors(robot, *factors)
    stated = {"relative_noise": noise, "declared_noise": noise or 1e-6}
    frf = exact_frf(true, CONFIGURATIONS, FREQUENCY_HZ, output_names=outputs, **stated)
    return true, fit_elastic(robot, frf, OPTIONS, 0.0)


def test_springs_come_back_from_motors_link_encoder_tracker_and_accelerometer():
    true, solution = fitted(OUTPUTS, 0.0)
    values = dict(zip(solution.estimate.names, solution.estimate.value, strict=True))
    for spring in true.springs:
        np.testing.assert_allclose(values[f"{spring.name}.stiffness"], spring.stiffness, rtol=RECOVERY)


def test_further_outputs_sharpen_the_estimate():
    alone, together = (fitted(outputs, 0.01)[1].estimate for outputs in (OUTPUTS[:2], OUTPUTS))
    assert together.names == alone.names
    assert np.median(together.relative_std / alone.relative_std) < 0.9
