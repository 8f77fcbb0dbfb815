"""Channels whose values stand in several rows of a log: read at their own rate, and nothing else is taken for one."""

from dataclasses import replace

import h5py
import numpy as np
import pytest

from answers import ask
from robid.logs.importing import import_log
from robid.logs.mapping import LogMapping
from robid.logs.repeats import rows_of_value
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel

STEP, PERIOD, PERIODS = 1e-3, 500, 6
TIME = STEP * np.arange(PERIOD * PERIODS)
LINES = np.arange(2, 40)
PHASES = np.random.default_rng(1).uniform(0, 2 * np.pi, len(LINES))


def waves(time_s):
    """A torque and a rigid inertia's motion, up to 78 Hz."""
    angle = 2 * np.pi * np.outer(time_s / (PERIOD * STEP), LINES) + PHASES
    return np.cos(angle).sum(axis=1), -(np.cos(angle) / (2 * np.pi * LINES / 0.5) ** 2).sum(axis=1)


def held(values, rows, first=0):
    return values[np.maximum((np.arange(len(values)) - first) // rows * rows + first, 0)]


def write(path, slow, rows, first=0):
    columns = dict(zip(("torque", "position"), waves(TIME), strict=True))
    columns[slow] = held(columns[slow], rows, first)
    table = np.stack([TIME, columns["torque"], columns["position"]], axis=1)
    names = "time [s],torque [Nm],position [rad]"
    np.savetxt(path, table, delimiter=",", header=names, comments="", fmt="%.12g")


def mapping_of(file, **changes):
    mapping = LogMapping(
        file=file,
        sampling_period_s=STEP,
        time=TimeChannel("time [s]", "s"),
        inputs=(InputChannel("motor", "torque [Nm]", "N m", hold="band_limited"),),
        outputs=(OutputChannel("motor", "position [rad]"),),
    )
    return replace(mapping, **changes)


def imported(mapping):
    return import_log(
        mapping, samples_per_period=PERIOD, periods=PERIODS, excited_lines=LINES, configurations=np.zeros((1, 1))
    )


@pytest.mark.parametrize("slow", ["torque", "position"])
@pytest.mark.parametrize(("rows", "first"), [(2, 0), (4, 3), (5, 1)])
def test_a_channel_that_was_sampled_more_slowly_comes_out_on_time(tmp_path, slow, rows, first):
    write(tmp_path / "log.csv", slow, rows, first)
    record = imported(mapping_of(tmp_path / "log.csv"))
    torque, motion = waves(TIME)
    for found, wanted in ((record.inputs, torque), (record.outputs + record.output_offset, motion)):
        assert np.std(found.ravel() - wanted) < 0.01 * np.std(wanted)
    assert any(f"stands in {rows} rows" in note for note in record.notes)


def test_without_a_time_it_is_said_by_how_much_it_is_late(tmp_path):
    write(tmp_path / "log.csv", "position", 5)
    record = imported(mapping_of(tmp_path / "log.csv", time=None))
    assert any("late by 2 rows" in note for note in record.notes)


def test_a_command_that_is_constant_over_rows_is_what_the_robot_got(tmp_path):
    write(tmp_path / "log.csv", "torque", 5)
    command = InputChannel("motor", "torque [Nm]", "N m", hold="zoh")
    record = imported(mapping_of(tmp_path / "log.csv", inputs=(command,)))
    np.testing.assert_allclose(record.inputs.ravel(), held(waves(TIME)[0], 5), rtol=1e-6, atol=1e-4)


def test_a_motion_that_is_as_slow_as_its_command_comes_out_on_time(tmp_path):
    torque, motion = waves(TIME)
    table = np.stack([TIME, held(torque, 5), held(motion, 5)], axis=1)
    names = "time [s],torque [Nm],position [rad]"
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=names, comments="", fmt="%.12g")
    command = InputChannel("motor", "torque [Nm]", "N m", hold="zoh")
    record = imported(mapping_of(tmp_path / "log.csv", inputs=(command,)))
    np.testing.assert_allclose(record.inputs.ravel(), held(torque, 5), rtol=1e-6, atol=1e-4)
    assert np.std((record.outputs + record.output_offset).ravel() - motion) < 0.01 * np.std(motion)


@pytest.mark.parametrize("slow", ["torque", "position"])
def test_what_is_proposed_gives_the_response_in_its_phase(tmp_path, monkeypatch, slow):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "log.csv", slow, 5)
    assert ask("inspect", "log.csv", "--propose", "p.yaml").code == 0
    answer = ask("run", "p.yaml", "--backend", "serial")
    assert answer.code == 0, answer.err
    with h5py.File(tmp_path / "runs/p/log/frf.h5") as file:
        response = file["response"][0, :, 0, 0]
    assert len(response) == len(LINES)
    # Row by row it would be off by 2 ms, 1 rad at 78 Hz.
    assert np.abs(np.angle(response)).max() < 0.01


def test_all_channels_alike_are_left(tmp_path):
    torque, motion = (held(one, 2) for one in waves(TIME))
    table = np.stack([TIME, torque, motion], axis=1)
    names = "time [s],torque [Nm],position [rad]"
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header=names, comments="", fmt="%.12g")
    record = imported(mapping_of(tmp_path / "log.csv"))
    assert not any("rows" in note for note in record.notes)


@pytest.mark.parametrize(
    "values",
    [
        np.round(np.arange(4000) / 5),  # an encoder at constant speed
        np.round(300 * np.sin(TIME)),  # and at a changing one
        np.round(3 * waves(TIME)[0]),
        np.where(np.arange(3000) // 30 % 2, 1.0, -1.0),  # a command between two levels
        np.random.default_rng(2).normal(size=3000),
        np.repeat(np.random.default_rng(2).normal(size=20), 150),  # a few steps
        np.repeat(np.random.default_rng(2).normal(size=600), 5)[np.r_[:700, 701:3000]],  # a row was lost
        np.full(3000, 1.0),
    ],
    ids=["constant speed", "speed", "coarse", "levels", "noise", "steps", "lost", "still"],
)
def test_what_is_no_slower_channel(values):
    assert rows_of_value(values) == (1, 0)
