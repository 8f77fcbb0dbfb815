"""Prismatic and rigid joints in robot files, from rigid models, and in the configurations of an experiment."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from ruamel.yaml import YAML

from robid.errors import SettingsError
from robid.models.elastic.fit.solution import with_estimates
from robid.models.known import load_experiment
from robid.robot.model import build_model
from robid.settings.load import load_robot
from robid.settings.robot_values import robot_text, with_values
from tolerances import IDENTITY

CONFIGS = Path(__file__).parents[3] / "configs"
URDF = """<robot name="arm">
  <link name="base"/>
  <link name="carriage"><inertial><mass value="40"/><origin xyz="0.1 0.05 -0.2"/>
    <inertia ixx="1" iyy="2" izz="2.5" ixy="0.1" ixz="0" iyz="0"/></inertial></link>
  <link name="arm"><inertial><mass value="10"/><origin xyz="0.2 0.01 0"/>
    <inertia ixx="0.05" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tip"><inertial><mass value="3"/><origin xyz="0 0 0.1"/>
    <inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="rail" type="prismatic"><parent link="base"/><child link="carriage"/><axis xyz="0.6 0 0.8"/>
    <limit lower="-0.5" upper="2" effort="2000" velocity="1.5"/></joint>
  <joint name="lift" type="revolute"><parent link="carriage"/><child link="arm"/><origin xyz="0.1 0 0.3"/>
    <axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5" effort="200" velocity="3"/></joint>
  <joint name="ram" type="prismatic"><parent link="arm"/><child link="tip"/><origin xyz="0.4 0 0"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.3" effort="300" velocity="1"/></joint>
</robot>
"""
LINEAR = {"inertia_kgm2": 1e-3, "gear_ratio_rad_m": 200, "max_speed_rad_s": 300}
TURNING = {"inertia_kgm2": 2e-4, "gear_ratio": 100, "max_speed_rad_s": 300}


def robot_data():
    return json.loads(
        json.dumps(
            {
                "schema_version": 1,
                "name": "arm",
                "model": "arm.urdf",
                "joints": [
                    {
                        "name": "rail",
                        "type": "prismatic",
                        "motor": LINEAR,
                        "gear": {"stiffness_n_m": 2e6, "damping_ns_m": 100},
                    },
                    {"name": "lift", "motor": TURNING, "gear": {"stiffness_nm_rad": 2e4, "damping_nms_rad": 10}},
                    {"name": "ram", "type": "prismatic", "rigid": True, "motor": LINEAR},
                ],
            }
        )
    )


def written(folder, change=dict.copy, model=URDF):
    data = robot_data()
    change(data)
    (folder / "arm.urdf").write_text(model)
    YAML().dump(data, folder / "robot.yaml")
    return folder / "robot.yaml"


def test_a_gantry_is_read_in_its_own_units():
    robot = load_robot(CONFIGS / "robots/gantry.yaml").to_robot()
    assert robot.prismatic.all()
    assert robot.rigid.tolist() == [False, False, True]
    np.testing.assert_allclose([robot.lower, robot.upper], [[0, -1.5, -0.8], [4, 1.5, 0.2]])
    np.testing.assert_allclose(robot.gear_ratio, [250, 314.159265, -628.318531])
    assert [(s.stiffness, s.damping) for s in robot.springs[:3]] == [(1.2e7, 2500), (1e7, 1500), (2.3e7, 8000)]
    assert [robot.is_linear(spring) for spring in robot.springs] == [True, True, False, False, False]


def test_friction_of_arms_is_stated_in_the_units_of_the_joint(tmp_path):
    def rubbing(data):
        data["joints"][0]["arm_viscous_ns_m"] = 300.0
        data["joints"][1]["arm_viscous_nms_rad"] = 20.0

    robot = load_robot(written(tmp_path, rubbing))
    assert robot.to_robot().arm_viscous.tolist() == [300.0, 20.0, 0.0]
    changed = with_estimates(robot.to_robot(), {"rail.arm_viscous": 250.0}, {})
    again = tmp_path / "again.yaml"
    again.write_text(robot_text(with_values(robot, changed), "header"))
    assert load_robot(again).to_robot().arm_viscous.tolist() == [250.0, 20.0, 0.0]


@pytest.mark.parametrize(("joint", "key"), [(0, "arm_viscous_nms_rad"), (1, "arm_viscous_ns_m")])
def test_friction_of_an_arm_in_the_other_unit_is_refused(tmp_path, joint, key):
    with pytest.raises(SettingsError, match=f"{key}.* joint: "):
        load_robot(written(tmp_path, lambda data: data["joints"][joint].update({key: 3.0})))


@pytest.mark.parametrize("format_", ["urdf", "mjcf"])
def test_slides_of_a_rigid_model_keep_inertia_gravity_and_limits(tmp_path, format_):
    """Against MuJoCo's own reading of the file, all joints rigid and rotors without inertia."""
    text = URDF
    if format_ == "mjcf":
        spec = mujoco.MjSpec.from_string(URDF)
        spec.compile()
        text = spec.to_xml()

    def rigid(data):
        for joint in data["joints"]:
            joint.pop("gear", None)
            joint["rigid"] = True

    robot = load_robot(written(tmp_path, rigid, text)).to_robot()
    theirs = mujoco.MjModel.from_xml_string(text)
    np.testing.assert_allclose(robot.lower, theirs.jnt_range[:, 0], atol=1e-6)
    np.testing.assert_allclose(robot.upper, theirs.jnt_range[:, 1], atol=1e-6)
    ours = build_model(robot)
    for position in np.random.default_rng(3).uniform(robot.lower, robot.upper, (5, 3)):
        found = []
        for model in (ours.mujoco, theirs):
            data, mass = mujoco.MjData(model), np.zeros((3, 3))
            data.qpos[:] = position
            mujoco.mj_forward(model, data)
            mujoco.mj_fullM(model, data, mass)
            found.append((mass, data.qfrc_bias.copy()))
        reflected = np.diag(robot.gear_ratio**2 * robot.motor_inertia_kgm2)
        np.testing.assert_allclose(found[0][0] - reflected, found[1][0], atol=1e-4 if format_ == "mjcf" else 1e-9)
        np.testing.assert_allclose(found[0][1], found[1][1], atol=1e-3 if format_ == "mjcf" else 1e-9)


