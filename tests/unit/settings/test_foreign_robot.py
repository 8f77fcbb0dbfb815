"""Robot files that point at a rigid model: completed from it, and refused with everything that is wrong."""

import json
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from robid.errors import SettingsError
from robid.models.known import load_experiment
from robid.settings.load import load_robot

CONFIGS = Path(__file__).parents[3] / "configs"
MODEL = """<robot name="arm">
  <link name="base"/>
  <link name="upper"><inertial><mass value="10"/><origin xyz="0.2 0 0"/>
    <inertia ixx="0.05" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="lower"><inertial><mass value="4"/><origin xyz="0.15 0 0"/>
    <inertia ixx="0.01" iyy="0.06" izz="0.06" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <link name="tool"/>
  <joint name="lift" type="revolute"><parent link="base"/><child link="upper"/><axis xyz="0 1 0"/>
    <limit lower="-1.5" upper="1.5" effort="200" velocity="3"/></joint>
  <joint name="swing" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.4 0 0"/>
    <axis xyz="0 -1 0"/><limit lower="-2" upper="2" effort="80" velocity="3"/></joint>
  <joint name="weld" type="fixed"><parent link="lower"/><child link="tool"/><origin xyz="0.3 0 0" rpy="0 0.5 0"/>
  </joint>
</robot>
"""
MOTOR = {"inertia_kgm2": 2e-4, "gear_ratio": 100}
GEAR = {"stiffness_nm_rad": 2e4, "damping_nms_rad": 10}
UNIT = {"xx": 0.01, "yy": 0.01, "zz": 0.01}


def robot_data():
    return json.loads(
        json.dumps(
            {
                "schema_version": 1,
                "name": "arm",
                "model": "arm.urdf",
                "flange": "tool",
                "total_mass_kg": 14,
                "joints": [
                    {"name": "lift", "motor": MOTOR, "gear": GEAR},
                    {"name": "swing", "motor": MOTOR, "gear": GEAR},
                ],
                "payload": {"mass_kg": 2, "com_m": [0, 0, 0.1], "inertia_kgm2": UNIT},
            }
        )
    )


def written(folder, change=dict.copy, model=MODEL):
    data = robot_data()
    change(data)
    (folder / "arm.urdf").write_text(model)
    YAML().dump(data, folder / "robot.yaml")
    return folder / "robot.yaml"


def refused(folder, change=dict.copy, model=MODEL):
    with pytest.raises(SettingsError) as caught:
        load_robot(written(folder, change, model))
    return caught.value.what.splitlines()


def test_limits_come_from_the_model_unless_the_file_has_its_own(tmp_path):
    def change(data):
        data["joints"][1]["limits_deg"] = [-20, 30]
        data["joints"][1]["motor"]["max_torque_nm"] = 3

    first, second = load_robot(written(tmp_path, change)).to_robot().joints
    np.testing.assert_allclose([first.lower, first.upper], [-1.5, 1.5])
    np.testing.assert_allclose([second.lower, second.upper], np.deg2rad([-20, 30]))
    np.testing.assert_allclose([first.motor.max_speed_rad_s, first.motor.max_torque_nm], [300, 2])
    np.testing.assert_allclose([second.motor.max_speed_rad_s, second.motor.max_torque_nm], [300, 3])


