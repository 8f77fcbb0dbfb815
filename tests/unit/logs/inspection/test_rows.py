"""Logs whose signals have clocks of their own, in rows or in topics: the proposal is that of one clock, and it runs."""

import json

import h5py
import numpy as np
import pytest

from answers import ask
from robid.logs.inspection.findings import inspect_log

STEP, PERIOD, PERIODS = 1e-3, 500, 8
LINES = np.arange(3, 80)
PHASES = np.random.default_rng(1).uniform(0, 2 * np.pi, len(LINES))


def torque_at(time_s):
    return np.cos(2 * np.pi * np.outer(time_s / 0.5, LINES) + PHASES).sum(axis=1)


def motion_at(time_s):
    """A rigid inertia's answer."""
    return -(np.cos(2 * np.pi * np.outer(time_s / 0.5, LINES) + PHASES) / (2 * np.pi * LINES / 0.5) ** 2).sum(axis=1)


def write_rows(file, lag_s, slower=1):
    """A table as PlotJuggler exports it, each row of one topic."""
    moments = STEP * np.arange(PERIOD * PERIODS)
    rows = [(one, f"{value:.9g},") for one, value in zip(moments, torque_at(moments), strict=True)]
    late = moments[::slower] + lag_s
    rows += [(one, f",{value:.9g}") for one, value in zip(late, motion_at(late), strict=True)]
    lines = [f"{1_700_000_000 + moment:.6f},{cells}" for moment, cells in sorted(rows)]
    file.write_text("\n".join(["__time,/drive/effort,/drive/position", *lines]) + "\n")


@pytest.mark.parametrize("lag_s", [0.31e-3, 0.1e-3, 0.77e-3])
def test_a_table_with_rows_of_several_topics_is_seen_at_one_clock(tmp_path, monkeypatch, lag_s):
    monkeypatch.chdir(tmp_path)
    write_rows(tmp_path / "log.csv", lag_s)
    found = inspect_log([tmp_path / "log.csv"])
    assert found.step_s == STEP
    assert not found.sampling.gaps
    assert found.shared.whole == PERIOD
    assert not any(one.quality.missing for one in found.signals)
    assert ask("inspect", "log.csv", "--propose", "p.yaml").code == 0
    answer = ask("run", "p.yaml", "--backend", "serial")
    assert answer.code == 0, answer.err


def test_values_that_are_missing_here_and_there_are_no_rows_of_others(tmp_path):
    moments = STEP * np.arange(PERIOD * PERIODS)
    table = np.stack([moments, torque_at(moments), motion_at(moments)], axis=1)
    table[[500, 900, 1301], 2] = np.nan
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="time [s],torque [Nm],angle [rad]", comments="")
    found = inspect_log([tmp_path / "log.csv"])
    assert found.n_sample == len(table)
    assert not found.contents.notes


def write_pairs(file):
    first = STEP * np.arange(PERIOD * PERIODS)
    late = first + 0.31e-3
    table = np.stack([first, torque_at(first), late, motion_at(late)], axis=1)
    names = "Time1 [s],torque [Nm],Time2 [s],angle [rad]"
    np.savetxt(file, table, delimiter=",", header=names, comments="", fmt="%.9g")


def write_groups(file):
    nptdms = pytest.importorskip("nptdms")
    first = STEP * np.arange(PERIOD * PERIODS)
    late = first + 0.31e-3
    told = [("drive", "torque", torque_at(first), 0.0), ("sensor", "angle", motion_at(late), 0.31e-3)]
    with nptdms.TdmsWriter(file) as writer:
        for group, name, values, begun in told:
            properties = {"wf_increment": STEP, "wf_start_offset": begun}
            writer.write_segment([nptdms.ChannelObject(group, name, values, properties)])


def write_topics(file):
    writer_module = pytest.importorskip("mcap.writer")
    first = STEP * np.arange(PERIOD * PERIODS)
    late = first + 0.31e-3
    told = [(moment, "control", {"effort": value}) for moment, value in zip(first, torque_at(first), strict=True)]
    told += [(moment, "state", {"position": value}) for moment, value in zip(late, motion_at(late), strict=True)]
    with file.open("wb") as stream:
        writer = writer_module.Writer(stream)
        writer.start(profile="", library="")
        schema = writer.register_schema("state", "jsonschema", b"{}")
        channels = {name: writer.register_channel(f"/{name}", "json", schema) for name in ("control", "state")}
        for moment, name, message in sorted(told, key=lambda one: one[0]):
            at = 1_700_000_000 * 10**9 + round(1e9 * moment)
            writer.add_message(channels[name], at, json.dumps(message).encode(), at)
        writer.finish()


@pytest.mark.parametrize(
    ("name", "write"), [("log.csv", write_pairs), ("log.tdms", write_groups), ("log.mcap", write_topics)]
)
def test_what_is_proposed_for_clocks_of_their_own_runs_to_the_right_phase(tmp_path, monkeypatch, name, write):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / name)
    assert ask("inspect", name, "--propose", "p.yaml").code == 0
    answer = ask("run", "p.yaml", "--backend", "serial")
    assert answer.code == 0, answer.err
    with h5py.File(tmp_path / "runs/p/log/frf.h5") as file:
        response = file["response"][0, :, 0, 0]
    # A rigid inertia's acceleration goes with its torque; joined row by row it would be off by 0.31 rad at 158 Hz.
    assert np.abs(np.angle(response)).max() < 0.01


@pytest.mark.parametrize(("later_s", "told"), [(31e-3, "+0.031 s"), (-4e-3, "-0.004 s"), (0.0, None), (5e8, None)])
def test_another_time_of_the_same_rows_that_is_later_is_told(tmp_path, monkeypatch, later_s, told):
    """Of times of several clocks, and of those that are alike, nothing needs to be said."""
    monkeypatch.chdir(tmp_path)
    moments = STEP * np.arange(PERIOD * PERIODS)
    rows = zip(moments, motion_at(moments), moments + later_s, torque_at(moments + later_s), strict=True)
    cells = "\n".join(",".join(f"{one:.9f}" for one in row) for row in rows)
    (tmp_path / "log.csv").write_text(f"stamp_position,position,stamp_torque,torque\n{cells}\n")
    answer = ask("inspect", "log.csv", "--propose", "log.yaml")
    assert answer.code == 0
    assert ("time: stamp_torque" in (tmp_path / "log.yaml").read_text()) == (told is not None)
    assert told is None or told in answer.out
