"""The robust local polynomial method: transients of known systems removed, noise covariance, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from robid.errors import DataError
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.signals.quantities import motor_channels
from robid.signals.record import Record
from robid.signals.waveforms import multisine, time_signal

PERIOD_S, N_SAMPLE = 4.0, 1024
LINES = np.array([9, 15, 23, 31, 41, 53, 61, 75])
ROBUST = EstimateOptions(estimator="robust_local", compensation="none", pooled_lines=1)
STEP_S = PERIOD_S / N_SAMPLE


def two_drives():
    """A damped pair of coupled resonances, exactly discretised: transfer (2 x 2) from torque to angle."""
    stiffness, damping = np.array([[90.0, -40.0], [-40.0, 70.0]]), np.array([[4.0, -1.0], [-1.0, 3.0]])
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
    b = np.vstack([np.zeros((2, 2)), np.diag([3.0, 5.0])])
    c = np.hstack([np.eye(2), np.zeros((2, 2))])
    return signal.cont2discrete((a, b, c, np.zeros((2, 2))), STEP_S)[:4]


def simulated(torque, start=None):
    """Angles (..., n_sample, 2) that held torques (..., n_sample, 2) cause from a start at rest or elsewhere."""
    a, b, c, _ = two_drives()
    state = np.broadcast_to(np.zeros(4) if start is None else start, (*torque.shape[:-2], 4))
    angles = np.empty_like(torque)
    for sample in range(torque.shape[-2]):
        angles[..., sample, :] = state @ c.T
        state = state @ a.T + torque[..., sample, :] @ b.T
    return angles


def exact_response(omega):
    """The sampled response from torque to acceleration, `-w^2 G`."""
    a, b, c, _ = two_drives()
    z = np.exp(1j * omega * STEP_S)[:, None, None]
    return -(omega[:, None, None] ** 2) * (
        c @ np.linalg.solve(z * np.eye(4) - a, np.broadcast_to(b, (omega.size, 4, 2)))
    )


def transient_record(*, periods=2, realizations=2, dropped=0):
    amplitude = np.ones((2, LINES.size))
    phases = np.random.default_rng(7).uniform(0, 2 * np.pi, (realizations, 2, LINES.size))
    reference = time_signal(multisine(amplitude, phases), LINES, N_SAMPLE)
    torque = np.tile(reference, (1, 1, periods + dropped, 1))
    angle = simulated(torque)[:, :, dropped * N_SAMPLE :]
    torque = torque[:, :, dropped * N_SAMPLE :]
    shape = (1, realizations, 2, periods, N_SAMPLE, 2)
    names = ("first", "second")
    return Record(
        sampling_period_s=STEP_S,
        configurations=np.zeros((1, 2)),
        inputs=torque.reshape(shape),
        outputs=angle.reshape(shape),
        reference=reference[None],
        reference_channels=motor_channels(names, "torque"),
        excited_lines=LINES,
        detection_lines=np.zeros(0, int),
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(names, "angle"),
        output_offset=np.zeros((1, 2)),
    )


def relative_error(frf):
    exact = exact_response(2 * np.pi * frf.frequency_hz)
    return np.sqrt(np.mean(np.abs(frf.response[0] - exact) ** 2 / np.abs(exact) ** 2))


@pytest.mark.parametrize("periods", [2, 3, 4])
def test_the_transient_is_removed(periods):
    record = transient_record(periods=periods)
    plain = relative_error(estimate_frf(record, replace(ROBUST, estimator="logarithmic")))
    robust = relative_error(estimate_frf(record, ROBUST))
    assert robust < plain / 10


def test_a_steady_state_without_noise_is_exact():
    frf = estimate_frf(transient_record(dropped=8), ROBUST)
    assert relative_error(frf) < 1e-8


def test_noise_covariance_against_monte_carlo():
    runs, found, claimed = 300, [], []
    record, generator = transient_record(dropped=8, realizations=1), np.random.default_rng(1)
    for _ in range(runs):
        noise = 1e-4 * generator.standard_normal(record.outputs.shape)
        frf = estimate_frf(replace(record, outputs=record.outputs + noise), ROBUST)
        found.append(frf.response[0])
        claimed.append(frf.element_variance()[0])
    ratio = np.var(found, axis=0) / np.mean(claimed, axis=0)
    np.testing.assert_allclose(ratio.mean(), 1.0, atol=4 / np.sqrt(runs * ratio.size) + 0.02)


def test_one_period_is_refused():
    with pytest.raises(DataError, match="several periods") as caught:
        estimate_frf(transient_record(periods=1), ROBUST)
    assert "two periods" in caught.value.remedy


def test_a_window_without_freedom_is_refused():
    with pytest.raises(DataError, match="no freedom"):
        estimate_frf(transient_record(), replace(ROBUST, local_half_width_lines=1))
