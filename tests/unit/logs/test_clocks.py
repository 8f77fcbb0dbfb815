"""Channels that were sampled by clocks of their own: brought to one, or refused, never joined row by row."""

import json
import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from scipy.io import savemat

from log_files import write_tdms, write_twincat
from robid.errors import DataError
from robid.logs.importing import import_log, import_shot
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel

STEP, PERIOD, PERIODS = 1e-3, 500, 6
LINES = np.arange(2, 200)
PHASES = np.random.default_rng(1).uniform(0, 2 * np.pi, (2, len(LINES)))


def waves(time_s):
    """A torque and a motion that repeat every 0.5 s, up to 398 Hz, at any moment."""
    angle = 2 * np.pi * np.outer(time_s / (PERIOD * STEP), LINES)
    return tuple(np.cos(angle + phase).sum(axis=1) for phase in PHASES)


def mapping_of(file, **changes):
    mapping = LogMapping(
        file=file,
        sampling_period_s=STEP,
        time=TimeChannel("t", "s"),
        inputs=(InputChannel("motor", "u", "N m"),),
        outputs=(OutputChannel("motor", "q"),),
    )
    return replace(mapping, **changes)


def import_waves(mapping, periods=PERIODS - 1, lines=LINES):
    return import_log(
        mapping, samples_per_period=PERIOD, periods=periods, excited_lines=lines, configurations=np.zeros((1, 1))
    )


def wrong_by(record, first_s=0.0):
    """Relative error of torque and motion against the waves from the first sample on."""
    torque, motion = waves(first_s + STEP * np.arange(record.inputs.shape[3] * PERIOD))
    pairs = ((record.inputs, torque), (record.outputs + record.output_offset, motion))
    return max(float(np.std(found.ravel() - wanted) / np.std(wanted)) for found, wanted in pairs)


def response(record):
    """Ratio of motion to torque at each line, whichever moment of its period the record begins at."""
    torque, motion = (np.fft.rfft(x.reshape(-1, PERIOD).mean(axis=0)) for x in (record.inputs, record.outputs))
    return motion / torque


def write_rows(file, clocks, names=("u", "q"), time="t", epoch=0.0):
    """Writes a table whose rows hold the values of one instant, of those channels that were sampled at it."""
    cells: dict[int, list[str]] = {}
    for index, (name, (times, values)) in enumerate(zip(names, clocks, strict=True)):
        del name
        for moment, value in zip(np.round(1e6 * times).astype(int).tolist(), values.tolist(), strict=True):
            cells.setdefault(moment, [""] * len(names))[index] = f"{value:.12g}"
    rows = [f"{epoch + 1e-6 * moment:.6f},{','.join(row)}" for moment, row in sorted(cells.items())]
    Path(file).write_text("\n".join([",".join([time, *names]), *rows]) + "\n")


def instants(lag_s=0.0, count=PERIODS * PERIOD, step_s=STEP):
    return lag_s + step_s * np.arange(count)


@pytest.mark.parametrize("epoch", [0.0, 1.7e9])
@pytest.mark.parametrize("lag_s", [0.31e-3, 0.72e-3, -0.4e-3])
def test_each_column_of_a_table_is_read_at_its_own_rows(tmp_path, lag_s, epoch):
    first, other = instants(1e-3), instants(1e-3 + lag_s)
    write_rows(tmp_path / "log.csv", [(first, waves(first)[0]), (other, waves(other)[1])], epoch=epoch)
    record = import_waves(mapping_of(tmp_path / "log.csv"))
    begin = first[0] if lag_s <= 0 else first[1]
    assert wrong_by(record, begin) < (1e-3 if epoch else 1e-5)
    assert any("clock of its own" in note for note in record.notes)


