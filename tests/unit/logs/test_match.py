"""Logs matched to the excitation that was played: what is found, and every way it can be another one."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.io import savemat

from robid.errors import DataError
from robid.logs.importing import import_log, join_experiments
from robid.logs.mapping import LogMapping
from robid.logs.placing import PlayedExcitation, correlation, find_periods
from robid.signals.log_channels import InputChannel, OutputChannel, ReferenceChannel
from robid.signals.waveforms import multisine, time_signal

N_SAMPLE, LINES, NAMES = 500, np.arange(5, 61, 2), ("turn", "lift")


def designed(seed=1, lines=LINES, n_real=2):
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, (n_real, 2, len(lines)))
    return time_signal(multisine(np.ones((2, len(lines))), phase), lines, N_SAMPLE)


def log_of(period, *, before=173, lead=40, periods=4, after=77, noise=0.0, seed=2):
    """Columns of a log: silence, a part of a period, whole periods, the beginning of another one, silence."""
    generator = np.random.default_rng(seed)
    rest = np.zeros((before, 2))
    block = np.concatenate([rest, period[-lead:], np.tile(period, (periods, 1)), period[:after], rest])
    block = block + noise * block.std() * generator.standard_normal(block.shape)
    torque, angle = (generator.standard_normal(block.shape) * 0.01 + np.roll(block, n, axis=0) for n in (3, 9))
    return {"r": block, "u": torque, "q": angle}


def mapping_of(**changes):
    mapping = LogMapping(
        file=None,
        sampling_period_s=1e-3,
        drop_periods=1,
        time=None,
        inputs=tuple(InputChannel(name, f"u(:,{i})") for i, name in enumerate(NAMES, start=1)),
        outputs=tuple(OutputChannel(name, f"q(:,{i})") for i, name in enumerate(NAMES, start=1)),
        references=tuple(ReferenceChannel(name, f"r(:,{i})") for i, name in enumerate(NAMES, start=1)),
    )
    return replace(mapping, **changes)


def bring(folder, log, *, reference=None, at=(1, 0), periods=2, lines=LINES, **changes):
    savemat(folder / "log.mat", log)
    return import_log(
        mapping_of(file=folder / "log.mat", **changes),
        samples_per_period=N_SAMPLE,
        periods=periods,
        excited_lines=lines,
        configurations=np.zeros((1, 2)),
        played=PlayedExcitation(designed() if reference is None else reference, "speed_reference", *at),
    )


def refused(folder, log, **arguments):
    with pytest.raises(DataError) as caught:
        bring(folder, log, **arguments)
    assert "log.mat" in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize(("before", "lead", "after"), [(0, 0, 0), (173, 40, 77), (1, 490, 490), (900, 0, 3)])
@pytest.mark.parametrize("noise", [0.0, 0.1])
@pytest.mark.parametrize("take", ["first", "last"])
def test_whole_periods_are_cut_where_the_excitation_begins(tmp_path, before, lead, after, noise, take):
    log = log_of(
        designed()[1, 0], before=before, lead=lead or N_SAMPLE, periods=4 if lead else 3, after=after, noise=noise
    )
    record = bring(tmp_path, log, take=take)
    begin = before + lead + (2 if take == "last" else 1) * N_SAMPLE
    wanted = log["u"][begin : begin + 2 * N_SAMPLE].reshape(2, N_SAMPLE, 2)
    np.testing.assert_array_equal(record.inputs[0, 0, 0], wanted)
    np.testing.assert_array_equal(record.reference[0, 0, 0], designed()[1, 0])
    assert [channel.quantity for channel in record.reference_channels] == 2 * ["speed_reference"]


def test_the_correlation_is_that_of_each_stretch():
    generator = np.random.default_rng(3)
    logged, period = generator.standard_normal((90, 2)), generator.standard_normal((20, 2))
    wanted = [[np.corrcoef(logged[k : k + 20, m], period[:, m])[0, 1] for m in range(2)] for k in range(71)]
    np.testing.assert_allclose(correlation(np.add(logged, [3.0, -50.0]), period), wanted, atol=1e-9)


@pytest.mark.parametrize("late", [1, 2, 3])
@pytest.mark.parametrize("rest", [0, 170])
def test_a_log_that_begins_a_little_late_does_not_move_the_periods_of_a_slow_excitation(late, rest):
    period = designed(lines=np.arange(1, 4))[0, 1]
    # With `late` samples of the next one, or of rest, another period seems to begin with the log.
    log = np.concatenate([np.tile(period, (5, 1))[late:], np.zeros((rest, 2)) if rest else period[:late]])
    match = find_periods(log, period)
    assert (match.start, match.count) == (N_SAMPLE - late, 4)


def test_an_offset_does_not_matter():
    period = designed()[0, 1]
    match = find_periods(log_of(period)["r"] + [40.0, -7.0], period)
    assert (match.start, match.count) == (173 + 40, 4)
    np.testing.assert_allclose(match.gain, 1.0)


@pytest.mark.parametrize("played", [(0, 0), (0, 1), (1, 1)])
def test_another_experiment_is_named(tmp_path, played):
    message = refused(tmp_path, log_of(designed()[played]))
    assert f"contains realization {played[0] + 1}, experiment {played[1] + 1} of the excitation, not" in message
    assert "not realization 2, experiment 1" in message


def test_another_excitation_is_refused(tmp_path):
    message = refused(tmp_path, log_of(designed(seed=8)[1, 0]))
    assert "D239" in message
    other = np.arange(6, 60, 3)
    assert "D239" in refused(tmp_path, log_of(designed(lines=other)[1, 0]))


def test_a_reversed_motor_of_three_is_named(tmp_path):
    reference = time_signal(
        multisine(np.ones((3, len(LINES))), np.random.default_rng(5).uniform(0, 6, (1, 3, len(LINES)))), LINES, N_SAMPLE
    )
    names = (*NAMES, "tilt")
    period = reference[0, 1]
    log = {key: np.tile(period, (4, 1)) for key in "ruq"}
    log["r"] = log["r"] * [1, 1, -1]

    def channels(kind, key):
        return tuple(kind(name, f"{key}(:,{i})") for i, name in enumerate(names, start=1))

    changes = {
        "inputs": channels(InputChannel, "u"),
        "outputs": channels(OutputChannel, "q"),
        "references": channels(ReferenceChannel, "r"),
    }
    message = refused(tmp_path, log, reference=reference, at=(0, 1), **changes)
    assert "references of tilt count the other way" in message
    assert "`sign: -1`" in message


def test_a_reversed_motor_of_two_looks_like_the_other_experiment_and_both_are_said(tmp_path):
    log = log_of(designed()[1, 0])
    log["r"] = log["r"] * [1, -1]
    message = refused(tmp_path, log)
    assert "contains realization 2, experiment 2" in message
    assert "correct the sign of" in message


def test_an_exchanged_channel_is_named(tmp_path):
    log = log_of(designed()[1, 0])
    log["r"][:, 1] = np.random.default_rng(0).standard_normal(len(log["r"]))
    assert "references of lift are not those of the excitation" in refused(tmp_path, log)


@pytest.mark.parametrize(("factor", "words"), [(180 / np.pi, "as deg for rad"), (0.5, "0.5 times (RMS")])
def test_another_size_is_measured(tmp_path, factor, words):
    log = log_of(designed()[1, 0])
    log["r"] = log["r"] * [1, factor]
    message = refused(tmp_path, log)
    assert "lift" in message
    assert words in message
    assert "turn" not in message


def test_another_size_is_measured_where_periods_lack_too(tmp_path):
    log = log_of(designed()[1, 0], periods=2, lead=490, after=490)
    log["r"] = log["r"] * [1, 180 / np.pi]
    message = refused(tmp_path, log)
    assert "2 whole periods, fewer than the 3" in message
    assert "or set periods to 1." in message
    assert "lift 57.3 times, as deg for rad" in message


def test_a_log_with_no_more_periods_than_are_dropped_is_recorded_longer(tmp_path):
    message = refused(tmp_path, log_of(designed()[1, 0], periods=1, lead=490, after=490))
    assert "1 whole period, fewer than the 3" in message
    assert "or record longer." in message


def test_a_size_that_is_nearly_right_is_noted(tmp_path):
    log = log_of(designed()[1, 0])
    log["r"] *= 1.04
    assert any("lift has 1.04 times the designed size" in note for note in bring(tmp_path, log).notes)


def test_lost_samples_are_located(tmp_path):
    log = log_of(designed()[1, 0], before=0, lead=N_SAMPLE)
    log = {key: np.delete(values, slice(1600, 1630), axis=0) for key, values in log.items()}
    message = refused(tmp_path, log, periods=3)
    assert "from sample 0 to 1500, 3 whole periods, fewer than the 4" in message or "repeats" in message
    assert bring(tmp_path, log, periods=2).inputs.shape[3] == 2


def test_a_clock_that_is_off_by_a_sample_per_period_is_measured(tmp_path):
    period = designed()[1, 0]
    grid = np.arange(4 * (N_SAMPLE + 1)) * N_SAMPLE / (N_SAMPLE + 1)
    spectrum = np.fft.rfft(period, axis=0)[LINES] * 2 / N_SAMPLE
    stretched = np.real(np.exp(2j * np.pi * np.outer(grid, LINES) / N_SAMPLE) @ spectrum)
    message = refused(tmp_path, dict.fromkeys("ruq", stretched))
    assert "repeats every 501 samples" in message


def test_a_short_log_is_counted(tmp_path):
    message = refused(tmp_path, log_of(designed()[1, 0], periods=1, before=0))
    assert "fewer than the 3 that were said" in message


def test_problems_of_the_columns_come_first(tmp_path):
    log = log_of(designed()[1, 0])
    log["r"][100, 0] = np.nan
    message = refused(tmp_path, log)
    assert "variable `r(:,1)`, sample 100" in message
    assert "2 problems" not in message


def test_experiments_are_joined_realization_by_realization(tmp_path):
    reference = designed()
    parts = [bring(tmp_path, log_of(reference[at]), at=at) for at in np.ndindex(2, 2)]
    joined = join_experiments(parts, 2)
    assert joined.inputs.shape == (1, 2, 2, 2, N_SAMPLE, 2)
    np.testing.assert_array_equal(joined.reference[0], reference)
    absolute = [(part.outputs + part.output_offset)[0, 0, 0] for part in parts]
    np.testing.assert_allclose((joined.outputs + joined.output_offset)[0, 1, 0], absolute[2], atol=1e-12)
