"""What a right model leaves is inside its band, however differently the elements are known."""

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions, Weights

FREQUENCY_HZ = np.unique(np.round(np.geomspace(1, 60, 40), 1))
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2]])


@pytest.mark.parametrize(
    "kind", ["inflated", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("optimal", "user"))]
)
def test_weights_that_are_not_the_noises_own_blame_no_right_model(kind):
    """Couplings have a hundred times the noise of the motors' own responses here: their noise moves the parameters."""
    arm = with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])
    shares, ratios = [], []
    for seed in range(20):
        frf = exact_frf(arm, PLACES, FREQUENCY_HZ, delay_s=1e-3, relative_noise=1e-3, seed=seed)
        found = fit_elastic(two_joint_robot(), frf, ElasticOptions(weights=Weights(kind=kind)), 1e-3)
        shares.append(found.model_error.share_above)
        ratios.append(found.model_error.ratio.mean())
    assert np.mean(shares) < 0.12  # 0.05 expected
    assert 0.7 < np.mean(ratios) < 1.3  # 1 expected


def test_a_wrong_model_is_still_told():
    arm = two_joint_robot()
    frf = exact_frf(arm, PLACES, FREQUENCY_HZ, delay_s=1e-3, relative_noise=1e-3, seed=1)
    column = np.where(np.arange(2) == 1, 1.01, 1.0)
    wrong = frf.response * column  # one torque 1 % off
    found = fit_elastic(arm, type(frf)(**{**vars(frf), "response": wrong}), ElasticOptions(), 1e-3)
    assert found.model_error.share_above > 0.3