def test_a_column_of_half_the_rate_is_brought_to_the_faster_one(tmp_path):
    lines = np.arange(2, 100)
    first, slow = instants(), instants(0.3e-3, PERIODS * PERIOD // 2, 2 * STEP)
    torque = np.cos(2 * np.pi * np.outer(first / 0.5, lines)).sum(axis=1)
    motion = np.cos(2 * np.pi * np.outer(slow / 0.5, lines) + 0.4).sum(axis=1)
    write_rows(tmp_path / "log.csv", [(first, torque), (slow, motion)])
    record = import_waves(mapping_of(tmp_path / "log.csv"), lines=lines)
    # What repeats is known before its first sample, too.
    at = STEP * np.arange(record.outputs.shape[3] * PERIOD)
    wanted = np.cos(2 * np.pi * np.outer(at / 0.5, lines) + 0.4).sum(axis=1)
    found = (record.outputs + record.output_offset).ravel()
    assert np.std(found - wanted) < 1e-5 * np.std(wanted)
    with pytest.raises(DataError, match="it shows nothing above 250 Hz") as caught:
        import_waves(mapping_of(tmp_path / "log.csv"), lines=np.arange(2, 140))
    assert "Set excitation.high_hz to 248" in caught.value.remedy


def test_single_lost_samples_of_a_clock_of_its_own_cost_these_alone(tmp_path):
    first, other = instants(1e-3), instants(1.31e-3)
    kept = np.delete(np.arange(len(other)), [300, 1100, 1101, 2400])
    lines = np.arange(2, 60)
    torque, motion = (
        np.cos(2 * np.pi * np.outer(at / 0.5, lines) + 0.3 * lines**2).sum(axis=1) for at in (first, other)
    )
    write_rows(tmp_path / "log.csv", [(first, torque), (other[kept], motion[kept])])
    record = import_waves(mapping_of(tmp_path / "log.csv"), lines=lines)
    at = first[1] + STEP * np.arange(record.outputs.shape[3] * PERIOD)
    wanted = np.cos(2 * np.pi * np.outer(at / 0.5, lines) + 0.3 * lines**2).sum(axis=1)
    found = (record.outputs + record.output_offset).ravel()
    assert np.std(found - wanted) < 3e-3 * np.std(wanted)
    assert np.median(np.abs(found - wanted)) < 1e-5 * np.std(wanted)
    assert any("lacks 4 samples" in note for note in record.notes)


def test_a_held_command_of_a_slower_rate_stays_between_its_samples(tmp_path):
    slow = instants(0.0, PERIODS * PERIOD // 5, 5 * STEP)
    command = np.random.default_rng(4).normal(size=len(slow))
    motion = waves(instants(0.0))[1]
    write_rows(tmp_path / "log.csv", [(slow, command), (instants(), motion)])
    record = import_shot(mapping_of(tmp_path / "log.csv", one_shot=True))
    np.testing.assert_allclose(record.inputs.ravel(), np.repeat(command, 5)[: record.inputs.shape[4]], rtol=1e-6)


def test_times_of_single_channels_are_stated_beside_their_variables(tmp_path):
    first, other = 1e3 * instants(), 1e3 * instants(0.25e-3)
    torque, motion = waves(1e-3 * first)[0], waves(1e-3 * other)[1]
    table = np.stack([first, torque, other, motion], axis=1)
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="Time1,A,Time2,B", comments="", fmt="%.10g")
    mapping = mapping_of(
        tmp_path / "log.csv",
        time=TimeChannel("Time1", "ms"),
        inputs=(InputChannel("motor", "A", "N m"),),
        outputs=(OutputChannel("motor", "B", time="Time2"),),
    )
    assert wrong_by(import_waves(mapping), STEP) < 1e-6


def test_channels_of_several_lengths_have_their_own_times(tmp_path):
    first, other = instants(), instants(0.25e-3, PERIODS * PERIOD + 40)
    told = {"t": first, "u": waves(first)[0], "t2": other, "q": waves(other)[1]}
    savemat(tmp_path / "log.mat", {name: values[:, None] for name, values in told.items()})
    mapping = mapping_of(tmp_path / "log.mat")
    with pytest.raises(DataError, match="samples") as caught:
        import_waves(mapping)
    assert "`time` of each channel" in caught.value.remedy
    stated = replace(mapping, outputs=(OutputChannel("motor", "q", time="t2"),))
    assert wrong_by(import_waves(stated), STEP) < 1e-6


def test_files_of_one_recording_are_joined_by_their_stamps(tmp_path):
    first, other = instants(5.0), instants(5.00025)
    for name, moments, key in (("a.csv", first, "u"), ("b.csv", other, "q")):
        table = np.stack([moments, waves(moments)[key == "q"]], axis=1)
        np.savetxt(tmp_path / name, table, delimiter=",", header=f"t,{key}", comments="", fmt="%.12g")
    outputs = (OutputChannel("motor", "q", file="b.csv"),)
    mapping = mapping_of(tmp_path / "a.csv", outputs=outputs, files={"b.csv": tmp_path / "b.csv"})
    assert wrong_by(import_waves(mapping), 5.001) < 1e-6


def test_columns_without_names_are_no_time_for_standing_where_it_stands_in_another_file(tmp_path):
    moments = instants()
    torque, motion = waves(moments)
    other = np.random.default_rng(5).normal(size=len(moments))
    np.savetxt(tmp_path / "a.csv", np.stack([torque, moments], axis=1), delimiter=",", fmt="%.12g")
    for columns, place in (([other, motion], "2"), ([motion, other], "1")):
        np.savetxt(tmp_path / "b.csv", np.stack(columns, axis=1), delimiter=",", fmt="%.12g")
        mapping = mapping_of(
            tmp_path / "a.csv",
            time=TimeChannel("2", "s"),
            inputs=(InputChannel("motor", "1", "N m"),),
            outputs=(OutputChannel("motor", place, file="b.csv"),),
            files={"b.csv": tmp_path / "b.csv"},
        )
        assert wrong_by(import_waves(mapping)) < 1e-6


@pytest.mark.parametrize("began", [0.0, 0.003, 12.5])
@pytest.mark.parametrize("held", [1700, 3000])
def test_a_file_that_ends_early_keeps_its_place_in_the_time_of_the_log(tmp_path, began, held):
    moments = instants()
    torque, motion = waves(moments)
    write_twincat(tmp_path / "a.csv", {"t": began + moments, "u": torque})
    write_twincat(tmp_path / "b.csv", {"other": torque[:held], "q": motion[:held]})
    outputs = (OutputChannel("motor", "q", file="b.csv"),)
    mapping = mapping_of(tmp_path / "a.csv", outputs=outputs, files={"b.csv": tmp_path / "b.csv"})
    assert wrong_by(import_waves(mapping, periods=3)) < 1e-6
    if held < len(moments):
        with pytest.raises(DataError, match="fewer than the 4") as caught:
            import_waves(mapping, periods=4)
        assert "b.csv" in str(caught.value)


def test_rows_of_several_channels_need_a_time(tmp_path):
    first, other = instants(), instants(0.31e-3)
    write_rows(tmp_path / "log.csv", [(first, waves(first)[0]), (other, waves(other)[1])])
    with pytest.raises(DataError, match="D031") as caught:
        import_waves(mapping_of(tmp_path / "log.csv", time=None))
    assert "State `time`" in str(caught.value)


def test_stamps_too_coarse_to_tell_the_lag_are_refused(tmp_path):
    first, other = instants(), instants(0.31e-3)
    told = {"t": np.floor(first * 10) / 10, "u": waves(first)[0], "t2": np.floor(other * 10) / 10, "q": waves(other)[1]}
    told["t2"] = np.roll(told["t2"], 3)
    told["t2"][:3] = 0.0
    savemat(tmp_path / "log.mat", {name: values[:, None] for name, values in told.items()})
    outputs = (OutputChannel("motor", "q", time="t2"),)
    with pytest.raises(DataError, match=r"rounded to 0\.1 s"):
        import_waves(mapping_of(tmp_path / "log.mat", outputs=outputs))


def test_channels_that_were_sampled_one_after_the_other_are_told_apart(tmp_path):
    told = {"t": instants(), "u": waves(instants())[0], "t2": instants(60.0), "q": waves(instants())[1]}
    savemat(tmp_path / "log.mat", {name: values[:, None] for name, values in told.items()})
    outputs = (OutputChannel("motor", "q", time="t2"),)
    with pytest.raises(DataError, match="D036"):
        import_waves(mapping_of(tmp_path / "log.mat", outputs=outputs))


def test_a_gap_of_one_channel_is_a_gap_of_all(tmp_path):
    first, other = instants(), np.delete(instants(0.31e-3), np.arange(1300, 1320))
    write_rows(tmp_path / "log.csv", [(first, waves(first)[0]), (other, waves(other)[1])])
    with pytest.raises(DataError, match="gap") as caught:
        import_waves(mapping_of(tmp_path / "log.csv"))
    found = re.search(r"Set drop_periods to (\d+) and periods to (\d+)", str(caught.value))
    mapping = mapping_of(tmp_path / "log.csv", drop_periods=int(found[1]))
    record = import_waves(mapping, int(found[2]))
    ratio = response(record)
    np.testing.assert_allclose(ratio[LINES], np.exp(1j * (PHASES[1] - PHASES[0])), atol=1e-3)


def test_a_value_that_is_missing_here_and_there_is_no_clock(tmp_path):
    first = instants()
    torque, motion = waves(first)
    motion[[700, 1400, 2222]] = np.nan
    table = np.stack([first, torque, motion], axis=1)
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t,u,q", comments="", fmt="%.10g")
    with pytest.raises(DataError, match="3 of 3000 values are NaN"):
        import_waves(mapping_of(tmp_path / "log.csv"))


def write_topics(path, clocks):
    """An MCAP file of topics in JSON, each message at its own time."""
    writer_module = pytest.importorskip("mcap.writer")
    messages = [
        (round(1e9 * moment) + 1_700_000_000 * 10**9, name, value)
        for name, (times, values) in clocks.items()
        for moment, value in zip(times.tolist(), values.tolist(), strict=True)
    ]
    with path.open("wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start(profile="", library="")
        schema = writer.register_schema("state", "jsonschema", b"{}")
        channels = {name: writer.register_channel(f"/{name}", "json", schema) for name in clocks}
        for moment, name, value in sorted(messages):
            writer.add_message(channels[name], moment, json.dumps({"value": value}).encode(), moment)
        writer.finish()


def test_topics_are_brought_to_one_clock_and_need_a_time(tmp_path):
    pytest.importorskip("rosbags")
    first, other = instants(), instants(0.31e-3)
    write_topics(tmp_path / "log.mcap", {"effort": (first, waves(first)[0]), "state": (other, waves(other)[1])})
    mapping = mapping_of(
        tmp_path / "log.mcap",
        time=None,
        inputs=(InputChannel("motor", "/effort.value", "N m"),),
        outputs=(OutputChannel("motor", "/state.value"),),
    )
    with pytest.raises(DataError, match="clocks of their own") as caught:
        import_waves(mapping)
    time = re.search(r'variable: "([^"]+)"', caught.value.remedy)[1]
    assert wrong_by(import_waves(replace(mapping, time=TimeChannel(time, "s"))), STEP) < 1e-5


@pytest.mark.parametrize("step_s", [STEP, STEP / 2])
def test_groups_of_a_tdms_file_are_brought_to_one_clock_by_their_starts(tmp_path, step_s):
    nptdms = pytest.importorskip("nptdms")
    first, other = instants(), instants(0.25e-3, round(PERIODS * PERIOD * STEP / step_s), step_s)
    told = [("drive", "u", waves(first)[0], 0.0, STEP), ("sensor", "q", waves(other)[1], 0.25e-3, step_s)]
    with nptdms.TdmsWriter(tmp_path / "log.tdms") as writer:
        for group, name, values, offset, step in told:
            properties = {"wf_increment": step, "wf_start_offset": offset}
            writer.write_segment([nptdms.ChannelObject(group, name, values, properties)])
    mapping = mapping_of(
        tmp_path / "log.tdms",
        sampling_period_s=step_s,
        time=None,
        inputs=(InputChannel("motor", "drive/u", "N m", hold="band_limited"),),
        outputs=(OutputChannel("motor", "sensor/q"),),
    )
    with pytest.raises(DataError, match="clocks of their own") as caught:
        import_waves(mapping)
    time = re.search(r'variable: "([^"]+)"', caught.value.remedy)[1]
    record = import_log(
        replace(mapping, time=TimeChannel(time, "s")),
        samples_per_period=round(PERIOD * STEP / step_s),
        periods=PERIODS - 1,
        excited_lines=LINES,
        configurations=np.zeros((1, 1)),
    )
    torque, motion = waves(step_s + step_s * np.arange(record.outputs.shape[3] * record.outputs.shape[4]))
    found = (record.outputs + record.output_offset).ravel()
    assert np.std(found - motion) < 1e-5 * np.std(motion)
    assert np.std(record.inputs.ravel() - torque) < 1e-5 * np.std(torque)


def test_groups_of_an_mdf_file_are_brought_to_one_clock(tmp_path):
    asammdf = pytest.importorskip("asammdf")
    first, other = instants(), instants(0.25e-3)
    with asammdf.MDF(version="4.10") as file:
        for name, times, values in (("u", first, waves(first)[0]), ("q", other, waves(other)[1])):
            file.append([asammdf.Signal(samples=values, timestamps=times, name=name, unit="V")])
        file.save(tmp_path / "log.mf4")
    mapping = mapping_of(tmp_path / "log.mf4", time=None)
    with pytest.raises(DataError, match="clocks of their own") as caught:
        import_waves(mapping)
    time = re.search(r'variable: "([^"]+)"', caught.value.remedy)[1]
    assert wrong_by(import_waves(replace(mapping, time=TimeChannel(time, "s"))), STEP) < 1e-5


@pytest.mark.parametrize("unit", ["s", "ms"])
def test_a_time_that_is_a_channel_belongs_to_the_channels_beside_it(tmp_path, unit):
    time_s = np.arange(PERIOD * PERIODS) * STEP
    torque, motion = waves(time_s)
    # Each channel of this file has times of its own, in seconds from the first sample.
    columns = {"t": (12.5 + time_s) * {"s": 1.0, "ms": 1e3}[unit], "u": torque, "q": motion}
    path, names = write_tdms(tmp_path / "log.tdms", columns)
    mapping = mapping_of(
        path,
        time=TimeChannel(names["t"], unit),
        inputs=(InputChannel("motor", names["u"], "N m"),),
        outputs=(OutputChannel("motor", names["q"]),),
    )
    assert wrong_by(import_waves(mapping)) < 1e-9
    one = replace(mapping, time=TimeChannel(f"{names['u']}.time", "s"))
    assert wrong_by(import_waves(one)) < 1e-9


def test_rasters_of_one_recording_come_to_one_clock(tmp_path):
    fast = np.arange(PERIOD * PERIODS) * STEP
    slow = fast[::2]
    kinds = [("Name", object), ("Data", object), ("XIndex", object)]
    recorded = [("u", waves(fast)[0][None], 1.0), ("q", waves(slow)[1][None], 2.0)]
    rasters = np.array([(fast[None],), (slow[None],)], [("Data", object)])
    savemat(tmp_path / "log.mat", {"rec": {"X": rasters, "Y": np.array(recorded, kinds)}})
    # Of the slow raster, lines from 125 on fold down upon those from 51 on.
    lines = LINES[LINES < 50]
    mapping = mapping_of(
        tmp_path / "log.mat",
        time=TimeChannel("rec.X(1).Data", "s"),
        inputs=(InputChannel("motor", "rec.Y(1).Data", "N m"),),
        outputs=(OutputChannel("motor", "rec.Y(2).Data"),),
    )
    found = response(import_waves(mapping, lines=lines))[lines]
    wanted = np.exp(1j * (PHASES[1] - PHASES[0]))[: len(lines)]
    np.testing.assert_allclose(found, wanted, atol=2e-3)


def test_two_columns_of_dates_count_from_one_moment(tmp_path):
    first, other = instants(), instants(5.31e-3)
    begun = datetime(2024, 9, 24, 14, 5, 15, tzinfo=UTC)

    def dates(moments):
        return [(begun + timedelta(seconds=one)).strftime("%Y-%m-%d %H:%M:%S.%f") for one in moments.tolist()]

    cells = zip(dates(first), waves(first)[0], dates(other), waves(other)[1], strict=True)
    rows = [f"{one},{torque:.9g},{late},{motion:.9g}" for one, torque, late, motion in cells]
    (tmp_path / "log.csv").write_text("\n".join(["Time1,A,Time2,B", *rows]) + "\n")
    mapping = mapping_of(
        tmp_path / "log.csv",
        time=TimeChannel("Time1", "s"),
        inputs=(InputChannel("motor", "A", "N m"),),
        outputs=(OutputChannel("motor", "B", time="Time2"),),
    )
    assert wrong_by(import_waves(mapping), 6 * STEP) < 1e-6


@pytest.mark.parametrize("ticks", [False, True])
def test_groups_of_a_twincat_scope_are_brought_to_one_clock(tmp_path, ticks):
    first, other = instants(), instants(5.31e-3)

    def told(moment):
        return f"{133_700_000_000_000_000 + round(1e7 * moment)}" if ticks else f"{1e3 * moment:.4f}"

    cells = zip(first.tolist(), waves(first)[0], other.tolist(), waves(other)[1], strict=True)
    rows = [
        f"{told(one)};{torque:.9g};{told(late)};{motion:.9g}".replace(".", ",") for one, torque, late, motion in cells
    ]
    head = ["Name;Torque;Name;Angle", "SampleTime[ms];1;SampleTime[ms];1", "Data-Type;REAL64;Data-Type;REAL64"]
    (tmp_path / "log.csv").write_text("\n".join([*head, *rows, "EOF"]) + "\n")
    mapping = mapping_of(
        tmp_path / "log.csv",
        time=TimeChannel("Torque.time", "ms"),
        inputs=(InputChannel("motor", "Torque", "N m"),),
        outputs=(OutputChannel("motor", "Angle"),),
    )
    assert wrong_by(import_waves(mapping), 6 * STEP) < (1e-2 if ticks else 1e-6)


def test_columns_behind_a_second_time_have_that_one(tmp_path):
    first, other = instants(), instants(0.31e-3)
    table = np.stack([first, waves(first)[0], other, waves(other)[1]], axis=1)
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="Time1,A,Time2,B", comments="", fmt="%.12g")
    mapping = mapping_of(
        tmp_path / "log.csv",
        time=TimeChannel("Time1", "s"),
        inputs=(InputChannel("motor", "A", "N m"),),
        outputs=(OutputChannel("motor", "B"),),
    )
    assert wrong_by(import_waves(mapping), STEP) < 1e-6
    with pytest.raises(DataError, match="clocks of their own") as caught:
        import_waves(replace(mapping, time=None))
    assert '"Time1"' in caught.value.remedy


def test_torques_called_t_are_no_times_of_groups(tmp_path):
    first = instants()
    table = np.stack([first, waves(first)[0], np.sort(waves(first)[0]), waves(first)[1]], axis=1)
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="t,t1,t2,q", comments="", fmt="%.12g")
    mapping = mapping_of(tmp_path / "log.csv", inputs=(InputChannel("motor", "t1", "N m"),))
    assert wrong_by(import_waves(mapping)) < 1e-9
