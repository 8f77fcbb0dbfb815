"""Rows block by block against the whole record at once."""

import numpy as np
import pytest

from rigid_models import Arm, Slide
from robid.errors import DataError
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.models.rigid.fit.rows import Reading, Remembered, prepare, speed_noise
from robid.models.rigid.fit.shots import Shot
from robid.signals.filters import central_differences, low_pass, low_pass_reach
from tolerances import IDENTITY

PERIOD_S = 2e-3
OPTIONS = PreprocessingOptions(position_cut_hz=25.0)


def _record(n_sample=4000, seed=0):
    generator = np.random.default_rng(seed)
    time = PERIOD_S * np.arange(n_sample)[:, None]
    position = np.sin(2 * np.pi * np.array([0.7, 1.1]) * time) + 0.4 * np.cos(2 * np.pi * np.array([2.3, 1.9]) * time)
    return position, generator.standard_normal((n_sample, 2))


def _whole(options, position, torque):
    """The same rows from arrays that are whole in memory, by plain convolution."""
    reach = low_pass_reach(PERIOD_S, options.position_cut_hz, options.position_order)
    smooth = low_pass(position, PERIOD_S, options.position_cut_hz, options.position_order)[reach:-reach]
    velocity, acceleration = central_differences(smooth, PERIOD_S)
    decimator = options.decimator(PERIOD_S)
    columns = Arm().columns(smooth[1:-1], velocity, acceleration)
    kept = decimator.kept(len(columns))

    def filtered(values):
        return np.apply_along_axis(np.convolve, 0, values, decimator.kernel, "same")[kept]

    return filtered(columns), filtered(torque[reach:-reach][1:-1])


@pytest.mark.parametrize("block_samples", [1, 700, 100_000])
def test_blocks_are_the_whole_record(block_samples):
    position, torque = _record()
    motion = prepare(position, torque, PERIOD_S, OPTIONS)
    reading = Reading([motion], Arm(), OPTIONS.decimator(PERIOD_S), block_samples)
    columns, right = _whole(OPTIONS, position, torque)
    assert (len(reading) == 1) == (block_samples > 10_000)
    scale = np.abs(columns).max()
    np.testing.assert_allclose(np.concatenate([rows.columns for rows in reading]), columns, atol=IDENTITY * scale)
    np.testing.assert_allclose(np.concatenate([rows.torque for rows in reading]), right, atol=IDENTITY)
    assert all(rows.used.all() for rows in reading)


def test_records_follow_each_other_and_never_mix():
    motions = [prepare(*_record(seed=seed, n_sample=n), PERIOD_S, OPTIONS) for seed, n in ((0, 2500), (1, 3100))]
    decimator = OPTIONS.decimator(PERIOD_S)
    both = np.concatenate([rows.torque for rows in Reading(motions, Arm(), decimator)])
    single = [np.concatenate([rows.torque for rows in Reading([m], Arm(), decimator)]) for m in motions]
    np.testing.assert_array_equal(both, np.concatenate(single))


def test_remembered_rows_are_made_once_as_far_as_the_budget_goes():
    made = []

    class Counted(Arm):
        def columns(self, *arguments, **others):
            made.append(1)
            return super().columns(*arguments, **others)

    motion = prepare(*_record(), PERIOD_S, OPTIONS)
    reading = Reading([motion], Counted(), OPTIONS.decimator(PERIOD_S), 700)
    plain = [rows.columns for rows in reading]
    budget = sum(reading[index].n_byte for index in range(2))
    made.clear()
    remembered = Remembered(reading, budget)
    for _ in range(3):
        for one, other in zip(remembered, plain, strict=True):
            np.testing.assert_array_equal(one.columns, other)
    assert len(made) == len(plain) + 2 * (len(plain) - 2)


