"""The estimators against SciPy's cross spectra and python-control's frequency responses."""

import control
import numpy as np
import pytest
from scipy.signal import csd

from linear_loop import LINES, N_SAMPLE, OMEGA, STEP_S, Loop, draw_reference, loop_record
from robid.frf.blocks import ESTIMATORS
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from tolerances import IDENTITY

STEPS_OF_DELAY = 1


def test_least_squares_is_the_quotient_of_scipys_cross_spectra():
    generator = np.random.default_rng(3)
    _, reference = draw_reference(generator, (4,), 1.0)
    torque, angle = Loop(0.01, 3e-5).simulate(reference, generator, periods=1)
    found = estimate_frf(loop_record(reference, torque, angle), EstimateOptions("h1", compensation="none")).response[0]

    def spectra(first, second):
        # All realizations and experiments one after another: each is one segment.
        pairs = [
            [csd(first[..., i].ravel(), second[..., j].ravel(), 1.0, "boxcar", N_SAMPLE, 0, detrend=False)[1]
             for i in range(2)]
            for j in range(2)
        ]  # fmt: skip
        return np.moveaxis(np.array(pairs), -1, 0)[LINES]

    wanted = -(OMEGA**2)[:, None, None] * spectra(torque, angle) @ np.linalg.inv(spectra(torque, torque))
    np.testing.assert_allclose(found, wanted, rtol=IDENTITY)


def sampled_plant(delay):
    """Two motors on an elastic load, discretised by python-control behind a hold, with whole steps of delay."""
    mass, stiffness = np.diag([1.0e-3, 1.5e-3, 2.0e-3]), np.array([[40.0, 0, -40], [0, 60, -60], [-40, -60, 100]])
    damping = np.array([[0.03, 0, -0.02], [0, 0.04, -0.03], [-0.02, -0.03, 0.15]])
    A = np.block([[np.zeros((3, 3)), np.eye(3)], [-np.linalg.solve(mass, np.hstack([stiffness, damping]))]])
    B = np.vstack([np.zeros((3, 2)), np.linalg.inv(mass)[:, :2]])
    plant = control.c2d(control.ss(A, B, np.eye(2, 6), np.zeros((2, 2))), STEP_S, "zoh")
    late = control.ss(np.zeros((2, 2)), np.eye(2), np.eye(2), np.zeros((2, 2)), STEP_S)
    for _ in range(delay):
        plant = plant * late
    return plant


@pytest.mark.parametrize("estimator", [name for name in ESTIMATORS if name != "robust_local"])  # needs two periods
def test_every_estimator_in_closed_loop_is_python_controls_response(estimator):
    plant = sampled_plant(STEPS_OF_DELAY)
    _, reference = draw_reference(np.random.default_rng(4), (2,), 1.0)
    played = np.moveaxis(reference, -2, 0).reshape(N_SAMPLE, -1, 2).swapaxes(1, 2)
    state, last = np.zeros((plant.nstates, played.shape[2])), np.zeros(played.shape[1:])
    torques, angles = [], []
    for sample in range(20 * N_SAMPLE):
        angle = plant.C @ state
        torque = 0.02 * (played[sample % N_SAMPLE] - 6.0 * angle - (angle - last) / STEP_S)
        state, last = plant.A @ state + plant.B @ torque, angle
        torques.append(torque)
        angles.append(angle)
    shape = (N_SAMPLE, 2, *reference.shape[:2], 1)
    torque, angle = (np.array(each[-N_SAMPLE:]).reshape(shape).transpose(2, 3, 4, 0, 1) for each in (torques, angles))
    found = estimate_frf(
        loop_record(reference, torque, angle), EstimateOptions(estimator, compensation="none")
    ).response[0]
    wanted = np.moveaxis(plant(np.exp(1j * OMEGA * STEP_S)), -1, 0) * -(OMEGA**2)[:, None, None]
    np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-8 * np.abs(wanted).max())
