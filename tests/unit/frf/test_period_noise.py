"""The noise of a mean over few periods: a loop's exact covariance, and what falls within the bands."""

from dataclasses import replace

import numpy as np
import pytest

from linear_loop import Loop, draw_reference, loop_record
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.frf.period_noise import period_noise
from robid.signals.quantities import Channel, motor_channels
from robid.signals.record import Record

LOOP = Loop(torque_noise=0.01, sensor_noise=3e-5)
RUNS = 200
OPTIONS = EstimateOptions(compensation="none")


def estimated(periods, seed, runs=RUNS):
    """Responses of one realization each, with signals of their own."""
    generator = np.random.default_rng(seed)
    _, reference = draw_reference(generator, (runs, 1), 1.0)
    torque, angle = LOOP.simulate(reference, generator, periods=periods)
    return [estimate_frf(loop_record(*each), OPTIONS) for each in zip(reference, torque, angle, strict=True)]


@pytest.mark.parametrize("periods", [2, 3])
def test_few_periods_of_one_realization_know_their_noise(periods):
    found = estimated(periods, seed=31 + periods)
    exact = LOOP.residual_noise(periods)[0]
    ratio = np.mean([np.real(np.diagonal(frf.noise_covariance[0], axis1=1, axis2=2)) for frf in found], axis=0)
    ratio /= np.real(np.diagonal(exact, axis1=1, axis2=2))
    # At the high lines all noise is leakage of slow noise, below the resonance none.
    np.testing.assert_allclose(ratio, 1.0, atol=0.35)
    np.testing.assert_allclose(ratio.mean(), 1.0, atol=0.12)
    inside = [np.abs(frf.response[0] - LOOP.response()) <= frf.error_radius(0.95)[0] for frf in found]
    # The error of a share over runs, whose lines err alike, is below 0.01.
    assert 0.94 - 0.01 <= np.mean(inside) <= 0.97 + 0.01
    assert np.mean(inside, axis=(0, 2, 3)).min() > 0.88


def test_leakage_of_few_lines_leaves_fewer_degrees_of_freedom():
    (frf,) = estimated(2, seed=5, runs=1)
    assert frf.noise_degrees_of_freedom == 2 * 3
    assert 2 <= frf.degrees_of_freedom < 6
    assert frf.radius_factor(0.95) > replace(frf, freedom_share=None).radius_factor(0.95)


def test_a_decay_left_in_the_first_of_three_periods_is_within_the_band():
    n_sample, lines, step_s = 1000, np.arange(2, 76), 2e-3
    generator = np.random.default_rng(4)
    spectrum = np.zeros(n_sample // 2 + 1, complex)
    spectrum[lines] = np.exp(2j * np.pi * generator.random(len(lines)))
    omega = 2 * np.pi * np.arange(len(spectrum)) / (n_sample * step_s)
    torque, angle = (np.fft.irfft(each, n_sample) for each in (spectrum, -spectrum / np.maximum(omega, 1.0) ** 2))
    decay = 4e-5 * np.exp(-np.arange(3 * n_sample) / (n_sample / 6))
    measured = np.tile(angle, 3) + decay + 1e-6 * generator.standard_normal(3 * n_sample)
    frf = estimate_frf(
        Record(
            sampling_period_s=step_s,
            inputs=np.tile(torque, 3).reshape(1, 1, 1, 3, n_sample, 1),
            outputs=measured.reshape(1, 1, 1, 3, n_sample, 1),
            output_offset=np.zeros((1, 1)),
            input_channels=motor_channels(("drive",), "torque"),
            output_channels=motor_channels(("drive",), "angle"),
            configurations=np.zeros((1, 1)),
            excited_lines=lines,
        ),
        OPTIONS,
    )
    assert not [note for note in frf.notes if "transient" in note]
    assert np.mean(np.abs(frf.response[0] - 1) <= frf.error_radius(0.95)[0]) > 0.9


def noise_of(signal, lines):
    """What the spectrum of periods says of their mean's variance, and what the mean has, over many experiments."""
    record = Record(
        sampling_period_s=1e-3,
        configurations=np.zeros((1, 1)),
        inputs=np.zeros((1, 1, *signal.shape, 1)),
        outputs=signal[None, None, ..., None],
        output_offset=np.zeros((1, 1)),
        input_channels=(Channel("drive", "torque", "N m", "motor"),),
        output_channels=(Channel("tip", "acceleration", "m/s^2", "tool"),),
        excited_lines=lines,
    )
    found = period_noise(record, lines, np.zeros((lines.size, 1, 1), complex), 1)
    mean = np.fft.rfft(signal.mean(axis=1), norm="forward")[:, lines]
    return np.real(found.covariance[:, 0, 0]), (np.abs(mean) ** 2).mean(axis=0)


@pytest.mark.parametrize("periods", [2, 3, 4])
def test_white_noise_leaves_its_power_over_the_number_of_periods(periods):
    signal = np.random.default_rng(7).standard_normal((3000, periods, 64))
    found, _ = noise_of(signal, np.arange(6, 30))
    # A part of 1 / (6 P) is leakage; the error of the mean over experiments and lines is below 0.01.
    np.testing.assert_allclose(found.mean(), 1 / (64 * periods), rtol=0.02)


@pytest.mark.parametrize("periods", [2, 4])
def test_noise_of_one_frequency_leaks_to_lines_that_have_none(periods):
    generator, lines = np.random.default_rng(8), np.arange(6, 30)
    turns = generator.uniform(19.5, 20.5, (3000, 1)) / 64
    wave = np.cos(2 * np.pi * (turns * np.arange(64 * periods) + generator.random((3000, 1))))
    found, true = noise_of(wave.reshape(3000, periods, 64), lines)
    far = np.abs(lines - 20) > 4
    assert true[far].max() < 0.1 * true.max()
    np.testing.assert_allclose(found[far], true[far], rtol=0.1)
