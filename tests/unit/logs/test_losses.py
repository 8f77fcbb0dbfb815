"""Lost samples of a log without time: told from another clock, named, and a remedy that holds when followed."""

import re

import numpy as np
import pytest
from scipy.io import savemat
from scipy.signal import lfilter

from robid.errors import DataError
from robid.logs.importing import import_log
from robid.logs.losses import find_losses
from robid.logs.mapping import LogMapping
from robid.logs.period import measure_repetition
from robid.logs.placing import PlayedExcitation
from robid.signals.log_channels import InputChannel, OutputChannel, ReferenceChannel
from robid.signals.log_options import TimeChannel

PERIOD, LINES = 1000, np.arange(10, 200)
PHASES = np.random.default_rng(3).uniform(0, 2 * np.pi, len(LINES))


def wave(periods, rate=1.0):
    at = np.arange(int(periods * PERIOD * rate)) / rate
    return np.cos(2 * np.pi * np.outer(at / PERIOD, LINES) + PHASES).sum(axis=1) / 10


def import_waves(folder, signal, periods, time_s=None, **settings):
    columns = {"u": signal[:, None], "q": np.roll(signal, 3)[:, None]}
    savemat(folder / "log.mat", columns if time_s is None else {**columns, "t": time_s[:, None]})
    mapping = LogMapping(
        file=folder / "log.mat",
        sampling_period_s=1e-3,
        inputs=(InputChannel("motor", "u", "N m"),),
        outputs=(OutputChannel("motor", "q"),),
        **settings,
    )
    return import_log(
        mapping, samples_per_period=PERIOD, periods=periods, excited_lines=LINES, configurations=np.zeros((1, 1))
    )


def without(signal, *after, count=1):
    return np.delete(signal, [at + 1 + more for at in after for more in range(count)])


def lost_of(signal):
    return find_losses(signal, PERIOD, LINES, measure_repetition(signal, PERIOD, LINES).samples)


@pytest.mark.parametrize("after", [300, 1281, 2900, 4500])
@pytest.mark.parametrize("count", [1, 4])
def test_a_loss_is_found_where_it_is(after, count):
    noise = 0.1 * np.random.default_rng(after).normal(size=5 * PERIOD - count)
    (found,) = lost_of(without(wave(5), after, count=count) + noise)
    assert found.samples == count
    assert found.after == pytest.approx(after, abs=10)


def test_a_sample_too_many_and_two_losses_are_told_as_they_are():
    (found,) = lost_of(np.insert(wave(5), 2300, 0.0))
    assert (found.samples, found.after) == (-1, pytest.approx(2300, abs=10))
    assert [one.samples for one in lost_of(without(wave(6), 1400, 3700))] == [1, 1]


@pytest.mark.parametrize("fraction", [0.05, 0.26, 0.5, 0.9, -1.3])
def test_another_clock_loses_nothing(fraction):
    assert lost_of(wave(5, 1 + fraction / PERIOD)) == []


@pytest.mark.parametrize("after", [940, 970, 985, 990, 998, 999, 1010, 1030])
@pytest.mark.parametrize("noise", [0.0, 0.1])
def test_a_loss_near_the_middle_of_two_periods_is_no_other_period(after, noise):
    generator = np.random.default_rng(after)
    (found,) = lost_of(without(wave(2), after) + noise * generator.normal(size=2 * PERIOD - 1))
    assert (found.samples, found.after) == (1, pytest.approx(after, abs=15))


@pytest.mark.parametrize("after", [300, 700, 1500, 2400])
@pytest.mark.parametrize("highest", [60, 200])
def test_a_loss_under_noise_of_30_percent_is_found(after, highest):
    lines, generator = np.arange(3, highest), np.random.default_rng(after + highest)
    phases = generator.uniform(0, 2 * np.pi, len(lines))
    clean = np.cos(2 * np.pi * np.outer(np.arange(3 * PERIOD) / PERIOD, lines) + phases).sum(axis=1)
    signal = without(clean, after) + 0.3 * clean.std() * generator.normal(size=3 * PERIOD - 1)
    found = find_losses(signal, PERIOD, lines, measure_repetition(signal, PERIOD, lines).samples)
    assert 1 in [one.samples for one in found]
    # Slow waves tell less exactly where.
    assert min(abs(one.after - after) for one in found) < 100


@pytest.mark.parametrize("periods", [2, 3, 5])
@pytest.mark.parametrize("highest", [30, 200])
@pytest.mark.parametrize("colour", [0.0, 0.98])
def test_noise_and_wandering_lose_nothing(periods, highest, colour):
    lines = np.arange(3, highest)
    for seed in range(3):
        generator = np.random.default_rng(seed)
        phases = generator.uniform(0, 2 * np.pi, len(lines))
        clean = np.cos(2 * np.pi * np.outer(np.arange(periods * PERIOD) / PERIOD, lines) + phases).sum(axis=1)
        noise = lfilter([1.0], [1.0, -colour], generator.normal(size=len(clean)))
        for share in (0.0, 0.1, 0.3):
            signal = clean + share * clean.std() / noise.std() * noise
            assert find_losses(signal, PERIOD, lines, measure_repetition(signal, PERIOD, lines).samples) == []


