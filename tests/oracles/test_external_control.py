"""Sampled responses and fits of transfer functions against python-control and SciPy."""

import control
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import lsim

from external_shots import CHANNELS, PERIOD_S, shot, sweep, transfer
from robid.models.external.fit.output_error import fit_block
from robid.models.external.fit.problem import Structure


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("name", CHANNELS)
def test_sampled_response_is_controls(name, hold):
    model = transfer(*CHANNELS[name], hold=hold)
    system = control.ss(control.tf(*CHANNELS[name]))
    discrete = control.c2d(system, PERIOD_S, hold)
    omega = np.linspace(0.1, 0.9 * np.pi / PERIOD_S, 40)
    wanted = discrete(np.exp(1j * omega * PERIOD_S))
    np.testing.assert_allclose(model.sampled_response(omega)[:, 0, 0], wanted, rtol=1e-7)


@pytest.mark.parametrize("name", CHANNELS)
def test_response_step_and_roots_are_controls(name):
    model, system = transfer(*CHANNELS[name]), control.tf(*CHANNELS[name])
    omega, time = np.geomspace(0.1, 100.0, 30), np.linspace(0.0, 1.0, 101)
    np.testing.assert_allclose(model.response(omega)[:, 0, 0], system(1j * omega), rtol=1e-9)
    np.testing.assert_allclose(model.step(time)[:, 0, 0], control.step_response(system, time)[1], atol=1e-6)
    np.testing.assert_allclose(np.sort(model.poles), np.sort(system.poles()), rtol=1e-9)
    np.testing.assert_allclose(np.sort(model.zeros()), np.sort(system.zeros()), rtol=1e-9)


def test_fit_is_that_of_scipys_least_squares():
    model = transfer(*CHANNELS["Z"])
    measured = shot(model, sweep(5.0, 1500), noise=1e-2, seed=5)
    time = np.arange(1500) * PERIOD_S
    scale = np.array([24.08, 1362.0, 65.0, 1362.0])

    def left(ratio):
        values = ratio * scale
        simulated = lsim((values[:2], [1.0, *values[2:]]), measured.inputs[:, 0], time, interp=False)[1]
        return simulated - measured.outputs[:, 0]

    wanted = least_squares(left, np.full(4, 1.1), xtol=1e-14, ftol=1e-14, gtol=1e-14).x * scale
    fit = fit_block([measured], [0], [0], Structure(2, 1))
    deviation = np.sqrt(np.diag(fit.covariance))
    assert (np.abs(fit.parameters - wanted) < 2e-3 * deviation).all()
