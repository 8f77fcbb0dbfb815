"""Periods that do not repeat each other: what noise makes of a channel, what is no noise, and transients."""

from dataclasses import replace

import numpy as np
import pytest

from robid.errors import DataError
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.frf.steadiness import _transient
from robid.signals.quantities import Channel
from robid.signals.record import Record

N, LINES = 400, np.arange(4, 60)
CHANNELS = (Channel("drive", "torque", "N m", "motor"),), (Channel("drive", "speed", "rad/s", "motor"),)
OPTIONS = EstimateOptions(compensation="none", outputs="measured")


def record_of(periods=8, gains=None, input_noise=0.0, output_noise=0.01, shape=None, leading=0.0, follow=True):
    """A record of a first-order drive; inputs may change their size, outputs follow them or not."""
    generator = np.random.default_rng(5)
    gains = np.ones(periods) if gains is None else np.asarray(gains, float)
    spectrum = np.zeros(N // 2 + 1, complex)
    spectrum[LINES] = np.exp(2j * np.pi * generator.uniform(size=len(LINES)))
    answer = spectrum / (1 + 1j * np.arange(N // 2 + 1) / 20)
    u, y = np.fft.irfft(spectrum) * N / 8, np.fft.irfft(answer) * N / 8
    inputs = gains[:, None] * u
    outputs = (gains[:, None] if follow else 1.0) * y * np.ones((periods, 1))
    if shape is not None:
        outputs = outputs + np.asarray(shape)[:, None] * np.roll(y, 90)
    outputs[0] += leading * y.std() * np.exp(-np.arange(N) / 60)
    inputs = inputs + input_noise * u.std() * generator.normal(size=inputs.shape)
    outputs = outputs + output_noise * y.std() * generator.normal(size=outputs.shape)
    return Record(
        sampling_period_s=1e-3,
        inputs=inputs[None, None, None, :, :, None],
        outputs=outputs[None, None, None, :, :, None],
        output_offset=np.zeros((1, 1)),
        input_channels=CHANNELS[0],
        output_channels=CHANNELS[1],
        configurations=np.zeros((1, 1)),
        excited_lines=LINES,
    )


def notes_of(**changes):
    return " ".join(estimate_frf(record_of(**changes), OPTIONS).notes)


def test_each_channel_tells_how_much_of_it_repeats():
    found = notes_of(input_noise=0.1, output_noise=0.1)
    share = [float(text.partition(" %")[0].split()[-1]) for text in found.split("inputs ")[1].split("; outputs ")]
    # White noise of a tenth of the size has that share of its energy that the lines have of all.
    expected = 100 * (1 - 0.01 * 2 * len(LINES) / N)
    assert share == pytest.approx([expected, expected], abs=0.1)


def test_where_nearly_all_of_it_repeats_nothing_is_told():
    assert "repeats" not in notes_of(input_noise=0.01, output_noise=0.01)


@pytest.mark.parametrize("noise", [0.0, 0.3, 1.0, 3.0])
def test_noise_alone_is_no_reason_to_refuse(noise):
    assert "changes from period to period" not in notes_of(input_noise=noise, output_noise=noise)


def test_noise_of_an_input_tells_the_bias_that_it_makes():
    truth = 1 / (1 + 1j * LINES / 20)
    found = estimate_frf(record_of(periods=16, input_noise=2.0, output_noise=0.0), OPTIONS)
    told = next(note for note in found.notes if "biases the response by about" in note)
    biased = float(told.partition("by about ")[2].partition(" %")[0]) / 100
    ratio = np.mean([np.mean(np.real(estimate.response[0, :, 0, 0] / truth)) for estimate in (found,)])
    assert "input drive repeats to" in told
    assert biased == pytest.approx(4 * 2 * len(LINES) / N / 16, rel=0.25)
    assert abs(ratio - 1) < 3 * biased


@pytest.mark.parametrize("gains", [1 + 0.52 * (np.arange(8) % 2), np.linspace(1, 1.6, 8)])
def test_an_input_whose_size_changes_is_refused_unless_the_outputs_follow(gains):
    with pytest.raises(DataError, match="changes from period to period") as caught:
        estimate_frf(record_of(gains=gains, follow=False), OPTIONS)
    assert "input drive 2" in str(caught.value) or "input drive 1" in str(caught.value)
    assert "leave out the periods that differ" in caught.value.remedy
    small = 1 + (gains - 1) / 5
    assert "changes from period to period by" in notes_of(gains=small, follow=False)
    assert "changes from period to period by" not in notes_of(gains=small, follow=True)


def test_a_pattern_that_comes_back_is_no_noise():
    assert "which is no noise" in notes_of(shape=0.6 * (np.arange(8) % 2))
    assert "which is no noise" not in notes_of(output_noise=0.6)


def test_a_small_change_is_told():
    assert "the response changes from period to period by 5" in notes_of(
        gains=1 + 0.1 * (np.arange(8) % 2), follow=False
    )


def test_a_transient_in_the_first_period_is_named_with_what_dropping_it_gains():
    found = notes_of(leading=3.0)
    assert "the first period is a transient" in found
    told = float(found.partition("the variance of the mean is ")[2].partition(" %")[0]) / 100

    whole = record_of(leading=3.0)
    part = {name: getattr(whole, name)[:, :, :, 1:] for name in ("inputs", "outputs")}
    variances = [
        estimate_frf(record, OPTIONS).element_variance(noise_only=True).sum()
        for record in (replace(whole, **part), whole)
    ]
    assert told == pytest.approx(variances[0] / variances[1], rel=0.4)
    assert "transient" not in notes_of(leading=0.0)


def decaying(size: float, periods: int = 4) -> Record:
    """A record whose outputs return slowly, over more than one period, as where a motor turns freely."""
    record = record_of(periods=periods)
    decay = size * record.outputs.std() * np.exp(-np.arange(periods * N) / (0.4 * N))
    return replace(record, outputs=record.outputs + decay.reshape(1, 1, 1, periods, N, 1))


def test_a_slow_decay_is_a_transient_too():
    def transient(record: Record) -> bool:
        return any("first period is a transient" in one for one in estimate_frf(record, OPTIONS).notes)

    def error(record: Record) -> float:
        response = estimate_frf(record, OPTIONS).response[0, :, 0, 0]
        return float(np.median(np.abs(response * (1 + 1j * LINES / 20) - 1)))

    whole = decaying(1.0)
    part = {name: getattr(whole, name)[:, :, :, 1:] for name in ("inputs", "outputs")}
    assert transient(whole)
    assert error(replace(whole, **part)) < 0.5 * error(whole)
    assert not transient(decaying(0.0))


def test_a_drift_that_comes_and_goes_is_no_transient():
    told = 0
    for seed in range(40):
        record = record_of(periods=4, output_noise=1e-3)
        walk = np.cumsum(np.random.default_rng(seed).normal(size=4 * N)).reshape(1, 1, 1, 4, N, 1)
        found = estimate_frf(replace(record, outputs=record.outputs + 0.02 * walk), OPTIONS).notes
        told += any("transient" in one for one in found)
    assert told <= 3


@pytest.mark.parametrize("periods", [3, 4, 8])
def test_a_transient_is_named_from_three_periods_on(periods):
    assert "the first period is a transient" in notes_of(periods=periods, leading=3.0)


@pytest.mark.parametrize("periods", [3, 4, 8])
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.1])
def test_an_input_of_another_size_in_the_first_period_is_no_transient(periods, noise):
    gains = np.ones(periods)
    gains[0] = 2.0
    with pytest.raises(DataError, match="changes from period to period") as caught:
        estimate_frf(record_of(periods=periods, gains=gains, output_noise=noise, follow=False), OPTIONS)
    assert "input drive" in str(caught.value)


@pytest.mark.parametrize("periods", [3, 4])
def test_noise_of_eight_lines_is_hardly_ever_a_transient(periods):
    generator, trials = np.random.default_rng(11), 2000
    told = 0
    for _ in range(trials):
        noise = generator.normal(size=(2, 1, periods, 8, 1, 1))
        residual = noise[0] + 1j * noise[1]
        residual -= residual.mean(axis=1, keepdims=True)
        told += _transient(residual, residual)[0] > 0
    assert told < 0.01 * trials
