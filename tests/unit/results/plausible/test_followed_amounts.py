"""What mean torques tell to correct, added to the setting that it corrects, leaves nothing to tell."""

import copy
import re
from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf
from robid.results.plausible.findings import data_findings
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.settings.robot import RobotFile

PLACES = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.2], [-1.2, -0.5], [0.8, -0.4], [-0.1, 1.4]])
FRICTION = {"viscous_nms_rad": 1e-4, "coulomb_nm": 0.03, "static_nm": 0.03, "stribeck_rad_s": 1, "presliding_rad": 0.02}
MOTOR = {"inertia_kgm2": 8e-4, "gear_ratio": 120, "max_torque_nm": 20, "friction": FRICTION}
LINK = {"com_m": [-0.3, 0.05, 0.03], "inertia_kgm2": {"xx": 0.6, "yy": 0.9, "zz": 1.0}}
FILE = {
    "schema_version": 1,
    "name": "standing arm",
    "base_rpy_deg": [0.0, 0.0, 0.0],
    "joints": [
        {
            "name": "turn", "dh": {"d_m": 0.4, "a_m": 0.1, "alpha_deg": 90}, "limits_deg": [-150, 150],
            "link": {**LINK, "mass_kg": 20}, "motor": MOTOR,
        },
        {
            "name": "lift", "dh": {"a_m": 0.7}, "limits_deg": [-90, 120], "link": {**LINK, "mass_kg": 12},
            "motor": MOTOR,
        },
    ],
    "springs": [
        {"name": f"gear_{name}", "joint": name, "place": "transmission", "stiffness_nm_rad": 2e5, "damping_nms_rad": 30}
        for name in ("turn", "lift")
    ],
    "payload": {"mass_kg": 4, "com_m": [0.1, 0, 0], "inertia_kgm2": {"xx": 0.1, "yy": 0.1, "zz": 0.1}},
}  # fmt: skip


def numbers(pattern, message):
    return [float(each) for each in re.findall(pattern, message)]


def findings(stated, true, scale=1.0):
    """What the mean torques of a true file, read by a scale, say of a stated one."""
    robot, own = (RobotFile.model_validate(file).to_robot() for file in (stated, true))
    frf = exact_frf(robot, PLACES, np.geomspace(1, 40, 20))
    torque = solve_statics(build_model(own), PLACES).motor_torque * scale
    angle = PLACES @ own.motor_per_arm.T
    told = replace(frf, mean_input=torque, mean_output=angle, motion_rms=np.full_like(angle, 0.3))
    return data_findings(robot, told)


@pytest.mark.parametrize("lean_deg", [(2.0, -3.0), (-2.0, -3.0), (0.0, 2.5)])
def test_a_lean_is_told_by_the_turns_of_the_base(lean_deg):
    true, mended = copy.deepcopy(FILE), copy.deepcopy(FILE)
    true["base_rpy_deg"][:2] = lean_deg
    (finding,) = findings(FILE, true)
    for axis, index in (("x", 0), ("y", 1)):
        mended["base_rpy_deg"][index] += sum(numbers(rf"([+-]\S+) deg about the world's {axis}", finding.message))
    assert not findings(mended, true)


def test_a_payload_is_told_in_kilograms():
    true, mended = copy.deepcopy(FILE), copy.deepcopy(FILE)
    true["payload"]["mass_kg"] = 6.5
    (finding,) = findings(FILE, true)
    (mended["payload"]["mass_kg"],) = numbers(r"carry a payload of (\S+) kg", finding.message)
    assert not findings(mended, true)


def test_a_torque_constant_is_told_by_what_it_is_to_be_changed():
    scale = np.array([1.0, 1.12])
    (finding,) = findings(FILE, FILE, scale)
    (percent,) = numbers(r"correct its torque constant by ([+-]\S+) %", finding.message)
    assert not findings(FILE, FILE, scale * np.array([1.0, 1 + percent / 100]))


def test_a_link_is_told_by_its_mass():
    true, mended = copy.deepcopy(FILE), copy.deepcopy(FILE)
    true["joints"][1]["link"]["mass_kg"] *= 1.3
    (finding,) = findings(FILE, true)
    factors = numbers(r"carry (\S+) times the mass of lift's link", finding.message)
    kilograms = numbers(r"carry a payload of (\S+) kg", finding.message)
    # With one arm of one length, a heavier link and a heavier payload may be the same.
    for factor in factors:
        mended["joints"][1]["link"]["mass_kg"] *= factor
    for mass in kilograms:
        mended["payload"]["mass_kg"] = mass
    assert factors or kilograms
    assert not findings(mended, true)
