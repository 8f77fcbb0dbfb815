"""The predicted signal-to-noise ratio against estimates from noisy closed-loop spectra."""

import numpy as np
import pytest

from robid.design.excitation.excitation import design_excitation
from robid.design.excitation.loop import residual_covariance
from robid.design.excitation.options import MultisineOptions
from robid.design.excitation.prediction import predict
from two_drives import OPTIONS, STEP, make_loop

ANGLE_NOISE, TORQUE_NOISE, PERIODS = 2e-4, 0.4, 3


def coupled_loop(excitation):
    """The two drives with a response that couples them."""
    loop = make_loop(excitation)
    loop.response[..., 0, 1] = loop.response[..., 1, 0] = 0.3 * loop.response[..., 0, 0]
    return loop


def test_noise_in_the_loop_gives_the_predicted_variance():
    options = MultisineOptions(
        **{name: getattr(OPTIONS, name) for name in ("period_s", "low_hz", "high_hz", "count", "rms", "phase_starts")},
        assumed_angle_noise_rad=ANGLE_NOISE,
        assumed_torque_noise_nm=TORQUE_NOISE,
    )
    excitation = design_excitation(options, 2, 2, STEP)
    loop = coupled_loop(excitation)
    plan = predict(excitation, loop, options, periods=PERIODS).plan
    response, omega = loop.response[0], loop.omega
    to_torque, to_angle = loop.gains(0, excitation.kind)
    # Spectra (real, freq, motor, exp) of whole periods, as a DFT over the number of samples gives them.
    played = np.moveaxis(excitation.spectrum, 1, 3) / 2
    generator = np.random.default_rng(1)

    def noise(deviation):
        parts = generator.normal(scale=deviation / np.sqrt(2 * 1000 * PERIODS), size=(2, 4000, *played.shape))
        return parts[0] + 1j * parts[1]

    # The controller answers the measured angle by -C_q: what noise does to torque follows from the loop's gains.
    plant = -response / omega[:, None, None] ** 2
    closed = np.linalg.inv(np.eye(2) + feedback(loop, excitation) @ plant)
    encoder, disturbance = noise(ANGLE_NOISE), noise(TORQUE_NOISE)
    torque = to_torque @ played - closed @ feedback(loop, excitation) @ (encoder + plant @ disturbance)
    angle = plant @ (torque + disturbance) + encoder
    estimate = np.mean(-(omega**2)[:, None, None] * angle @ np.linalg.inv(torque), axis=1)
    variance = np.mean(np.abs(estimate - response) ** 2, axis=0)
    measured = 10 * np.log10(np.abs(response) ** 2 / variance)
    np.testing.assert_allclose(plan.snr_db[0], measured, atol=0.4)
    np.testing.assert_allclose(to_angle, plant @ to_torque, rtol=1e-12)


def feedback(loop, excitation):
    """The controller from measured angle to torque, of (freq, motor, motor)."""
    from robid.simulate.controller import frequency_response

    _, angle = frequency_response(loop.controller, loop.robot.motor_inertia_kgm2, loop.omega, excitation.kind)
    return angle[:, :, None] * np.eye(2)


def test_more_periods_realizations_and_amplitude_raise_the_ratio_as_theory_says():
    plans = []
    for realizations, periods, factor in ((1, 1, 1.0), (4, 1, 1.0), (1, 10, 1.0), (1, 1, 2.0)):
        options = MultisineOptions(period_s=1, low_hz=2, high_hz=40, count=15, rms=4 * factor, phase_iterations=0)
        excitation = design_excitation(options, 2, realizations, STEP)
        plans.append(predict(excitation, make_loop(excitation), options, periods=periods).plan.snr_db)
    diagonal = np.array([np.diagonal(plan, axis1=2, axis2=3) for plan in plans])
    gains = np.median(diagonal[1:] - diagonal[0], axis=(1, 2, 3))
    np.testing.assert_allclose(gains, [10 * np.log10(4), 10, 20 * np.log10(2)], atol=1e-9)


def test_encoder_noise_rules_high_lines_and_disturbance_all_alike():
    omega = np.array([10.0, 1000.0])
    response = np.repeat(50 * np.eye(2)[None], 2, axis=0).astype(complex)
    only_encoder = residual_covariance(response, omega, 1e-4, 0.0)
    assert only_encoder[1, 0, 0] / only_encoder[0, 0, 0] == pytest.approx(1e8)
    only_torque = residual_covariance(response, omega, 0.0, 0.1)
    np.testing.assert_allclose(only_torque, np.broadcast_to(25 * np.eye(2), (2, 2, 2)))