def test_payload_and_springs_are_given_in_the_model_s_frames(tmp_path):
    def change(data):
        spring = {"joint": "swing", **GEAR, "axis": [1, 0, 0]}
        data["springs"] = [
            {"name": "twist", "place": "bearing", **spring},
            {
                "name": "tube",
                "place": "split",
                **spring,
                "point_m": [0.1, 0, 0.05],
                "outboard": {
                    "mass_kg": 2,
                    "com_m": [0.2, 0, 0.01],
                    "inertia_kgm2": {"xx": 0.003, "yy": 0.01, "zz": 0.012},
                },
            },
        ]

    robot = load_robot(written(tmp_path, change)).to_robot()
    # The axis of `swing` is -y: its joint frame has z along the file's -y.
    to_joint = robot.joints[1].rotation.T @ robot.joints[0].rotation.T
    np.testing.assert_allclose(to_joint @ [0, -1, 0], [0, 0, 1], atol=1e-12)
    turn = np.array([[np.cos(0.5), 0, np.sin(0.5)], [0, 1, 0], [-np.sin(0.5), 0, np.cos(0.5)]])
    np.testing.assert_allclose(robot.payload.com_m, to_joint @ ([0.3, 0, 0] + turn @ [0, 0, 0.1]), atol=1e-12)
    twist, tube = robot.springs[2:]
    np.testing.assert_allclose(twist.axis, to_joint @ [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(tube.point_m, to_joint @ [0.1, 0, 0.05], atol=1e-12)
    np.testing.assert_allclose(tube.outboard.com_m, to_joint @ [0.2, 0, 0.01], atol=1e-12)
    tensor = to_joint @ np.diag([0.003, 0.01, 0.012]) @ to_joint.T
    np.testing.assert_allclose(tube.outboard.inertia_kgm2, tensor, atol=1e-12)


def test_sensors_are_given_in_the_model_s_frames(tmp_path):
    def change(data):
        data["sensors"] = [
            {"name": "tip", "kind": "tracker", "axis": [0, 0, 2], "point_m": [0, 0, 0.1]},
            {"name": "felt", "kind": "accelerometer", "joint": "swing", "axis": [1, 0, 0], "point_m": [0.1, 0, 0]},
        ]

    robot = load_robot(written(tmp_path, change)).to_robot()
    tip, felt = robot.sensors
    np.testing.assert_allclose(tip.point_m, robot.payload.com_m, atol=1e-12)
    np.testing.assert_array_equal(tip.axis, [0, 0, 1])
    to_joint = robot.joints[1].rotation.T @ robot.joints[0].rotation.T
    np.testing.assert_allclose(felt.point_m, to_joint @ [0.1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(felt.axis, to_joint @ [1, 0, 0], atol=1e-12)


def test_gears_are_springs_named_after_their_joint(tmp_path):
    def change(data):
        data["joints"][0]["gear"]["assumed"] = ["damping_nms_rad"]

    robot = load_robot(written(tmp_path, change)).to_robot()
    assert [spring.name for spring in robot.springs] == ["gear_lift", "gear_swing"]
    assert robot.springs[0].stiffness == 2e4
    assert robot.assumed == ("gear_lift.damping_nms_rad",)


def edit(*path, value):
    def change(data):
        for key in path[:-1]:
            data = data[key]
        data[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        (edit("joints", 0, "name", value="lifft"), "joints[1].name", "no joint `lifft`; did you mean `lift`?"),
        (edit("joints", 0, "name", value="weld"), "joints[1].name", "`weld` is fixed in the model"),
        (edit("joints", 0, "motor", "gear_ratio", value=0), "joints[1].motor.gear_ratio", "0 is implausible"),
        (
            edit("joints", 0, "motor", "gear_ratio", value=5730),
            "joints[1].motor.gear_ratio",
            "100 taken for degrees per radian",
        ),
        (edit("joints", 0, "motor", "gear_ratio", value=0.01), "joints[1].motor.gear_ratio", "its inverse, 100"),
        (
            edit("joints", 0, "motor", "inertia_kgm2", value=0.2),
            "joints[1].motor.inertia_kgm2",
            "30 s to 300 rad/s",
        ),
        (
            edit("joints", 0, "motor", "inertia_kgm2", value=2e-7),
            "joints[1].motor.inertia_kgm2",
            "0.002 kg m^2 at the arm, 940 times less than what `lift` moves",
        ),
        (edit("total_mass_kg", value=20), "total_mass_kg", "20 kg is stated, but the links that move have 14 kg"),
        (edit("flange", value="tol"), "flange", "did you mean `tool`?"),
        (edit("locked_deg", value={"grip": 0}), "locked_deg.grip", "no joint `grip`"),
        (edit("model", value="leg.urdf"), "model", "cannot be read: No such file"),
        (edit("joints", 0, "dh", value={}), "joints[1].dh", "S311"),
        (edit("joints", 0, "motor", "gear_ratio", value=-0.3), "joints[1].motor.gear_ratio", "inverse, -3.333,"),
    ],
)
def test_what_cannot_be_is_told_with_its_field(tmp_path, change, field, words):
    told = [line for line in refused(tmp_path, change) if f": {field}: " in line]
    assert len(told) >= 1
    assert any(words in line for line in told), told


def test_a_spring_on_a_joint_that_does_not_move(tmp_path):
    def change(data):
        data["joints"].pop()
        data["locked_deg"] = {"swing": 10}
        spring = {"place": "bearing", "axis": [1, 0, 0], **GEAR}
        data["springs"] = [{"name": "a", "joint": "weld", **spring}, {"name": "b", "joint": "swing", **spring}]

    told = refused(tmp_path, change)
    assert len(told) == 2
    assert "springs[1].joint: S271 joint `weld` is fixed in the model: a spring there needs a `split`" in told[0]
    assert "springs[2].joint: S271 joint `swing` is locked by `locked_deg`" in told[1]


def test_locked_joints_move_with_the_link_that_carries_them(tmp_path):
    def change(data):
        data["joints"].pop()
        data["locked_deg"] = {"swing": 90}

    (joint,) = load_robot(written(tmp_path, change)).to_robot().joints
    # Turned by 90 deg about -y, the lower link's centre of mass lies 0.15 m above its joint.
    com = joint.rotation @ joint.link.com_m
    np.testing.assert_allclose(com, [(10 * 0.2 + 4 * 0.4) / 14, 0, 4 * 0.15 / 14], atol=1e-12)


def test_a_hinge_that_is_not_named_is_not_forgotten(tmp_path):
    told = refused(tmp_path, lambda data: data["joints"].pop())
    assert "joint `swing` of `arm.urdf` is neither here nor in `locked_deg`" in told[0]


def test_links_without_inertials_are_all_told(tmp_path):
    bare = MODEL.split("<inertial>")
    model = "".join([bare[0], *(part.split("</inertial>")[1] for part in bare[1:])])
    (told,) = refused(tmp_path, lambda data: data.pop("total_mass_kg"), model)
    assert "S317 links without an `inertial` in `arm.urdf`: `upper`, `lower`" in told


def test_limits_that_nobody_states_are_missing(tmp_path):
    model = MODEL.replace("revolute", "continuous").replace(' velocity="3"', "")
    fields = [line.split(": ")[1] for line in refused(tmp_path, model=model)]
    assert {"joints[1].limits_deg", "joints[2].limits_deg"} <= set(fields)


def test_everything_wrong_is_told_at_once(tmp_path):
    def change(data):
        data["joints"][0]["motor"]["gear_ratio"] = 0
        data["joints"][1]["motor"]["inertia_kgm2"] = 0.2
        data["springs"] = [{"name": "a", "joint": "weld", "place": "bearing", "axis": [1, 0, 0], **GEAR}]
        data["total_mass_kg"] = 3

    told = "\n".join(refused(tmp_path, change))
    for field in ("joints[1].motor.gear_ratio", "joints[2].motor.inertia_kgm2", "springs[1].joint", "total_mass_kg"):
        assert f": {field}: " in told


def test_a_file_without_model_must_say_everything_itself(tmp_path):
    def change(data):
        for key in ("model", "flange"):
            data.pop(key)

    told = "\n".join(refused(tmp_path, change))
    for field in ("joints[1].dh", "joints[1].link", "joints[2].limits_deg"):
        assert f": {field}: S" in told


def test_a_data_folder_that_is_not_there_is_left_for_later(tmp_path, monkeypatch):
    monkeypatch.setenv("ROBID_DATA", str(tmp_path / "nowhere"))
    robot = load_robot(written(tmp_path, edit("model", value="${ROBID_DATA}/arm.urdf")))
    assert not robot.is_complete
    monkeypatch.setenv("ROBID_DATA", str(tmp_path))
    assert load_robot(tmp_path / "robot.yaml").is_complete


def test_a_ur5e_takes_under_40_lines():
    lines = (CONFIGS / "robots" / "ur5e.yaml").read_text().splitlines()
    assert len(lines) < 40
    assert max(map(len, lines)) <= 160


@pytest.mark.parametrize("name", ["ur5e", "kr210", "iiwa14"])
def test_examples_of_foreign_robots_are_complete(data_folder, monkeypatch, name):
    monkeypatch.setenv("ROBID_DATA", str(data_folder("robot_models").parent))
    robot = load_experiment(CONFIGS / f"{name}.yaml").robot
    assert robot.is_complete
    assert len(robot.to_robot().springs) >= len(robot.joints)
