"""Time stamps of arrival: samples taken evenly and stamped late are told from samples that were taken unevenly."""

from dataclasses import replace

import numpy as np
import pytest

from robid.errors import DataError
from robid.logs.arrival import find_arrivals
from robid.logs.importing import import_shot
from robid.logs.inspection.findings import inspect_log
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel

STEP, COUNT = 1e-3, 4000
EVEN = STEP * np.arange(COUNT)


def angle(time_s):
    return np.sin(2 * np.pi * 1.3 * time_s) + 0.2 * np.sin(2 * np.pi * 7 * time_s)


def torque(time_s, seed=3):
    noise = np.random.default_rng(seed).standard_normal(len(time_s))
    return np.cos(2 * np.pi * 1.3 * time_s) + 0.3 * noise


def arrivals(kind, seed=1):
    """Stamps of samples that were taken evenly: in disorder by a part of a step, or held back and then in bursts."""
    generator = np.random.default_rng(seed)
    if kind == "jitter":
        return EVEN + STEP * generator.uniform(-0.2, 0.2, COUNT)
    late = STEP * generator.exponential(0.15, COUNT)
    late[generator.random(COUNT) < 0.01] += 3 * STEP
    return np.maximum.accumulate(EVEN + late) + 1e-9 * np.arange(COUNT)


def mapping_of(file, **changes):
    mapping = LogMapping(
        file=file,
        sampling_period_s=STEP,
        time=TimeChannel("t [s]", "s"),
        inputs=(InputChannel("motor", "tau [Nm]", "N m"),),
        outputs=(OutputChannel("motor", "q [rad]"),),
        one_shot=True,
    )
    return replace(mapping, **changes)


@pytest.mark.parametrize("kind", ["jitter", "bursts"])
@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_samples_that_were_taken_evenly_get_even_times(kind, noise):
    stamps = arrivals(kind)
    moving = angle(EVEN) + noise * np.random.default_rng(2).standard_normal(COUNT)
    found = find_arrivals(stamps, [torque(EVEN), moving])
    assert found.signal == 1
    assert found.smoother > 3
    off = found.times - EVEN
    assert np.ptp(off) < 0.1 * STEP
    assert found.late == pytest.approx((stamps - EVEN).max() - off.mean(), rel=0.1)


@pytest.mark.parametrize("kind", ["jitter", "bursts"])
def test_stamps_of_the_moments_of_sampling_stay(kind):
    stamps = arrivals(kind)
    assert find_arrivals(stamps, [torque(stamps), angle(stamps)]) is None


def test_noise_alone_tells_nothing():
    noise = np.random.default_rng(5).standard_normal((3, COUNT))
    for kind in ("jitter", "bursts"):
        assert find_arrivals(arrivals(kind), list(noise)) is None


def test_signals_that_contradict_each_other_leave_stamps_as_they_are():
    stamps = arrivals("jitter")  # a command counts ticks, a measured angle does not
    assert find_arrivals(stamps, [angle(EVEN), angle(stamps)]) is None


def test_samples_that_were_lost_are_gaps_where_they_are_told_from_late_ones():
    kept = np.delete(np.arange(COUNT), [1000, 2500, 2501])
    found = find_arrivals(arrivals("jitter")[kept], [angle(EVEN[kept])])
    assert np.ptp(found.times - EVEN[kept]) < 0.1 * STEP
    assert find_arrivals(arrivals("bursts")[kept], [angle(EVEN[kept])]) is None
    assert find_arrivals(arrivals("jitter")[kept], [angle(arrivals("jitter")[kept])]) is None


@pytest.mark.parametrize("stamps", [EVEN, np.round(EVEN / 4, 3), 0 * EVEN, EVEN[::-1]])
def test_even_rounded_and_senseless_stamps_are_no_matter_of_arrival(stamps):
    assert find_arrivals(stamps, [angle(EVEN)]) is None


def logged(folder, kind):
    table = np.stack([arrivals(kind), torque(EVEN), angle(EVEN)], axis=1)
    np.savetxt(folder / "log.csv", table, fmt="%.12g", delimiter=",", header="t [s],tau [Nm],q [rad]", comments="")
    return folder / "log.csv"


@pytest.mark.parametrize("kind", ["jitter", "bursts"])
@pytest.mark.parametrize("resample", [None, "time"])
def test_a_log_with_stamps_of_arrival_keeps_its_samples(tmp_path, kind, resample):
    mapping = mapping_of(logged(tmp_path, kind))
    # Evenly taken: nothing is to be resampled but for the clock's rate, which stamps tell to some parts in a million.
    record = import_shot(replace(mapping, resample="time" if resample else None))
    found = record.outputs.ravel() + record.output_offset.ravel()
    count = min(len(found), COUNT)
    np.testing.assert_allclose(found[:count], angle(EVEN)[:count], atol=2e-3)
    assert any("say when samples arrived" in note for note in record.notes)


def test_what_arrived_by_two_ways_keeps_its_lag_though_one_of_them_is_noise(tmp_path):
    lag = 0.4e-3
    rows = [(at, f"{value:.12g},") for at, value in zip(arrivals("bursts", 4) + lag, torque(EVEN + lag), strict=True)]
    rows += [(at, f",{value:.12g}") for at, value in zip(arrivals("bursts"), angle(EVEN), strict=True)]
    lines = ["t [s],tau [Nm],q [rad]", *(f"{at:.12g},{rest}" for at, rest in sorted(rows))]
    (tmp_path / "log.csv").write_text("\n".join(lines))
    mapping = mapping_of(tmp_path / "log.csv", resample="time")
    record = import_shot(mapping)
    found, angles = record.inputs.ravel(), record.outputs.ravel() + record.output_offset.ravel()
    # The first torque is a lag later than the first angle: which of its samples that is tells the noise.
    begin = int(np.argmin([np.std(found[:500] - torque(EVEN + lag)[k : k + 500]) for k in range(60)]))
    count = min(len(angles), COUNT - 60)
    np.testing.assert_allclose(angles[:count], angle(EVEN[:count] + lag + begin * STEP), atol=3e-3)


def test_bursts_that_nothing_explains_are_refused_and_leaving_out_time_helps(tmp_path):
    kept = np.delete(np.arange(COUNT), 1000)  # a loss is not told from a late sample
    table = np.stack([arrivals("bursts")[kept], torque(EVEN)[kept], angle(EVEN)[kept]], axis=1)
    np.savetxt(tmp_path / "log.csv", table, fmt="%.12g", delimiter=",", header="t [s],tau [Nm],q [rad]", comments="")
    mapping = mapping_of(tmp_path / "log.csv", resample="time")
    with pytest.raises(DataError, match="D680") as caught:
        import_shot(mapping)
    assert "Leave out `time`" in caught.value.remedy
    record = import_shot(replace(mapping, time=None, resample=None))
    assert record.outputs.size == COUNT - 1


@pytest.mark.parametrize("kind", ["jitter", "bursts"])
def test_an_inspection_says_so_and_proposes_no_resampling(tmp_path, kind):
    found = inspect_log([logged(tmp_path, kind)])
    assert found.proposal.resample == ""
    assert found.proposal.part_s is None
    assert found.sampling.step_s == pytest.approx(STEP, rel=1e-4)
    assert any("says when samples arrived" in note for note in found.contents.notes)
