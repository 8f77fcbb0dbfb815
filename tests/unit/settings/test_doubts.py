"""Nuisances in robot files: defaults, those of the robot, those of a joint, and what a stage reads of them."""

from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.models.elastic.settings import model_settings
from robid.models.known import load_experiment
from robid.robot.nuisance import NuisanceStd
from robid.settings.load import load_robot

CONFIGS = Path(__file__).parents[3] / "configs"
KR300 = (CONFIGS / "robots" / "kr300.yaml").read_text()


def loaded(tmp_path, joint="", robot=""):
    text = KR300.replace("joints:\n", f"{robot}\njoints:\n", 1).replace(
        "- name: axis_2\n", f"- name: axis_2\n{joint}\n"
    )
    (tmp_path / "robot.yaml").write_text(text)
    return load_robot(tmp_path / "robot.yaml").to_robot()


def test_a_file_without_nuisances_has_the_defaults_everywhere(tmp_path):
    robot = loaded(tmp_path)
    assert robot.nuisance_std == NuisanceStd()
    assert {joint.nuisance_std for joint in robot.joints} == {NuisanceStd()}


def test_a_joint_s_nuisances_go_before_the_robot_s_and_those_before_the_defaults(tmp_path):
    robot = loaded(tmp_path, "    doubts: {com_m: 0, compliance: 0.5}", "doubts: {com_m: 0.02, loss_factor: false}")
    assert (robot.nuisance_std.com_m, robot.nuisance_std.loss_factor) == (0.02, 0.0)
    assert (robot.joints[0].nuisance_std.com_m, robot.joints[1].nuisance_std.com_m) == (0.02, 0.0)
    assert (robot.joints[0].nuisance_std.compliance, robot.joints[1].nuisance_std.compliance) == (
        NuisanceStd().compliance,
        0.5,
    )
    assert robot.joints[1].nuisance_std.loss_factor == 0.0


@pytest.mark.parametrize(
    ("joint", "robot", "message"),
    [
        ("    doubts: {com_m: -0.1}", "", r"joints\[2\]\.doubts\.com_m: S383"),
        ("", "doubts: {mass_std: 0.1}", "doubts.mass_std: S380"),
        ("    doubts: {payload_com_m: 0.1}", "", r"joints\[2\]\.doubts\.payload_com_m: S380"),
    ],
)
def test_nuisances_that_make_no_sense_are_named(tmp_path, joint, robot, message):
    with pytest.raises(SettingsError, match=message):
        loaded(tmp_path, joint, robot)


def test_fits_read_nuisances(tmp_path):
    robots = tmp_path / "robots"
    robots.mkdir()
    (robots / "kr300.yaml").write_text(KR300.replace("joints:\n", "doubts: {compliance: 0.3}\njoints:\n", 1))
    (tmp_path / "kr300.yaml").write_text((CONFIGS / "kr300.yaml").read_text())
    found = model_settings(load_experiment(tmp_path / "kr300.yaml"), "estimation")["robot"]
    assert found["doubts"]["compliance"] == 0.3
    assert found["joints"][0]["doubts"]["compliance"] is None
