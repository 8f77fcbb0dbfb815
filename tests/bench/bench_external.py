"""Output-error fits against SciPy's simulation with finite differences."""

import numpy as np
from scipy.optimize import least_squares
from scipy.signal import lsim

from external_shots import CHANNELS, PERIOD_S, shot, sweep, transfer
from robid.models.external.fit.output_error import fit_block
from robid.models.external.fit.problem import Structure

N_SAMPLE = 8333  # 100 s at 12 ms
LEVELS = ((0.10, 0.6), (1.04, 0.05), (5.20, 0.002))


def test_against_lsim_and_finite_differences(compare):
    """One channel's three shots to the same cost from the same start, 20 % off; ours also finds covariances."""
    model = transfer(*CHANNELS["Z"])
    shots = [
        shot(model, sweep(high, N_SAMPLE, low_hz=0.01, amplitude=size), noise=1e-5, seed=seed)
        for seed, (high, size) in enumerate(LEVELS)
    ]
    time = np.arange(N_SAMPLE) * PERIOD_S
    scale = np.concatenate([model.numerator.ravel(), model.denominator[1:]])
    first = scale * np.array([1.2, 0.8, 1.2, 0.8])
    start = transfer(first[:2], [1.0, *first[2:]])
    costs = {}

    def left(ratio):
        values = ratio * first
        system = (values[:2], [1.0, *values[2:]])
        return np.concatenate(
            [lsim(system, each.inputs[:, 0], time, interp=False)[1] - each.outputs[:, 0] for each in shots]
        )

    def reference():
        costs["reference"] = 2 * least_squares(left, np.ones(4), x_scale="jac").cost

    def ours():
        fit = fit_block(shots, [0], [0], Structure(2, 1), start)
        costs["ours"] = sum(float(np.sum(each**2)) for each in fit.residuals)

    compare("external.vs_lsim", ours, reference, 5)
    # The shots are weighted each by its own noise, which here is the same.
    np.testing.assert_allclose(costs["ours"], costs["reference"], rtol=1e-4)
