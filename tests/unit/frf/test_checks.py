"""Damaged records are found out and the damage is named; good ones raise no alarm."""

from dataclasses import replace

import numpy as np
import pytest

from closed_loops import N_SAMPLE, loop_record
from robid.errors import DataError
from robid.frf.channels import limit_shares, saturation_error
from robid.frf.checks import check_record, refuse_faults
from robid.signals.quantities import Channel
from robid.signals.record import Record

NOISE = 1e-5  # of angles that move by 1e-2


def stream_of(record: Record):
    """Torque and position (1, n_real, n_exp, n_time, n_channel) without the cuts between the periods."""
    joined = (one.reshape(*one.shape[:3], -1, one.shape[-1]) for one in (record.inputs, record.outputs))
    return [one.copy() for one in joined]


def cut(record: Record, streams, n_sample=N_SAMPLE, periods=2) -> Record:
    """Cuts streams into periods."""
    shaped = [
        one[:, :, :, : periods * n_sample].reshape(*one.shape[:3], periods, n_sample, one.shape[-1]) for one in streams
    ]
    return replace(record, inputs=shaped[0], outputs=shaped[1])


def without(stream, experiment, sample, count):
    """Loses samples of one experiment of the second realization."""
    stream = stream.copy()
    part = stream[0, 1, experiment]
    stream[0, 1, experiment, : len(part) - count] = np.delete(part, np.s_[sample : sample + count], axis=0)
    return stream


@pytest.fixture(scope="module")
def good():
    return loop_record(cubic=3.0, noise=NOISE, periods=4)[0]


def single(record):
    found = check_record(record)
    assert len(found) == 1
    return found[0]


# With 1e-3 rad of noise the speed from sample to sample is noise.
@pytest.mark.parametrize("noise", [0.0, 1e-6, 1e-4, 1e-3, 1e-2])
@pytest.mark.parametrize("periods", [1, 2, 5])
def test_good_records_raise_no_alarm(noise, periods):
    for seed in range(3):
        kinds = {one.kind for one in check_record(loop_record(noise=noise, periods=periods, seed=seed)[0])}
        assert kinds <= ({"still"} if noise >= 1e-3 else set())


@pytest.mark.parametrize("longer", [-1, 1, 7])
def test_wrong_period_is_named_with_the_right_one(good, longer):
    damaged = cut(good, stream_of(good), N_SAMPLE + longer, periods=3)
    found = single(damaged)
    assert (found.kind, found.fatal) == ("period", True)
    assert f"repeat every {N_SAMPLE} samples, not every {N_SAMPLE + longer}" in found.what
    with pytest.raises(DataError, match="set the period to 2 s"):
        refuse_faults(damaged, [found])


@pytest.mark.parametrize("count", [1, 3, 60])
@pytest.mark.parametrize("sample", [40, 200, 480, 512, 700, 990])
def test_dropped_samples_are_located(good, count, sample):
    streams = [without(one, 1, sample, count) for one in stream_of(good)]
    found = single(cut(good, streams))
    assert (found.kind, found.fatal) == ("dropped", True)
    noun = f"{count} sample{'s' if count > 1 else ''} missing"
    assert f"realization 2, experiment 2: {noun}" in found.what
    assert "all channels" in found.what or count == 1
    if sample == N_SAMPLE or "between" in found.what:
        assert "between periods 1 and 2" in found.what
        assert abs(sample - N_SAMPLE) <= N_SAMPLE // 16
        return
    period, near = (int(found.what.split(word)[1].split()[0]) for word in ("in period ", "near sample "))
    assert period == sample // N_SAMPLE + 1
    assert abs(near - 1 - sample % N_SAMPLE) <= 16


def test_a_single_channel_that_loses_a_sample_is_named(good):
    torque, position = stream_of(good)
    position[..., 1] = without(position, 0, 300, 2)[..., 1]
    found = single(cut(good, [torque, position]))
    assert found.kind == "dropped"
    assert "experiment 1: 2 samples missing" in found.what
    assert "(second)" in found.what


def jittered(record, std, seed=0):
    """Samples all channels of each experiment at displaced instants."""
    streams = stream_of(record)
    shift = std * np.random.default_rng(seed).standard_normal((*streams[0].shape[:4], 1))
    return cut(record, [one + shift * np.gradient(one, axis=3) for one in streams], periods=4)