def test_a_period_that_is_one_sample_shorter_loses_nothing():
    at = np.arange(2.0 * PERIOD)
    shorter = np.cos(2 * np.pi * np.outer(at / (PERIOD - 1), LINES) + PHASES).sum(axis=1) / 10
    assert lost_of(shorter) == []


def import_references(folder, signal, periods, **settings):
    """A log with the reference, at rest before and after."""
    logged = np.concatenate([np.zeros(137), signal, np.zeros(211)])
    columns = {"u": logged, "q": np.roll(logged, 3), "r": logged}
    savemat(folder / "log.mat", {name: values[:, None] for name, values in columns.items()})
    mapping = LogMapping(
        file=folder / "log.mat",
        sampling_period_s=1e-3,
        inputs=(InputChannel("motor", "u", "N m"),),
        outputs=(OutputChannel("motor", "q"),),
        references=(ReferenceChannel("motor", "r"),),
        **settings,
    )
    return import_log(
        mapping,
        samples_per_period=PERIOD,
        periods=periods,
        excited_lines=LINES,
        configurations=np.zeros((1, 1)),
        played=PlayedExcitation(wave(1)[None, None, :, None], "speed_reference", 0, 0),
    )


@pytest.mark.parametrize("settings", [{}, {"drop_periods": 1}, {"take": "last"}])
@pytest.mark.parametrize(("after", "whole"), [(900, 4), (1499, 3), (2600, 2), (3100, 3), (4300, 4)])
def test_references_find_the_longest_part_without_a_loss(tmp_path, after, whole, settings):
    lossy, wanted = without(wave(5), after), 5 - settings.get("drop_periods", 0)
    with pytest.raises(DataError, match=r"lost samples|missing after about sample") as caught:
        import_references(tmp_path, lossy, wanted, **settings)
    told = dict(re.findall(r"(drop_periods|periods|take) to (\w+)", caught.value.remedy))
    kept = int(told.pop("periods"))
    assert kept == whole - settings.get("drop_periods", 0)
    changed = {name: int(value) if value.isdigit() else value for name, value in told.items()}
    record = import_references(tmp_path, lossy, kept, **{**settings, **changed})
    blocks = record.inputs[0, 0, 0, :, :, 0]
    np.testing.assert_allclose(blocks, np.broadcast_to(wave(1), blocks.shape), atol=1e-9)


def test_references_of_two_periods_do_not_ask_for_another_period(tmp_path):
    with pytest.raises(DataError) as caught:
        import_references(tmp_path, without(wave(2), 1001), 2)
    assert "period_s" not in caught.value.remedy
    assert import_references(tmp_path, without(wave(2), 1001), 1).inputs.shape[3] == 1


def followed(folder, signal, periods, **settings):
    with pytest.raises(DataError, match="missing after about sample") as caught:
        import_waves(folder, signal, periods, **settings)
    assert "different clocks" not in str(caught.value)
    told = dict(re.findall(r"(drop_periods|periods|take) to (\w+)", caught.value.remedy))
    kept = int(told.pop("periods"))
    changed = {name: int(value) if value.isdigit() else value for name, value in told.items()}
    return import_waves(folder, signal, kept, **{**settings, **changed}), kept


@pytest.mark.parametrize(
    ("after", "settings", "best"),
    [
        ((2281,), {"drop_periods": 1}, 2),
        ((3700,), {"drop_periods": 1}, 2),
        ((1300,), {"take": "last"}, 3),
        ((3700,), {"take": "last"}, 3),
        ((800, 4300), {}, 3),
    ],
)
def test_the_remedy_of_a_loss_holds(tmp_path, after, settings, best):
    periods = 4 if settings.get("take") else 3 if settings else 4
    record, kept = followed(tmp_path, without(wave(5), *after), periods, **settings)
    assert kept == best
    blocks = record.inputs[0, 0, 0, :, :, 0]
    np.testing.assert_allclose(blocks, np.broadcast_to(blocks[0], blocks.shape), atol=1e-9)


def test_a_loss_is_not_resampled_away(tmp_path):
    with pytest.raises(DataError, match="D093") as caught:
        import_waves(tmp_path, without(wave(5), 2281), 3, drop_periods=1, resample="period")
    assert "Do not resample" in caught.value.remedy


def test_a_loss_that_the_time_shows_is_told_once(tmp_path):
    time_s = 1e-3 * np.arange(5.0 * PERIOD)
    lossy = [without(values, 2281, count=3) for values in (wave(5), time_s)]
    with pytest.raises(DataError, match="1 gap, about 3 missing samples; the first after sample 2281") as caught:
        import_waves(tmp_path, lossy[0], 3, lossy[1], drop_periods=1, time=TimeChannel("t", "s"))
    assert "problems" not in str(caught.value)
