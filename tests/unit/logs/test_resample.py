"""Resampling of logs: the samples that another clock would have taken, and the error that is told of them."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import savemat

from robid.errors import DataError
from robid.logs.bridging import interpolation_error
from robid.logs.importing import import_log, import_shot
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel

STEP, PERIOD, PERIODS = 1e-3, 500, 6
LINES = np.arange(3, 60)
PHASES = np.random.default_rng(1).uniform(0, 2 * np.pi, (2, len(LINES)))


def waves(time_s):
    """A torque and a motion that repeat every 0.5 s, at any moment."""
    angle = 2 * np.pi * np.outer(time_s / (PERIOD * STEP), LINES)
    torque, motion = (np.cos(angle + phase).sum(axis=1) for phase in PHASES)
    return torque, motion


def mapping_of(file, **changes):
    mapping = LogMapping(
        file=file,
        sampling_period_s=STEP,
        time=TimeChannel("t", "s"),
        inputs=(InputChannel("motor", "u", "N m"),),
        outputs=(OutputChannel("motor", "q"),),
    )
    return replace(mapping, **changes)


def import_waves(folder, time_s, told_s=None, periods=PERIODS - 1, **changes):
    torque, motion = waves(time_s)
    told_s = time_s if told_s is None else told_s
    savemat(folder / "log.mat", {"u": torque[:, None], "q": motion[:, None], "t": told_s[:, None]})
    return import_log(
        mapping_of(folder / "log.mat", **changes),
        samples_per_period=PERIOD,
        periods=periods,
        excited_lines=LINES,
        configurations=np.zeros((1, 1)),
    )


def wrong_by(record):
    """Relative error of torque and motion against the waves at the stated clock."""
    torque, motion = waves(STEP * np.arange(record.inputs.shape[3] * PERIOD))
    pairs = ((record.inputs, torque), (record.outputs + record.output_offset, motion))
    return max(float(np.std(found.ravel() - wanted) / np.std(wanted)) for found, wanted in pairs)


@pytest.mark.parametrize("rate", [1.01, 0.99, 1.0004])
def test_a_log_is_brought_to_the_stated_steps_of_its_own_time(tmp_path, rate):
    time_s = rate * STEP * np.arange(PERIODS * PERIOD)
    record = import_waves(tmp_path, time_s, resample="time")
    assert wrong_by(record) < 1e-6
    note = next(note for note in record.notes if "Resampled" in note)
    told = float(re.search(r"errors of ([\d.e-]+) %", note)[1]) / 100
    assert wrong_by(record) < 3 * told < 1e-4


def test_instants_that_jitter_are_evened(tmp_path):
    generator = np.random.default_rng(2)
    time_s = STEP * np.arange(PERIODS * PERIOD) + 0.15 * STEP * generator.uniform(-1, 1, PERIODS * PERIOD)
    time_s[0] = 0.0
    with pytest.raises(DataError, match=r"deviate from 0\.001 s by up to") as caught:
        import_waves(tmp_path, time_s)
    assert "Set resample to time" in caught.value.remedy
    assert wrong_by(import_waves(tmp_path, time_s, resample="time")) < 1e-5


def test_stamps_that_are_only_rounded_move_no_sample(tmp_path):
    time_s = 1.003 * STEP * np.arange(PERIODS * PERIOD)
    record = import_waves(tmp_path, time_s, np.round(time_s, 5), resample="time")
    assert wrong_by(record) < 1e-4


@pytest.mark.parametrize("rate", [1.0004, 0.97])
def test_a_log_is_brought_to_the_clock_of_the_generator(tmp_path, rate):
    steps = np.arange(PERIODS * PERIOD)
    with pytest.raises(DataError, match="D099") as caught:
        import_waves(tmp_path, rate * STEP * steps, STEP * steps)
    assert "Set resample to period" in caught.value.remedy
    record = import_waves(tmp_path, rate * STEP * steps, STEP * steps, resample="period")
    assert wrong_by(record) < 1e-5
    assert any("Resampled so that a period of" in note for note in record.notes)


def test_a_right_clock_stays_what_it_was(tmp_path):
    steps = STEP * np.arange(PERIODS * PERIOD)
    plain = import_waves(tmp_path, steps)
    for clock in ("time", "period"):
        found = import_waves(tmp_path, steps, resample=clock)
        np.testing.assert_allclose(found.inputs, plain.inputs, atol=1e-6 * np.ptp(plain.inputs))


def test_angles_are_unwrapped_before_they_are_resampled(tmp_path):
    time_s = 1.02 * STEP * np.arange(1500)
    turned = 40 * time_s + np.sin(60 * time_s)
    wrapped = np.degrees(np.angle(np.exp(1j * turned)))
    savemat(tmp_path / "log.mat", {"u": np.cos(time_s)[:, None], "q": wrapped[:, None], "t": time_s[:, None]})
    outputs = (OutputChannel("A", "q", "deg", side="tool"),)
    record = import_shot(mapping_of(tmp_path / "log.mat", outputs=outputs, one_shot=True, resample="time"))
    even = STEP * np.arange(record.outputs.shape[4])
    np.testing.assert_allclose(record.outputs.ravel(), 40 * even + np.sin(60 * even), atol=1e-6)


@pytest.mark.parametrize(
    ("time_s", "words"),
    [
        (1.3 * STEP * np.arange(PERIODS * PERIOD), "resampling bridges 5% at most"),
        (1.01 * STEP * (np.arange(3000) + 40 * (np.arange(3000) > 1700)), "D109"),
        (1.001 * STEP * np.arange(5), "5 samples, and resampling needs 8"),
    ],
)
def test_what_resampling_cannot_mend_is_refused(tmp_path, time_s, words):
    with pytest.raises(DataError, match=words):
        import_waves(tmp_path, time_s, resample="time")


@pytest.mark.parametrize("line", [50, 200, 400])
def test_the_error_of_a_wave_is_that_of_the_spline(line):
    from scipy.interpolate import make_interp_spline

    index = np.arange(2000.0)
    wave = np.cos(2 * np.pi * line * index / 2000)
    between = index[200:-200] + 0.5
    found = make_interp_spline(index, wave, k=7)(between) - np.cos(2 * np.pi * line * between / 2000)
    told = interpolation_error(wave)
    assert 0.3 < float(found.std()) / (np.sqrt(0.5) * told) < 1.5 or float(found.std()) < 1e-12


def losing(share, noise=0.0, seed=5):
    """Time stamps and noise of the torque of a log that loses rows here and there."""
    generator = np.random.default_rng(seed)
    count = PERIODS * PERIOD
    kept = generator.random(count) >= share
    kept[0] = True
    return STEP * np.arange(count)[kept], noise * generator.standard_normal(count), kept


def import_losing(folder, share, noise=0.0, **changes):
    """The record of such a log, and what it would be without the losses."""
    time_s, noisy, kept = losing(share, noise)
    torque, motion = waves(STEP * np.arange(PERIODS * PERIOD))
    torque = torque + noisy * torque.std()
    columns = {"t": time_s, "u": torque[kept], "q": motion[kept]}
    savemat(folder / "log.mat", {name: values[:, None] for name, values in columns.items()})
    told = {"samples_per_period": PERIOD, "periods": PERIODS - 1, "excited_lines": LINES}
    record = import_log(mapping_of(folder / "log.mat", **changes), configurations=np.zeros((1, 1)), **told)
    used = (PERIODS - 1) * PERIOD
    found = np.stack([record.inputs.ravel(), (record.outputs + record.output_offset).ravel()])
    return record, found, np.stack([torque[:used], motion[:used]]), np.flatnonzero(~kept[:used])


@pytest.mark.parametrize("share", [3e-4, 1e-2])
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_few_lost_samples_are_filled_and_all_others_stay(tmp_path, share, noise):
    record, found, wanted, lost = import_losing(tmp_path, share, noise, resample="time")
    assert len(lost) > 0
    kept = np.setdiff1d(np.arange(found.shape[1]), lost)
    np.testing.assert_allclose(found[:, kept], wanted[:, kept], atol=1e-9 * np.abs(wanted).max())
    error = ((found - wanted).std(axis=1) / wanted.std(axis=1)).max()
    told = float(re.search(r"errors of ([\d.e-]+) %", next(one for one in record.notes if "Resampled" in one))[1]) / 100
    assert error < 2 * told < 0.06


def test_the_remedy_of_lost_samples_fills_them_where_it_can(tmp_path):
    with pytest.raises(DataError, match="D126") as caught:
        import_losing(tmp_path, 1e-2, 0.1)
    assert "Set resample to time" in caught.value.remedy
    with pytest.raises(DataError, match="D126") as caught:
        import_losing(tmp_path, 0.03, 0.5)  # what would be put in would be off by a tenth of the torque
    assert "Set resample to time:" not in caught.value.remedy
    with pytest.raises(DataError, match="D109"):
        import_losing(tmp_path, 0.03, 0.5, resample="time")


def test_few_values_that_are_missing_are_filled_as_lost_rows_are(tmp_path):
    torque, motion = waves(STEP * np.arange(PERIODS * PERIOD))
    columns = {"t": STEP * np.arange(PERIODS * PERIOD), "u": torque.copy(), "q": motion.copy()}
    columns["u"][[40, 1200]], columns["q"][[700, 701]] = np.nan, np.inf
    savemat(tmp_path / "log.mat", {name: values[:, None] for name, values in columns.items()})
    told = {"samples_per_period": PERIOD, "periods": PERIODS, "excited_lines": LINES}
    with pytest.raises(DataError, match="D043") as caught:
        import_log(mapping_of(tmp_path / "log.mat"), configurations=np.zeros((1, 1)), **told)
    assert "Set resample to time" in str(caught.value)
    mapping = mapping_of(tmp_path / "log.mat", resample="time")
    record = import_log(mapping, configurations=np.zeros((1, 1)), **told)
    assert any(note.startswith("log.mat: 4 rows") for note in record.notes)
    assert wrong_by(record) < 2e-3
    columns["q"][900:940] = np.nan
    savemat(tmp_path / "log.mat", {name: values[:, None] for name, values in columns.items()})
    with pytest.raises(DataError, match="D043") as caught:
        import_log(mapping, configurations=np.zeros((1, 1)), **told)
    assert "from_s to 0.94" in str(caught.value)