@pytest.mark.parametrize("std", [0.15, 0.4])
def test_jitter_is_measured(std):
    clean = loop_record(periods=4)[0]
    noisy = loop_record(noise=NOISE, periods=4)[0]
    difference = [b - a for a, b in zip(stream_of(clean), stream_of(noisy), strict=True)]
    streams = [a + b for a, b in zip(stream_of(jittered(clean, std)), difference, strict=True)]
    found = single(cut(clean, streams, periods=4))
    assert (found.kind, found.fatal) == ("jitter", True)
    np.testing.assert_allclose(float(found.what.split("by ")[1].split()[0]), std, rtol=0.15)


def test_saturated_torque_is_named(good):
    torque = good.inputs.copy()
    limit = np.quantile(np.abs(torque[0, 2, 1, ..., 0]), 0.97)
    torque[0, 2, 1, ..., 0] = np.clip(torque[0, 2, 1, ..., 0], -limit, limit)
    found = single(replace(good, inputs=torque))
    assert (found.kind, found.fatal) == ("saturation", False)
    assert found.what.startswith("D228 first: torque saturates for 3")
    assert "realization 3, experiment 2" in found.what


def test_a_response_is_off_by_about_what_saturation_says():
    generator = np.random.default_rng(2)
    signal = generator.standard_normal((1, 4, 4, 1, 20_000, 1))
    clipped = np.clip(signal, -1.5, 1.5)
    motor, sensor = Channel("drive", "torque", "N m", "motor"), Channel("tip", "acceleration", "m/s^2", "tool")
    angle = Channel("drive", "angle", "rad", "motor")
    record = Record(
        sampling_period_s=1e-3,
        inputs=clipped,
        outputs=np.concatenate([clipped, signal], axis=-1),
        output_offset=np.zeros((1, 2)),
        input_channels=(motor,),
        output_channels=(angle, sensor),
        configurations=np.zeros((1, 1)),
        excited_lines=np.arange(1, 100),
    )
    ((share,),), outputs = limit_shares(record).levels(1).values()
    np.testing.assert_allclose(share, np.mean(np.abs(clipped) == 1.5), rtol=0.03)
    np.testing.assert_array_equal(outputs, 0.0)
    off = abs(np.mean(signal**2) / np.mean(signal * clipped) - 1)
    np.testing.assert_allclose(saturation_error(share), off, rtol=0.03)
    sound = replace(record, inputs=signal, outputs=np.concatenate([clipped, clipped], axis=-1))
    inputs, outputs = limit_shares(sound).levels(1).values()
    np.testing.assert_array_equal(inputs, 0.0)
    np.testing.assert_allclose(outputs, [[0, share]], rtol=0.03)


def test_a_signal_of_two_values_is_not_saturated(good):
    assert check_record(replace(good, inputs=np.sign(good.inputs))) == []


def test_a_force_that_rests_between_blows_is_not_saturated_and_a_clipped_blow_is(good):
    phase = np.arange(N_SAMPLE) % 50
    blows = np.where(phase < 8, np.sin(np.pi * phase / 8), 0.0)[:, None] * np.linspace(1.0, 1.1, N_SAMPLE)[:, None]
    force = np.broadcast_to(blows, good.inputs.shape).copy()
    assert check_record(replace(good, inputs=force)) == []
    found = check_record(replace(good, inputs=np.minimum(force, 0.6)))
    assert [one.kind for one in found] == ["saturation", "saturation"]
    assert "saturates for 1" in found[0].what


@pytest.mark.parametrize("share", [0.2, 0.7])
def test_pulses_of_two_values_are_not_saturated(good, share):
    pulses = (np.arange(N_SAMPLE) % 50 < 50 * share)[:, None] * np.ones(good.inputs.shape)
    assert check_record(replace(good, inputs=pulses)) == []


@pytest.mark.parametrize("levels", [40, 400])
def test_coarse_torque_is_not_saturated(good, levels):
    step = np.ptp(good.inputs) / levels
    assert check_record(replace(good, inputs=np.round(good.inputs / step) * step)) == []


def test_motor_that_stands_still_is_named(good):
    position = good.outputs.copy()
    dwell = position[0, 3, 0, :, :200, 1]
    dwell[:] = dwell.mean(axis=-1, keepdims=True)
    found = single(replace(good, outputs=position))
    assert (found.kind, found.fatal) == ("still", False)
    assert found.what.startswith("D230 second:")
    assert "realization 4, experiment 1" in found.what
    told = [replace(channel, side="tool") for channel in good.output_channels]
    assert check_record(replace(good, outputs=position, output_channels=tuple(told))) == []
    position[..., 0] = NOISE * np.random.default_rng(1).standard_normal(position.shape[:-1])
    found = check_record(replace(good, outputs=position))
    assert any(one.what.startswith("D229 first:") for one in found)
