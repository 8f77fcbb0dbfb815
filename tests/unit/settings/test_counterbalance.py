"""Counterbalances in a robot file."""

from dataclasses import replace

import numpy as np
import pytest
from ruamel.yaml import YAML

from robid.errors import SettingsError
from robid.robot.balances import GasBalance, HarmonicBalance, SpringBalance
from robid.settings.load import load_robot
from robid.settings.robot_values import robot_text, with_values

SPRING = {"carrier_point_m": [0, 0.3, 0], "link_point_m": [0.4, 0, 0.1], "free_length_m": 0.2, "stiffness_n_m": 1e4}
DRIVE = {"inertia_kgm2": 1e-3, "gear_ratio": 100}
LINK = {"mass_kg": 10, "com_m": [0.1, 0.2, 0.3], "inertia_kgm2": {"xx": 1, "yy": 1.2, "zz": 0.9}}


def written(folder, balance, **joint):
    first = {"name": "one", "rigid": True, "limits_deg": [-90, 90], "link": LINK, "motor": DRIVE}
    place = {} if "frame" in joint else {"dh": {"d_m": 0.5, "a_m": 0.2, "alpha_deg": 90}}
    first = {**first, **place, "counterbalance": balance, **joint}
    first = {key: value for key, value in first.items() if value is not None}
    YAML().dump({"schema_version": 1, "name": "arm", "joints": [first]}, folder / "robot.yaml")
    return folder / "robot.yaml"


def test_a_spring_is_brought_to_the_joint_frame(tmp_path):
    balance = load_robot(written(tmp_path, {**SPRING, "preload_n": 50})).to_robot().joints[0].counterbalance
    assert isinstance(balance, SpringBalance)
    assert (balance.free_length_m, balance.stiffness_n_m, balance.preload_n) == (0.2, 1e4, 50)
    # The link's frame lies at the end of its DH transformation, turned by 90 deg about x.
    np.testing.assert_allclose(balance.carrier_point_m, [0.2, 0.0, 0.8], atol=1e-12)
    np.testing.assert_allclose(balance.link_point_m, [0.6, -0.1, 0.5], atol=1e-12)


def test_harmonics_are_filled_up_to_the_same_order(tmp_path):
    balance = (
        load_robot(written(tmp_path, {"sine_nm": [5, 0.5, 0.1], "cosine_nm": [2]})).to_robot().joints[0].counterbalance
    )
    assert isinstance(balance, HarmonicBalance)
    np.testing.assert_array_equal(balance.sine_nm, [5, 0.5, 0.1])
    np.testing.assert_array_equal(balance.cosine_nm, [2, 0, 0])


def test_most_robots_have_none(tmp_path):
    assert load_robot(written(tmp_path, None)).to_robot().joints[0].counterbalance is None


@pytest.mark.parametrize(
    ("balance", "joint", "told"),
    [
        ({**SPRING, "sine_nm": [1]}, {}, "S249"),
        ({"preload_n": 5}, {}, "is empty"),
        ({"stiffness_n_m": 5}, {}, "carrier_point_m: is missing"),
        (
            {"sine_nm": [1]},
            {"type": "prismatic", "limits_deg": None, "limits_m": [0, 1], "motor": {**DRIVE, "gear_ratio": None}},
            "S251",
        ),
    ],
)
def test_what_is_wrong_is_told(tmp_path, balance, joint, told):
    if "motor" in joint:
        joint = {**joint, "motor": {"inertia_kgm2": 1e-3, "gear_ratio_rad_m": 100}}
    with pytest.raises(SettingsError, match=told):
        load_robot(written(tmp_path, balance, **joint))


GAS = {key: value for key, value in SPRING.items() if key != "stiffness_n_m"} | {
    "area_m2": 2e-3, "rest_pressure_pa": 5e6, "rest_volume_m3": 4e-3, "exponent": 1.3
}  # fmt: skip


def test_a_gas_cylinder_is_brought_to_the_joint_frame_and_written_again(tmp_path):
    file = load_robot(written(tmp_path, GAS))
    robot = file.to_robot()
    balance = robot.joints[0].counterbalance
    assert isinstance(balance, GasBalance)
    assert (balance.area_m2, balance.rest_pressure_pa, balance.rest_volume_m3, balance.exponent) == (
        2e-3, 5e6, 4e-3, 1.3
    )  # fmt: skip
    np.testing.assert_allclose(balance.link_point_m, [0.6, -0.1, 0.5], atol=1e-12)
    found = replace(robot.joints[0], counterbalance=replace(balance, rest_pressure_pa=4e6))
    path = tmp_path / "found.yaml"
    path.write_text(robot_text(with_values(file, replace(robot, joints=(found,))), ""))
    again = load_robot(path).to_robot().joints[0].counterbalance
    assert again.rest_pressure_pa == 4e6
    assert (again.exponent, again.rest_volume_m3) == (1.3, 4e-3)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"exponent": None}, "exponent: is missing"),
        ({"stiffness_n_m": 1e4}, "S510"),
        ({"preload_n": 5}, "S510"),
        ({"area_m2": 0}, "S511"),
        ({"rest_volume_m3": 4e-4}, "S512"),
        ({"sine_nm": [1]}, "S249"),
    ],
)
def test_what_is_wrong_with_a_gas_cylinder_is_told(tmp_path, change, told):
    balance = {key: value for key, value in {**GAS, **change}.items() if value is not None}
    with pytest.raises(SettingsError, match=told):
        load_robot(written(tmp_path, balance))
