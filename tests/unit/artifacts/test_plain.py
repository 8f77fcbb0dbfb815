import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from robid.artifacts.atomic import json_text
from robid.artifacts.truth import from_plain, to_plain
from robid.robot.description import Robot
from robid.settings.load import load_robot

ROBOTS = sorted((Path(__file__).parents[3] / "configs" / "robots").glob("*.yaml"))


def same(one, other):
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other)
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, list | tuple):
        return type(one) is type(other) and len(one) == len(other) and all(map(same, one, other))
    return type(one) is type(other) and one == other


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_a_robot_comes_back_from_its_json(path):
    file = load_robot(path)
    if file.model is not None:
        pytest.skip("its bodies are in a file of the data folder")
    robot = file.to_robot()
    joint = robot.joints[0]
    unlimited = replace(joint, motor=replace(joint.motor, max_torque_nm=np.inf))
    robot = replace(robot, joints=(unlimited, *robot.joints[1:]))
    # In which frames its file states bodies is no part of a robot.
    assert "file_frames" not in to_plain(robot)
    robot = replace(robot, file_frames=None)
    again = from_plain(Robot, json.loads(json_text(to_plain(robot))))
    assert again.joints[0].motor.max_torque_nm == np.inf
    assert same(asdict(again), asdict(robot))


def test_a_missing_field_is_named():
    with pytest.raises(KeyError, match="gravity_m_s2"):
        from_plain(Robot, {"name": "arm"})