def test_limits_of_a_model_pass_the_ratio(tmp_path):
    def open_(data):
        for joint in data["joints"]:
            joint["motor"].pop("max_speed_rad_s")

    rail, lift, _ = load_robot(written(tmp_path, open_)).to_robot().joints
    np.testing.assert_allclose([rail.motor.max_speed_rad_s, rail.motor.max_torque_nm], [300, 10], rtol=IDENTITY)
    np.testing.assert_allclose([lift.motor.max_speed_rad_s, lift.motor.max_torque_nm], [300, 2], rtol=IDENTITY)


def test_locked_slides_stay_where_they_are(tmp_path):
    def locked(data):
        data["joints"].pop()
        data["locked_m"] = {"ram": 0.2}

    robot = load_robot(written(tmp_path, locked)).to_robot()
    np.testing.assert_allclose(robot.joints[-1].link.mass_kg, 13)
    # The arm, and the tip 0.2 m further out than at its zero.
    com = np.array([10 * 0.2 + 3 * (0.4 + 0.2), 10 * 0.01, 3 * 0.1]) / 13
    np.testing.assert_allclose(np.linalg.norm(robot.joints[-1].link.com_m), np.linalg.norm(com))


@pytest.mark.parametrize(
    ("change", "field", "told"),
    [
        (lambda d: d["joints"][0].pop("type"), "joints[1].type", "slides: it needs `type: prismatic`"),
        (lambda d: d["joints"][1].update(type="prismatic"), "joints[2].type", "turns"),
        (lambda d: d.update(locked_deg={"ram": 1}) or d["joints"].pop(), "locked_deg.ram", "write it under `locked_m`"),
        (lambda d: d["joints"].pop(), "joints", "neither here nor in `locked_m`"),
        (lambda d: d["joints"][0]["motor"].update(gear_ratio=5), "joints[1].motor.gear_ratio", "`gear_ratio_rad_m`"),
        (lambda d: d["joints"][0]["motor"].pop("gear_ratio_rad_m"), "joints[1].motor.gear_ratio_rad_m", "is missing"),
        (
            lambda d: d["joints"][0]["motor"].update(gear_ratio_rad_m=0.01),
            "joints[1].motor.gear_ratio_rad_m",
            "a lead in m it would be 628.3",
        ),
        (lambda d: d["joints"][0].update(limits_deg=[0, 1]), "joints[1].limits_deg", "S257"),
        (
            lambda d: d["joints"][0]["gear"].update(stiffness_nm_rad=1),
            "joints[1].gear.stiffness_nm_rad",
            "write `stiffness_n_m`",
        ),
        (lambda d: d["joints"][0]["gear"].pop("damping_ns_m"), "joints[1].gear.damping_ns_m", "is missing"),
        (
            lambda d: d["joints"][1]["gear"].update(damping_ns_m=1),
            "joints[2].gear.damping_ns_m",
            "write `damping_nms_rad`",
        ),
        (lambda d: d["joints"][2].pop("rigid"), "joints[3].name", "S262"),
        (lambda d: d["joints"][1].update(rigid=True), "joints[2].rigid", "has the transmission gear_lift"),
        (lambda d: d.update(rotor="on_link"), "joints[3].rigid", "S263"),
    ],
)
def test_what_is_wrong_is_told_with_its_field(tmp_path, change, field, told):
    with pytest.raises(SettingsError) as caught:
        load_robot(written(tmp_path, change))
    lines = [line for line in caught.value.what.splitlines() if f": {field}: " in line]
    assert len(lines) == 1, caught.value.what
    assert told in lines[0]