def test_slow_samples_are_dropped_by_the_instruments_speed():
    generator = np.random.default_rng(3)
    time = PERIOD_S * np.arange(5000)[:, None]
    true = np.sin(2 * np.pi * time)
    noisy = true + 1e-3 * generator.standard_normal(true.shape)
    options = PreprocessingOptions(25.0, drop_deviations=6.0)
    motion = prepare(noisy, np.zeros_like(true), PERIOD_S, options, instrument=np.roll(true, 125, axis=0))
    assert prepare(noisy, np.zeros_like(true), PERIOD_S, OPTIONS).slow == 0
    decimator = options.decimator(PERIOD_S)
    used = np.concatenate([rows.used for rows in Reading([motion], Slide(), decimator, 900)])[:, 0]
    smooth = motion.smooth(motion.instrument, motion.reach, 5000 - motion.reach)
    speed = np.abs(central_differences(smooth, PERIOD_S)[0][:, 0])
    around = range(-decimator.factor, decimator.factor + 1)
    expected = [
        min(speed[index + offset] for offset in around) >= motion.slow[0] for index in decimator.kept(len(speed))
    ]
    np.testing.assert_array_equal(used, expected)
    assert 0.05 < np.mean(~used) < 0.3


def test_the_instruments_speed_gives_friction_its_sign():
    position, torque = _record()
    late = np.roll(position, 60, axis=0)
    motion = prepare(position, torque, PERIOD_S, OPTIONS, instrument=late)
    (rows,) = Reading([motion], Arm(), OPTIONS.decimator(PERIOD_S))
    (alone,) = Reading([prepare(late, torque, PERIOD_S, OPTIONS)], Arm(), OPTIONS.decimator(PERIOD_S))
    (own,) = Reading([prepare(position, torque, PERIOD_S, OPTIONS)], Arm(), OPTIONS.decimator(PERIOD_S))
    np.testing.assert_array_equal(rows.instruments, alone.columns)
    np.testing.assert_array_equal(rows.columns[..., 6:], alone.columns[..., 6:])
    np.testing.assert_array_equal(rows.columns[..., :6], own.columns[..., :6])
    assert np.abs(own.columns - alone.columns)[..., 6:].max() > 1


def test_noise_of_the_speed_is_estimated_from_what_the_filter_took():
    generator = np.random.default_rng(5)
    position = 1e-3 * generator.standard_normal((200_000, 1))
    for cut_hz in (25.0, 180.0):
        smooth = low_pass(position, PERIOD_S, cut_hz)
        speed, _ = central_differences(smooth, PERIOD_S)
        found = speed_noise(position - smooth, PERIOD_S, PreprocessingOptions(cut_hz))
        assert found[0] == pytest.approx(speed.std(), rel=0.02)


def test_a_held_torque_is_centred_about_its_samples():
    position, _ = _record()
    ramp = np.tile(np.arange(4000.0)[:, None], 2)
    motions = (prepare(position, ramp, PERIOD_S, OPTIONS, held=held) for held in (False, True))
    (plain,), (held,) = (Reading([motion], Arm(), OPTIONS.decimator(PERIOD_S)) for motion in motions)
    np.testing.assert_allclose(plain.torque - held.torque, 0.5, rtol=1e-6)


def test_a_record_shorter_than_its_filters_is_refused():
    with pytest.raises(ValueError, match="ends of its filter"):
        prepare(*_record(n_sample=60), PERIOD_S, OPTIONS)


def test_the_regressor_is_told_of_payload_and_low_passed_torques():
    told = {}

    class Listening(Arm):
        def columns(self, *motion, torque=None, loaded=True, **others):
            told.update(torque=torque, loaded=loaded)
            return super().columns(*motion, **others)

    position, torque = _record()
    for load_dependent, loaded in ((False, True), (True, False)):
        motion = prepare(position, torque, PERIOD_S, OPTIONS, load_dependent=load_dependent, loaded=loaded)
        list(Reading([motion], Listening(), OPTIONS.decimator(PERIOD_S)))
        assert told["loaded"] == loaded
        assert (told["torque"] is None) == (not load_dependent)
    inner = slice(motion.reach + 1, -motion.reach - 1)
    whole = low_pass(torque, PERIOD_S, 25.0)[inner]
    np.testing.assert_allclose(told["torque"], whole[: len(told["torque"])], atol=IDENTITY)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("field", ["position", "torque"])
def test_samples_that_are_no_numbers_are_refused_where_they_enter(field, value):
    signals = dict(zip(("position", "torque"), _record(), strict=True))
    Shot(**signals, sampling_period_s=PERIOD_S, held=True)
    signals[field][17, 1] = value
    with pytest.raises(DataError) as caught:
        Shot(**signals, sampling_period_s=PERIOD_S, held=True)
    assert caught.value.codes == ("D451",)
    assert {"17", "2"} <= set(str(caught.value).replace(",", " ").split())  # samples count from 0, joints from 1
