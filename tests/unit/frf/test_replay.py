"""Signals in time from amplitudes at lines, against sums of cosines."""

from dataclasses import replace

import numpy as np
import pytest

from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.frf.replay import corrected_inputs, in_time, replay
from robid.signals.quantities import motor_channels
from robid.signals.record import Record

PERIOD_S, N_SAMPLE, PERIODS = 1e-3, 1000, 2
LINES = np.array([3, 7, 11, 19, 31])
SILENT = 5  # a line that carries a disturbance alone
OMEGA = 2 * np.pi * LINES / (N_SAMPLE * PERIOD_S)
TIME = PERIOD_S * np.arange(N_SAMPLE)
NAMES = ("a", "b")
DISTURBANCE = 0.3


def model():
    # Accelerations per torque, of no particular robot: they differ from line to line in size and phase.
    rng = np.random.default_rng(5)
    return 40.0 * (rng.standard_normal((len(LINES), 2, 2)) + 1j * rng.standard_normal((len(LINES), 2, 2)))


def cosines(amplitude, lines=LINES):
    """Sum of cosines over a period (n_sample, n_channel), from half complex amplitudes (n_line, n_channel)."""
    turns = np.exp(2j * np.pi * np.outer(np.arange(N_SAMPLE), lines) / N_SAMPLE)
    return 2 * (turns @ amplitude).real


@pytest.fixture(scope="module")
def inputs():
    rng = np.random.default_rng(6)
    return rng.standard_normal((2, 2, len(LINES), 2)) + 1j * rng.standard_normal((2, 2, len(LINES), 2))


@pytest.fixture(scope="module")
def record(inputs):
    torque = np.array([[cosines(one) for one in block] for block in inputs])
    spectra = np.einsum("foi,refi->refo", model(), inputs) / -(OMEGA**2)[:, None]
    angle = np.array([[cosines(one) for one in block] for block in spectra])
    beside = np.full((1, 2), DISTURBANCE / -((2 * np.pi * SILENT / (N_SAMPLE * PERIOD_S)) ** 2))
    angle += cosines(beside, np.array([SILENT]))
    periods = [np.repeat(each[None, :, :, None], PERIODS, axis=3) for each in (torque, angle)]
    return Record(
        PERIOD_S,
        *periods,
        output_offset=np.zeros((1, 2)),
        input_channels=motor_channels(NAMES, "torque"),
        output_channels=motor_channels(NAMES, "angle"),
        configurations=np.zeros((1, 2)),
        excited_lines=LINES,
    )


@pytest.fixture(scope="module")
def frf(record):
    return estimate_frf(record, EstimateOptions(compensation="none"))


@pytest.mark.parametrize(("realization", "experiment"), [(0, 0), (1, 1)])
def test_the_model_answers_the_inputs_of_its_own_experiment(record, frf, inputs, realization, experiment):
    found = replay(record, frf, model(), 0, realization, experiment)
    expected = cosines(np.einsum("foi,fi->fo", model(), inputs[realization, experiment]))
    np.testing.assert_allclose(found.time_s, TIME)
    np.testing.assert_allclose(found.modelled, expected, atol=1e-6 * np.abs(expected).max())
    np.testing.assert_allclose(found.measured, expected, atol=1e-6 * np.abs(expected).max())
    beside = 2 * DISTURBANCE * np.cos(2 * np.pi * SILENT * TIME / (N_SAMPLE * PERIOD_S))
    np.testing.assert_allclose(found.whole - found.measured, np.stack([beside] * 2, axis=1), atol=1e-6)
    assert found.relative_error.max() < 1e-6


def test_a_model_that_is_a_tenth_too_large_is_a_tenth_off(record, frf):
    found = replay(record, frf, 1.1 * model(), 0)
    np.testing.assert_allclose(found.relative_error, 0.1, rtol=1e-6)


def test_inputs_follow_a_response_that_a_fit_has_corrected(record, frf):
    scaled = frf.response * np.array([0.8, 1.25])
    moved = corrected_inputs(frf, scaled)
    np.testing.assert_allclose(moved.input_amplitude, frf.input_amplitude / np.array([0.8, 1.25])[:, None])
    assert corrected_inputs(frf, frf.response).input_amplitude is frf.input_amplitude
    assert replay(record, moved, scaled[0], 0).relative_error.max() < 1e-6
    # Outputs alone do not say by what torque each motor was moved.
    lone = replace(frf, response=frf.response[:, :, :1])
    assert corrected_inputs(lone, 2 * lone.response).input_amplitude is frf.input_amplitude


def test_what_is_not_there_is_not_replayed(record, frf):
    assert replay(record, replace(frf, input_amplitude=None), model(), 0) is None
    assert replay(replace(record, excited_lines=np.zeros(0, int)), frf, model(), 0) is None
    lacking = frf.input_amplitude.copy()
    lacking[..., 3] = np.nan
    assert replay(record, replace(frf, input_amplitude=lacking), model(), 0, 1, 1) is None
    assert replay(record, replace(frf, input_amplitude=lacking), model(), 0) is not None


def test_a_line_in_time_is_a_cosine():
    found = in_time(np.array([[0.5, -0.5j]]), np.array([4]), 64)
    turn = 2 * np.pi * 4 * np.arange(64) / 64
    np.testing.assert_allclose(found, np.stack([np.cos(turn), np.sin(turn)], axis=1), atol=1e-12)
