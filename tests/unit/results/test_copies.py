"""Data that a fit has seen come back as a copy: found whatever was done to it; repeated measurements are none."""

from dataclasses import replace

import numpy as np
import pytest

from robid.results import copies
from robid.signals.quantities import Channel
from robid.signals.record import Record

N, P = 300, 6
INPUTS, OUTPUTS = (
    (Channel("drive", "torque", "N m", "motor"),),
    (
        Channel("drive", "angle", "rad", "motor"),
        Channel("drive.arm", "angle", "rad", "arm"),
    ),
)


def record_of(seed, noise=0.01, n_real=2, period=N, one_shot=False):
    """The same motion, measured once more."""
    motion = np.random.default_rng(1)
    wave = np.fft.irfft(np.fft.rfft(motion.normal(size=(3, N)), axis=1) * (np.arange(N // 2 + 1) < 30), axis=1)
    generator = np.random.default_rng(seed)
    samples = np.tile(wave, (n_real, 1, 1, P)).reshape(n_real, 1, 3, -1)
    samples = samples + noise * wave.std() * generator.normal(size=samples.shape)
    samples = np.moveaxis(samples, 2, -1)
    return cut(samples, one_shot=one_shot, period=period)


def cut(samples, period=N, one_shot=False):
    """Samples (n_real, n_exp, n_time, n_channel) as a record."""
    periods = 1 if one_shot else samples.shape[2] // period
    length = samples.shape[2] if one_shot else period
    shaped = samples[:, :, : periods * length].reshape(1, *samples.shape[:2], periods, length, 3)
    return Record(
        sampling_period_s=1e-3,
        inputs=shaped[..., :1],
        outputs=shaped[..., 1:],
        output_offset=np.zeros((1, 2)),
        input_channels=INPUTS,
        output_channels=OUTPUTS,
        configurations=None if one_shot else np.zeros((1, 1)),
        excited_lines=np.zeros(0, int) if one_shot else np.arange(1, 30),
    )


def find_copy(old, new):
    return copies.find_copy(old, copies.take_excerpt(new), lambda: new)


def samples_of(record):
    both = np.concatenate([record.inputs[0], record.outputs[0]], axis=-1)
    return both.reshape(*both.shape[:2], -1, 3)


@pytest.mark.parametrize("noise", [1e-3, 0.01, 0.3])
@pytest.mark.parametrize("one_shot", [False, True])
def test_a_repeated_measurement_is_no_copy(noise, one_shot):
    assert find_copy(record_of(1, noise, one_shot=one_shot), record_of(2, noise, one_shot=one_shot)) is None


def test_a_transient_that_comes_back_makes_no_copy():
    settling = 0.3 * np.exp(-np.arange(N * P) / N)[:, None]
    first, second = (samples_of(record_of(seed, 1e-3)) * (1 + settling) for seed in (1, 2))
    assert find_copy(cut(first), cut(second)) is None
    assert find_copy(cut(first), cut(2 * first)) is not None


CHANGES = {
    "the same": lambda x: x,
    "scaled and turned": lambda x: x * [2.0, -0.3, 57.3],
    "begun elsewhere": lambda x: x[:, :, 137:],
    "cut": lambda x: x[:1, :, 2 * N : 5 * N],
    "rounded": lambda x: np.round(x, 5),
    "shifted by an offset": lambda x: x + np.array([0.1, 3.0, -1.0]),
    "in single precision": lambda x: x.astype(np.float32).astype(float),
    "another order": lambda x: x[::-1],
}


@pytest.mark.parametrize("change", CHANGES)
def test_a_copy_is_found_whatever_was_done_to_it(change):
    old = record_of(1)
    found = find_copy(old, cut(CHANGES[change](samples_of(old))))
    assert found is not None
    if change == "begun elsewhere":
        assert (found.first, found.old_first) == (0, 137)


def test_one_copied_period_among_new_ones_is_found():
    old, fresh = record_of(1, n_real=1), samples_of(record_of(2, n_real=1))
    fresh[:, :, 3 * N : 4 * N] = samples_of(old)[:, :, N : 2 * N]
    found = find_copy(old, cut(fresh))
    assert found is not None
    assert (found.first, found.old_first, found.count) == (3 * N, N, N)


def test_other_periods_of_one_recording_are_no_copy():
    whole = samples_of(record_of(1))
    assert find_copy(cut(whole[:, :, : 3 * N]), cut(whole[:, :, 3 * N :])) is None


def test_a_cut_shot_is_a_copy():
    old = record_of(1, one_shot=True)
    assert find_copy(old, cut(3 * samples_of(old)[:, :, 211:1500], one_shot=True)) is not None


def test_a_channel_that_differs_makes_it_another_measurement():
    old = record_of(1)
    other = samples_of(old)
    other[..., 2] = samples_of(record_of(2))[..., 2]
    assert find_copy(old, cut(other)) is None


def test_records_of_other_channels_have_nothing_in_common():
    old = record_of(1)
    assert find_copy(old, replace(old, input_channels=(Channel("other", "torque", "N m", "motor"),))) is None


def settled(seed, noise=1e-3, periods=2):
    """Two periods that begin with the same slow transient."""
    decay = 0.3 * np.exp(-np.arange(N * periods) / N)[:, None]
    return samples_of(record_of(seed, noise))[:, :, : periods * N] * (1 + decay)


@pytest.mark.parametrize("periods", [2, 3, 4])
def test_recordings_that_begin_with_one_transient_are_two(periods):
    first, second = settled(1, periods=periods), settled(2, periods=periods)
    assert find_copy(cut(first), cut(second)) is None
    assert find_copy(cut(first), cut(np.round(2 * first, 4))) is not None


@pytest.mark.parametrize("one_shot", [False, True])
def test_recordings_of_little_noise_are_two(one_shot):
    # In single precision, as records are stored.
    first, second = (samples_of(record_of(seed, 1e-5)).astype(np.float32).astype(float) for seed in (1, 2))
    assert find_copy(cut(first, one_shot=one_shot), cut(second, one_shot=one_shot)) is None
    assert find_copy(cut(first, one_shot=one_shot), cut(57.3 * first, one_shot=one_shot)) is not None


@pytest.mark.parametrize("steps_of_noise", [0.3, 1.0, 3.0])
def test_an_encoder_of_coarse_steps_makes_no_copy(steps_of_noise):
    step = 1e-3 * steps_of_noise
    first, second = (step * np.round(settled(seed) / step) for seed in (1, 2))
    assert find_copy(cut(first), cut(second)) is None
    assert find_copy(cut(first), cut(np.round(57.3 * first, 4))) is not None


@pytest.mark.parametrize("digits", [5, 6, 7])
@pytest.mark.parametrize("offset", [0.0, 3.0])
def test_an_export_of_some_digits_is_a_copy(digits, offset):
    old = settled(1) + offset
    text = np.vectorize(lambda value: float(f"{value:.{digits}g}"))
    assert find_copy(cut(old), cut(text(57.3 * old))) is not None
    assert find_copy(cut(text(old)), cut(old)) is not None


def test_what_was_resampled_is_a_copy():
    old = samples_of(record_of(1, 0.02))
    time = np.arange(old.shape[2])
    moved = np.apply_along_axis(lambda values: np.interp(time + 0.003, time, values), 2, old)
    assert find_copy(cut(old), cut(moved)) is not None


def test_a_new_record_is_read_again_only_where_a_window_comes_back():
    def read():
        raise AssertionError("read again")

    assert copies.find_copy(record_of(1), copies.take_excerpt(record_of(2)), read) is None
    with pytest.raises(AssertionError):
        copies.find_copy(record_of(1), copies.take_excerpt(record_of(1)), read)
