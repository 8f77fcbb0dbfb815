"""Amplitudes that follow the information of the lines: it is right, it grows, and no line vanishes."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import two_joint_robot, two_mass_robot
from robid.design.excitation.excitation import design_excitation
from robid.design.excitation.loop import FLOOR, line_information, nominal_loop, residual_covariance
from robid.design.excitation.options import MultisineOptions
from robid.robot.response import nominal_parameters, response, with_values
from robid.simulate.options import Controller
from two_drives import STEP

NOISE = (3e-5, 0.05)
SHAPED = MultisineOptions(
    period_s=2, low_hz=2, high_hz=60, count=40, rms=(5.0, 8.0), phase_iterations=0, amplitude="sensitivity"
)


@pytest.fixture(scope="module")
def loop():
    frequency_hz = design_excitation(replace(SHAPED, amplitude="flat"), 2, 1, STEP).frequency_hz
    configurations = np.array([[0.3, -0.5], [-0.6, 1.2], [0.1, 0.4]])
    return nominal_loop(two_joint_robot(), Controller(), configurations, frequency_hz)


def log_determinant(loop, amplitude):
    """Of the information about springs and dampers, nuisance parameters eliminated."""
    each = line_information(loop, "speed_reference", *NOISE)
    total = np.einsum("mf,fmpq->pq", amplitude**2, each)
    count = 2 * len(loop.robot.springs)
    return np.linalg.slogdet(total)[1] - np.linalg.slogdet(total[count:, count:])[1]


def test_information_agrees_with_finite_differences_of_what_is_measured(loop):
    each = line_information(loop, "speed_reference", *NOISE)
    parameters = nominal_parameters(loop.robot, loop.linear, loop.delay_s)
    expected = np.zeros(each.shape[:2])
    for index in range(3):
        torque, _ = loop.gains(index, "speed_reference")
        factors = np.ones(len(parameters.stiffness))
        factors[1] = 1 + 1e-5
        stiffer = with_values(parameters, "stiffness", parameters.stiffness * factors)
        moved = response(loop.linear, stiffer, loop.frequency_hz, STEP).sampled[index]
        slope = (moved - loop.response[index]) / 1e-5 @ torque
        noise = residual_covariance(loop.response[index], loop.omega, *NOISE)
        expected += np.real(np.einsum("foj,foj->fj", slope.conj(), np.linalg.solve(noise, slope)))
    np.testing.assert_allclose(each[:, :, 1, 1], expected, rtol=1e-3)


def test_shaped_amplitudes_keep_the_rms_and_leave_no_line_out(loop):
    shaped = design_excitation(SHAPED, 2, 2, STEP, loop)
    amplitude = np.abs(shaped.spectrum)
    np.testing.assert_allclose(np.sqrt(np.sum(amplitude**2, axis=2) / 2), np.broadcast_to([5, 8], (2, 2, 2)))
    np.testing.assert_allclose(np.sqrt(np.mean(shaped.reference**2, axis=2)), np.broadcast_to([5, 8], (2, 2, 2)))
    relative = amplitude[0, 0] / (np.array([5, 8]) * np.sqrt(2 / 40))
    assert relative.min() >= FLOOR
    assert relative.max() > 1.5
    by_experiment = np.moveaxis(shaped.spectrum[0], 0, -1)
    gram = by_experiment @ by_experiment.conj().swapaxes(-1, -2)
    squares = amplitude[0, 0] ** 2
    for line, matrix in enumerate(gram):
        np.testing.assert_allclose(matrix, 2 * np.diag(squares[line]), atol=1e-12)


def test_shaped_amplitudes_tell_more_than_flat_ones(loop):
    flat = np.array([5.0, 8.0])[:, None] * np.full((2, 40), np.sqrt(2 / 40))
    shaped = np.abs(design_excitation(SHAPED, 2, 1, STEP, loop).spectrum[0, 0]).T
    gain = log_determinant(loop, shaped) - log_determinant(loop, flat)
    assert gain / (2 * len(loop.robot.springs)) > 0.05


def test_the_power_follows_the_resonance_of_a_two_mass_drive():
    options = replace(SHAPED, rms=1.0, high_hz=120)
    frequency_hz = design_excitation(replace(options, amplitude="flat"), 1, 1, STEP).frequency_hz
    drive = nominal_loop(two_mass_robot(damping=0.2), Controller(), np.zeros((1, 1)), frequency_hz)
    amplitude = np.abs(design_excitation(options, 1, 1, STEP, drive).spectrum[0, 0, :, 0])
    resonance_hz = np.sqrt(546.4 * (1 / 4.780e-3 + 1 / 4.752e-3)) / (2 * np.pi)
    antiresonance_hz = np.sqrt(546.4 / 4.752e-3) / (2 * np.pi)
    strongest = frequency_hz[np.argmax(amplitude)]
    assert 0.8 * antiresonance_hz < strongest < 1.2 * resonance_hz
    assert amplitude[0] < 0.5 * amplitude.max()