@pytest.mark.parametrize(
    ("name", "unit", "told"), [("x.arm", "rad", "is in m, mm or um"), ("x", "mm", "is in rad, mrad")]
)
def test_logs_of_linear_axes_have_units_of_their_own(tmp_path, name, unit, told):
    data = YAML(typ="safe").load((CONFIGS / "gantry.yaml").read_text())
    data["robot"] = str(CONFIGS / data["robot"])
    axes = ("x", "y", "z")
    outputs = [{"name": axis, "variable": axis} for axis in axes if axis != name]
    data["campaigns"]["estimation"]["source"] = {
        "acquire": {
            "file": "{configuration}_{realization}_{experiment}.csv",
            "format": "csv",
            "sampling_period_s": 1e-3,
            "inputs": [{"name": axis, "variable": f"t{axis}"} for axis in axes],
            "outputs": [*outputs, {"name": name, "variable": "n", "unit": unit}],
        }
    }
    path = tmp_path / "gantry.yaml"
    YAML().dump(data, path)
    with pytest.raises(SettingsError, match=told):
        load_experiment(path)


@pytest.mark.parametrize(
    ("chosen", "field", "told"),
    [
        ({"list_deg": [[1, 0, 0]]}, "list_deg", "write `list`"),
        ({"grid_deg": [[1], [0], [0]]}, "grid_deg", "write `grid`"),
        ({"list": [[1, 0, 0.3]]}, "list[1][3]", "0.3 m is unreachable"),
        ({"grid": [[1, 5], [0], [0]]}, "grid[1][2]", "moves from 0 to 4 m"),
        ({"random": {"count": 2, "margin_m": 0.6}}, "random.margin_m", "-0.8 to 0.2 m"),
    ],
)
def test_configurations_of_linear_axes_are_in_metres(tmp_path, chosen, field, told):
    data = YAML(typ="safe").load((CONFIGS / "gantry.yaml").read_text())
    data["robot"] = str(CONFIGS / data["robot"])
    data["campaigns"]["estimation"]["configurations"] = chosen
    path = tmp_path / "gantry.yaml"
    YAML().dump(data, path)
    with pytest.raises(SettingsError) as caught:
        load_experiment(path)
    assert f"campaigns.estimation.configurations.{field}: " in caught.value.what
    assert told in caught.value.what
