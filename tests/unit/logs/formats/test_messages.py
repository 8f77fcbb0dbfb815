"""Streams of messages: every number by its path, joints by their names, times from the log's beginning."""

import json

import numpy as np
import pytest

from log_files import make_columns, write_mcap, write_rosbag
from robid.errors import DataError
from robid.logs.formats.load import load_variables
from robid.logs.formats.variables import find_variable

COLUMNS = make_columns(40)
STATES = "/joint_states"


@pytest.fixture(params=[(write_mcap, "log.mcap"), (write_rosbag, "log.db3")], ids=["mcap", "rosbag"])
def log(tmp_path, request):
    writer, name = request.param
    return writer(tmp_path / name, COLUMNS)[0]


def test_joints_are_named_and_numbered_alike(log):
    variables = load_variables(log)
    for numbered, named in (("position[0]", "position[base]"), ("velocity[1]", "velocity[elbow]")):
        np.testing.assert_array_equal(variables[f"{STATES}.{numbered}"], variables[f"{STATES}.{named}"])
    np.testing.assert_array_equal(find_variable(variables, f"{STATES}.velocity[1]"), COLUMNS["told"])


def test_times_count_from_the_beginning_of_the_log(log):
    names = [f"{STATES}.log_time", f"{STATES}.header.stamp", f"{STATES}.header.stamp[elbow]"]
    variables = load_variables(log, None, names)
    assert set(variables) == set(names)
    for name in names:
        np.testing.assert_allclose(variables[name], np.arange(40) * 1e-3, rtol=0, atol=1e-12)
        assert variables.units[name] == "s"


def test_topics_that_cannot_be_unpacked_say_why(log):
    variables = load_variables(log, None, [f"{STATES}.position[0]"])
    name, why = ("/secret.x", "packed as protobuf") if log.suffix == ".mcap" else ("/own.x", "does not define its type")
    with pytest.raises(DataError, match=why) as caught:
        find_variable(variables, name)
    assert "ros2 bag convert" in caught.value.remedy
    assert f"{STATES}.position[0]" in variables


@pytest.mark.parametrize(("writer", "name"), [(write_mcap, "run_{}.mcap"), (write_rosbag, "run_{}.db3")])
def test_the_files_of_a_bag_follow_each_other(tmp_path, writer, name):
    for index in (10, 9):
        writer(tmp_path / name.format(index), {key: column + index for key, column in COLUMNS.items()})
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {}")
    found = load_variables(tmp_path, None, [f"{STATES}.position[base]"])[f"{STATES}.position[base]"]
    np.testing.assert_array_equal(found, np.concatenate([COLUMNS["q"] + 9, COLUMNS["q"] + 10]))


def write_json(path, messages):
    writer = pytest.importorskip("mcap.writer").Writer(str(path))
    writer.start()
    channel = writer.register_channel("/plc", "json", writer.register_schema("plc", "jsonschema", b"{}"))
    for index, message in enumerate(messages):
        writer.add_message(channel, 10**6 * index, json.dumps(message).encode(), 0)
    writer.finish()
    return path


def test_joints_that_take_turns_have_columns_and_times_of_their_own(tmp_path):
    arm = {"name": ["a", "b"], "effort": [1, 2], "drive": {"on": True, "mode": "x", "size": [[1, 2], [3, 4]]}}
    grip = {"name": ["grip"], "effort": [7]}
    pytest.importorskip("rosbags")
    variables = load_variables(write_json(tmp_path / "log.mcap", [arm, grip, arm, grip, arm]))
    np.testing.assert_array_equal(variables["/plc.effort[b]"], [2, 2, 2])
    np.testing.assert_array_equal(variables["/plc.effort[grip]"], [7, 7])
    np.testing.assert_allclose(variables["/plc.log_time[b]"], [0, 2e-3, 4e-3], atol=1e-15)
    np.testing.assert_allclose(variables["/plc.log_time[grip]"], [1e-3, 3e-3], atol=1e-15)
    np.testing.assert_array_equal(variables["/plc.effort[0]"], [1, 7, 1, 7, 1])
    np.testing.assert_array_equal(variables["/plc.drive.size[1][0]"], [3, 3, 3])
    np.testing.assert_array_equal(variables["/plc.drive.on"], [1, 1, 1])
    assert "/plc.drive.mode" not in variables


def test_a_recording_that_was_not_closed_names_the_repair(tmp_path):
    path, _ = write_mcap(tmp_path / "log.mcap", COLUMNS)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(DataError) as caught:
        load_variables(path)
    assert "mcap recover" in caught.value.remedy
