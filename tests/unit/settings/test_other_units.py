"""Numbers that look like radians or rpm: a warning that says what they would be, and none for what is meant."""

import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from robid.errors import SettingsError
from robid.settings.checks.configurations import other_units
from robid.settings.load import load_robot
from robid.studies.settings.study import load_with_study

CONFIGS = Path(__file__).parents[3] / "configs"
LOADED = load_with_study(CONFIGS / "kr300_motion.yaml")


def _looks(rows, key="list_deg"):
    campaign = next(iter(LOADED.experiment.campaigns.values()))
    chosen = type(campaign.configurations).model_validate({key: rows})
    changed = campaign.model_copy(update={"configurations": chosen})
    return other_units(LOADED.experiment.model_copy(update={"campaigns": {"c": changed}}), LOADED.robot)


@pytest.mark.parametrize(
    "row",
    [
        [0, -1.5708, 1.5708, 0, 0.7854, 0],
        [0, -1.571, 1.571, 0, 0.785, 0],
        [0, -math.pi / 2, math.pi / 3, 0, 0, 0],
        [0, -1.57, 1.57, 0, 0, 0],
        [0, -1.2217, 1.2217, 0, 0.5236, 0],
        [0.31, -1.24, 0.87, 0.22, 0.53, -2.9],
    ],
)
def test_radians_among_degrees_are_told_with_the_degrees_they_would_be(row):
    (text,) = _looks([row])
    assert "campaigns.c.configurations.list_deg" in text
    value, degrees = re.search(r"([-\d.]+) rad are ([-\d.]+) deg", text).groups()
    assert float(value) in [pytest.approx(one, abs=1e-5) for one in row]
    assert float(degrees) == pytest.approx(math.degrees(float(value)), abs=0.01)


@given(
    st.lists(st.lists(st.integers(-480, 480), min_size=6, max_size=6), min_size=1, max_size=4),
    st.sampled_from([1, 2, 4]),
)
def test_degrees_that_somebody_writes_are_not_accused(rows, parts):
    assert _looks([[value / parts for value in row] for row in rows]) == []


@pytest.mark.parametrize(
    "row", [[0] * 6, [1.5, 3, -2, 0.5, 0, 0], [0, 3.1, 0, 0, 0, 0], [5.7, -1.2, 0, 0, 0, 0], [1e-3] * 6]
)
def test_few_small_angles_are_not_accused(row):
    assert _looks([row]) == []


def test_drawn_degrees_are_not_accused():
    rows = np.random.default_rng(0).uniform(-60, 60, (20, 6)).round(3).tolist()
    assert _looks(rows) == []


def _robot(tmp_path, **changed):
    data = YAML(typ="safe").load((CONFIGS / "robots" / "motor_bench.yaml").read_text())
    for key, value in changed.items():
        (data["joints"][0]["motor"] if key == "max_speed_rad_s" else data["joints"][0])[key] = value
    YAML().dump(data, tmp_path / "robot.yaml")
    return other_units(LOADED.experiment.model_copy(update={"campaigns": {}}), load_robot(tmp_path / "robot.yaml"))


@pytest.mark.parametrize(
    ("speed", "told"),
    [(3000, r"3000 rpm would be 314\.2 rad/s"), (20000, r"20000 deg/s would be 349\.1 rad/s"), (628, None)],
)
def test_a_speed_that_looks_like_rpm_is_told(tmp_path, speed, told):
    texts = _robot(tmp_path, max_speed_rad_s=speed)
    assert len(texts) == (told is not None)
    assert not texts or re.search(told, texts[0])


@pytest.mark.parametrize(
    ("limits", "count"), [([-3.14159, 3.14159], 1), ([-2.9671, 2.9671], 1), ([-180, 180], 0), ([-5, 5], 0)]
)
def test_limits_that_look_like_radians_are_told(tmp_path, limits, count):
    assert len(_robot(tmp_path, limits_deg=limits)) == count


@pytest.mark.parametrize("file", sorted(path.name for path in CONFIGS.glob("*.yaml")))
def test_examples_are_not_accused(file):
    try:
        loaded = load_with_study(CONFIGS / file)
    except SettingsError:
        pytest.skip("needs data that is not there")
    assert other_units(loaded.experiment, loaded.robot) == []
