"""Intervals of transfer functions hold what they promise, over a hundred draws of noise."""

import numpy as np
import pytest
from scipy.stats import norm

from external_shots import CHANNELS, shot, sweep, transfer
from robid.models.external.fit.graphs import output_deviation, response_deviation
from robid.models.external.fit.output_error import fit_block
from robid.models.external.fit.parameters import poles_of, zeros_of
from robid.models.external.fit.problem import Structure

LEVEL = 0.97
QUANTILE = norm.ppf(0.5 + LEVEL / 2)
OMEGA = 2 * np.pi * np.geomspace(0.02, 5.2, 30)
RESOLUTION = 1e-5


@pytest.mark.slow
@pytest.mark.parametrize("name", ["X", "Y", "Z", "C"])
def test_bounds_cover(name):
    model = transfer(*CHANNELS[name], delay=4, average=4)
    structure = Structure(len(model.poles), model.numerator.shape[-1] - 1, 4, 4)
    command = sweep(2.08, 3000, amplitude=0.01)[:, None]
    outputs, response = model.simulate(command), model.sampled_response(OMEGA)[:, 0, 0]
    roots, responses, simulations = [], [], []
    for seed in range(100):
        shots = [
            shot(
                model,
                sweep(high, 6000, low_hz=0.02, amplitude=size),
                noise=RESOLUTION,
                resolution=RESOLUTION,
                seed=3 * seed + place,
            )
            for place, (high, size) in enumerate(((0.1, 0.6), (1.04, 0.05), (5.2, 0.005)))
        ]
        fit = fit_block(shots, [0], [0], structure, model)
        own, true = (
            [*poles_of(each, fit.covariance_root), *zeros_of(each, fit.covariance_root)] for each in (fit.model, model)
        )
        roots += [
            abs(abs(one.place) - abs(other.place)) < QUANTILE * one.relative_std * abs(one.place)
            for one, other in zip(own, true, strict=True)
        ]
        deviation = response_deviation(fit.model, fit.covariance_root, OMEGA, sampled=True)
        apart = np.log(fit.model.sampled_response(OMEGA)[:, 0, 0] / response)
        responses += [*(np.abs(apart.real) < QUANTILE * deviation.magnitude[:, 0, 0])]
        responses += [*(np.abs(apart.imag) < QUANTILE * deviation.phase_rad[:, 0, 0])]
        bounds = QUANTILE * output_deviation(fit.model, fit.covariance_root, command)
        simulations += [*(np.abs(fit.model.simulate(command) - outputs)[50:] < bounds[50:]).ravel()]
    shares = {"roots": np.mean(roots), "response": np.mean(responses), "outputs": np.mean(simulations)}
    print(name, {key: round(float(value), 3) for key, value in shares.items()})
    assert 0.94 < shares["response"] < 0.99
    assert 0.94 < shares["outputs"] < 0.99
    # A range of which samples only tell the slow end covers more than it promises.
    assert 0.94 < shares["roots"] <= (1.0 if name in "XC" else 0.99)
