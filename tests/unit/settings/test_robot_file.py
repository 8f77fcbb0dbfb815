import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation

from robid.errors import SettingsError
from robid.robot.friction import Friction
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.settings.joint_sections import Dh
from robid.settings.load import load_robot
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import Body, FrictionSection, InertiaTensor
from robid.settings.robot_sections import moved as _moved
from tolerances import IDENTITY, RECOVERY

CONFIGS = Path(__file__).parents[3] / "configs"
SECTION = {
    "dh": {"d_m": 0.3, "a_m": 0.2, "alpha_deg": 90, "offset_deg": 30},
    "limits_deg": [-100, 100],
    "link": {"mass_kg": 10, "com_m": [0.1, 0.2, 0.3], "inertia_kgm2": {"xx": 1, "yy": 1.2, "zz": 0.9, "xy": 0.1}},
    "motor": {"inertia_kgm2": 1e-3, "gear_ratio": 100, "max_speed_rad_s": 300, "max_torque_nm": 20},
}
GEAR = {"place": "transmission", "stiffness_nm_rad": 1e5, "damping_nms_rad": 10}
SPLIT = {
    "name": "tube",
    "joint": "two",
    "place": "split",
    "axis": [0, 0, 2],
    "point_m": [0, 0, 0.1],
    "outboard": {"mass_kg": 5, "com_m": [0.1, 0.2, 0.3], "inertia_kgm2": {"xx": 0.5, "yy": 0.6, "zz": 0.4}},
    "stiffness_nm_rad": 2e5,
    "damping_nms_rad": 20,
}


def _robot_data() -> dict:
    data = {
        "schema_version": 1,
        "name": "arm",
        "joints": [{"name": "one", **SECTION}, {"name": "two", **SECTION}],
        "springs": [{"name": "g1", "joint": "one", **GEAR}, {"name": "g2", "joint": "two", **GEAR}, SPLIT],
        "payload": {"mass_kg": 4, "com_m": [0, 0, 0.1], "inertia_kgm2": {"xx": 0.1, "yy": 0.1, "zz": 0.1}},
    }
    return json.loads(json.dumps(data))


def _problems(folder: Path, data: dict) -> str:
    path = folder / "robot.yaml"
    YAML().dump(data, path)
    with pytest.raises(SettingsError) as caught:
        load_robot(path)
    return caught.value.what


def _standard_dh(angle: float, dh: Dh) -> np.ndarray:
    """The matrix as textbooks print it."""
    theta, alpha = angle + np.deg2rad(dh.offset_deg), np.deg2rad(dh.alpha_deg)
    ct, st, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    return np.array(
        [
            [ct, -st * ca, st * sa, dh.a_m * ct],
            [st, ct * ca, -ct * sa, dh.a_m * st],
            [0, sa, ca, dh.d_m],
            [0, 0, 0, 1],
        ]
    )


def _homogeneous(rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = rotation, position
    return frame


def test_kinematics_and_centres_of_mass_follow_the_dh_chain():
    file = load_robot(CONFIGS / "robots" / "kr300.yaml")
    robot = file.to_robot()
    rng = np.random.default_rng(1)
    for angles in rng.uniform(-3, 3, (5, 6)):
        ours = np.eye(4)
        chain = np.diag([1.0, -1.0, -1.0, 1.0])
        for joint, section, angle in zip(robot.joints, file.joints, angles, strict=True):
            turn = Rotation.from_rotvec([0, 0, angle]).as_matrix()
            ours = ours @ _homogeneous(joint.rotation, joint.position_m) @ _homogeneous(turn, np.zeros(3))
            chain = chain @ _standard_dh(angle, section.dh)
            expected = chain @ [*section.link.com_m, 1]
            np.testing.assert_allclose(ours @ [*joint.link.com_m, 1], expected, rtol=0, atol=4 * IDENTITY)
            world = ours[:3, :3] @ joint.link.inertia_kgm2 @ ours[:3, :3].T
            tensor = chain[:3, :3] @ section.link.inertia_kgm2.matrix() @ chain[:3, :3].T
            np.testing.assert_allclose(world, tensor, rtol=0, atol=100 * IDENTITY)
        np.testing.assert_allclose(
            ours @ [*robot.payload.com_m, 1], chain @ [*file.payload.com_m, 1], rtol=0, atol=4 * IDENTITY
        )


def test_base_turns_about_fixed_axes_x_then_y_then_z():
    data = _robot_data() | {"base_rpy_deg": [90, 90, 0]}
    data["joints"][0]["dh"]["offset_deg"] = 0
    rotation = RobotFile.model_validate(data).to_robot().joints[0].rotation
    # y turns to z about x, and z to x about y.
    np.testing.assert_allclose(rotation @ [0, 1, 0], [1, 0, 0], rtol=0, atol=IDENTITY)


def test_moving_an_inertial_keeps_its_invariants():
    rng = np.random.default_rng(2)
    for _ in range(20):
        half = rng.normal(size=(3, 3))
        tensor = half @ half.T + np.eye(3)
        keys = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "yz": (1, 2), "xz": (0, 2)}
        body = Body(
            mass_kg=3,
            com_m=tuple(rng.normal(size=3)),
            inertia_kgm2=InertiaTensor(**{k: tensor[i] for k, i in keys.items()}),
        ).inertial()
        np.testing.assert_array_equal(body.inertia_kgm2, tensor)
        dh = Dh(d_m=rng.normal(), a_m=rng.normal(), alpha_deg=rng.uniform(-180, 180), offset_deg=rng.uniform(-180, 180))
        moved = _moved(body, *dh.link_frame())
        np.testing.assert_allclose(np.linalg.eigvalsh(moved.inertia_kgm2), np.linalg.eigvalsh(tensor), rtol=IDENTITY)
        position, _ = dh.link_frame()
        np.testing.assert_allclose(np.linalg.norm(moved.com_m - position), np.linalg.norm(body.com_m), rtol=IDENTITY)
        assert moved.mass_kg == 3


def test_split_is_moved_into_the_joint_frame_and_bearing_axis_stays():
    data = _robot_data()
    data["springs"].append({**GEAR, "name": "b", "joint": "two", "place": "bearing", "axis": [3, 0, 4]})
    *_, split, bearing = RobotFile.model_validate(data).to_robot().springs
    # alpha = 90 deg turns the end frame's z into the joint frame's -y.
    np.testing.assert_allclose(split.axis, [0, -1, 0], rtol=0, atol=IDENTITY)
    np.testing.assert_allclose(split.point_m, [0.2, -0.1, 0.3], rtol=0, atol=IDENTITY)
    np.testing.assert_allclose(split.outboard.com_m, [0.3, -0.3, 0.5], rtol=0, atol=IDENTITY)
    np.testing.assert_allclose(np.diag(split.outboard.inertia_kgm2), [0.5, 0.4, 0.6], rtol=0, atol=IDENTITY)
    np.testing.assert_allclose(bearing.axis, [0.6, 0, 0.8], rtol=0, atol=IDENTITY)
    assert split.joint == bearing.joint == 1


def test_springs_of_base_and_payload_and_couplings_arrive():
    data = _robot_data() | {"base": {"mass_kg": 20, "com_m": [0, 0, 0.1], "inertia_kgm2": {"xx": 1, "yy": 1, "zz": 1}}}
    spring = {"axis": [0, 0, 2], "stiffness_nm_rad": 1e4, "damping_nms_rad": 5}
    data["springs"].append({**spring, "name": "rock", "place": "base", "point_m": [0, 0, -0.2]})
    data["springs"].append({**spring, "name": "sway", "place": "payload", "point_m": [0, 0, 0.1]})
    data["joints"][1]["couplings"] = {"one": 0.01}
    data["base_rpy_deg"] = [90, 0, 0]
    robot = RobotFile.model_validate(data).to_robot()
    *_, rock, sway = robot.springs
    np.testing.assert_array_equal(rock.axis, [0, 0, 1])
    np.testing.assert_array_equal(rock.point_m, [0, 0, -0.2])
    # alpha = 90 deg turns the end frame's z into the joint frame's -y.
    np.testing.assert_allclose(sway.axis, [0, -1, 0], rtol=0, atol=IDENTITY)
    np.testing.assert_allclose(sway.point_m, [0.2, -0.1, 0.3], rtol=0, atol=IDENTITY)
    assert (rock.joint, sway.joint, robot.base.mass_kg) == (0, 1, 20)
    np.testing.assert_allclose(robot.arm_per_motor, [[0.01, 0], [0.01, 0.01]])


def test_payload_mass_scales_mass_and_inertia_alone():
    file = RobotFile.model_validate(_robot_data())
    nominal, heavy, none = file.to_robot().payload, file.to_robot(10).payload, file.to_robot(0).payload
    assert (nominal.mass_kg, heavy.mass_kg, none.mass_kg) == (4, 10, 0)
    np.testing.assert_allclose(heavy.inertia_kgm2, 2.5 * nominal.inertia_kgm2, rtol=IDENTITY)
    np.testing.assert_array_equal(heavy.com_m, nominal.com_m)
    assert not none.inertia_kgm2.any()
    bare = RobotFile.model_validate({key: value for key, value in _robot_data().items() if key != "payload"})
    assert bare.to_robot().payload.mass_kg == 0
    with pytest.raises(SettingsError, match="S330"):
        bare.to_robot(1)


def test_values_arrive_in_their_units():
    robot = load_robot(CONFIGS / "robots" / "kr300.yaml").to_robot()
    assert len(robot.joints) == 6
    assert len(robot.springs) == 13
    np.testing.assert_allclose([robot.joints[0].lower, robot.joints[0].upper], np.deg2rad([-147, 147]))
    assert robot.joints[0].motor.friction.coulomb_nm == 0.73192436
    assert robot.joints[0].motor.inertia_relative_std == 0.05
    assert robot.springs[0].stiffness == 4577800
    assert robot.notes


def test_friction_section_mirrors_the_plain_description():
    assert FrictionSection().friction() == Friction()
    assert set(FrictionSection.model_fields) - {"assumed"} == set(vars(Friction()))


def test_assumed_values_are_named_from_the_joint_or_spring_on():
    data = _robot_data() | {"assumed": ["gravity_m_s2"]}
    data["joints"][0]["motor"]["assumed"] = ["max_torque_nm", "friction.static_nm"]
    data["joints"][0]["link"]["assumed"] = ["inertia_kgm2.xx"]
    data["springs"][0]["assumed"] = ["damping_nms_rad"]
    data["springs"][2]["outboard"]["assumed"] = ["mass_kg"]
    data["payload"]["assumed"] = ["com_m"]
    assert set(RobotFile.model_validate(data).to_robot().assumed) == {
        "gravity_m_s2",
        "one.motor.max_torque_nm",
        "one.motor.friction.static_nm",
        "one.link.inertia_kgm2.xx",
        "g1.damping_nms_rad",
        "tube.outboard.mass_kg",
        "payload.com_m",
    }


def test_an_assumed_name_must_exist_in_its_section(tmp_path):
    data = _robot_data()
    data["joints"][0]["motor"]["assumed"] = ["max_torque_nm", "friction.static_n"]
    data["springs"][1]["assumed"] = ["gear_ratio"]
    lines = _problems(tmp_path, data).splitlines()
    assert len(lines) == 2
    assert "joints[1].motor.assumed[2]: S292" in lines[0]
    assert "did you mean `static_nm`?" in lines[0]
    assert "springs[2].assumed[1]: S292 there is no value `gear_ratio` here" in lines[1]


@pytest.mark.parametrize(
    ("change", "field", "words"),
    [
        (lambda d: d["joints"][1].update(name="one"), "joints[2].name", "`one` names more than one"),
        (lambda d: d["springs"][0].update(name="two"), "springs[1].name", "S254"),
        (lambda d: d["springs"].pop(1), "joints[2].name", "exactly one transmission spring, but has none"),
        (lambda d: d["springs"][1].update(joint="one"), "joints[1].name", "but has 2 (g1, g2)"),
        (lambda d: d["springs"][2].update(joint="twoo"), "springs[3].joint", "did you mean `two`?"),
        (lambda d: d["springs"][2].pop("joint"), "springs[3].joint", "a split spring belongs to a joint"),
        (lambda d: d["springs"][2].update(place="base", outboard=None), "springs[3].joint", "S269"),
        (
            lambda d: (d.pop("payload"), d["springs"][2].update(place="payload")),
            "springs[3].place",
            "needs a `payload`",
        ),
        (lambda d: d.update(base=d["payload"]), "base", "S289"),
        (lambda d: d["joints"][0].update(couplings={"twoo": 0.01}), "joints[1].couplings.twoo", "did you mean `two`"),
        (lambda d: d["joints"][0].update(couplings={"one": 0.01}), "joints[1].couplings.one", "S285"),
        (lambda d: d["joints"][0].update(couplings={"two": 57}), "joints[1].couplings.two", "57 is implausible"),
        (lambda d: d["joints"][0].update(limits_deg=[5, 5]), "joints[1].limits_deg", "not below"),
        (lambda d: d["springs"][2]["outboard"].update(mass_kg=0), "springs[3].outboard.mass_kg", "above 0"),
        (lambda d: d["joints"][0]["link"]["inertia_kgm2"].update(xy=2), "joints[1].link.inertia_kgm2", "definite"),
        (lambda d: d["joints"][0]["link"]["inertia_kgm2"].update(zz=3), "joints[1].link.inertia_kgm2", "S266"),
        (lambda d: d["payload"]["inertia_kgm2"].update(zz=0), "payload.inertia_kgm2", "positive definite"),
        (lambda d: d["joints"][0]["motor"].update(gear_ratio=0), "joints[1].motor.gear_ratio", "from 1 to 2000"),
        (lambda d: d["springs"][0].update(axis=[0, 0, 1]), "springs[1].axis", "S275"),
        (lambda d: d["springs"][0].update(stiffness_nm_rad=0), "springs[1].stiffness_nm_rad", "greater than 0"),
        (lambda d: d["springs"][2].pop("axis"), "springs[3].axis", "is missing"),
        (lambda d: d["springs"][2].update(axis=[0, 0, 0]), "springs[3].axis", "no direction"),
        (lambda d: d["springs"][2].pop("outboard"), "springs[3].outboard", "is missing"),
        (lambda d: d["springs"][2].pop("point_m"), "springs[3].point_m", "is missing"),
        (lambda d: d["springs"][2]["outboard"].update(mass_kg=10), "springs[3].outboard.mass_kg", "below the 10 kg"),
        (
            lambda d: d["springs"][2]["outboard"]["inertia_kgm2"].update(xx=0.99),
            "springs[3].outboard.inertia_kgm2",
            "S284",
        ),
        (
            lambda d: d["springs"][2].update(place="bearing", point_m=None, outboard=None),
            "springs[3].axis",
            "along the joint axis",
        ),
        (lambda d: d["springs"][2].update(place="bearing", axis=[1, 0, 0]), "springs[3].point_m", "S280"),
        (lambda d: d["joints"][0]["link"].update(com_m=[0, 1]), "joints[1].link.com_m[3]", "is missing"),
        (lambda d: d["joints"][0]["link"].update(mass_kg=float("nan")), "joints[1].link.mass_kg", "finite"),
        (
            lambda d: d.update(controller={"delay_sample": 1}),
            "controller.delay_sample",
            "did you mean `delay_samples`?",
        ),
    ],
)
def test_what_cannot_be_is_told_with_its_field(tmp_path, change, field, words):
    data = _robot_data()
    change(data)
    told = [line for line in _problems(tmp_path, data).splitlines() if f": {field}: " in line]
    assert len(told) == 1
    assert words in told[0]


def test_unchanged_data_of_these_tests_load(tmp_path):
    YAML().dump(_robot_data(), tmp_path / "robot.yaml")
    assert load_robot(tmp_path / "robot.yaml").name == "arm"


def test_every_semantic_problem_is_told_at_once(tmp_path):
    data = _robot_data()
    data["joints"][0]["limits_deg"] = [5, 4]
    data["joints"][1]["link"]["inertia_kgm2"]["zz"] = 0
    data["springs"][2]["axis"] = [0, 0, 0]
    told = _problems(tmp_path, data)
    assert all(
        f": {field}: " in told for field in ("joints[1].limits_deg", "joints[2].link.inertia_kgm2", "springs[3].axis")
    )


def test_a_breakaway_level_is_the_coulomb_level_where_not_given_and_never_below(tmp_path):
    data = _robot_data()
    for joint, friction in zip(
        data["joints"], ({"coulomb_nm": 0.5}, {"coulomb_nm": 0.5, "static_nm": 0.4}), strict=True
    ):
        joint["motor"] = {**joint["motor"], "friction": friction}
    assert RobotFile.model_validate(data).joints[0].motor.motor().friction.static_nm == 0.5
    told = _problems(tmp_path, data)
    assert "joints[2].motor.friction.static_nm: S256 must not be below the Coulomb level, 0.5 N m (found 0.4)" in told
    assert len(told.splitlines()) == 1


def test_missing_keys_are_told_beside_other_errors_of_their_section(tmp_path):
    data = _robot_data()
    for key in ("dh", "link", "limits_deg"):
        data["joints"][0].pop(key)
    data["joints"][0]["motor"].update(inertia_kgm2=-1, bad=3)
    data["joints"][0]["motor"].pop("gear_ratio")
    told = _problems(tmp_path, data)
    for field in ("dh", "link", "limits_deg", "motor.gear_ratio", "motor.inertia_kgm2", "motor.bad"):
        assert told.count(f": joints[1].{field}: ") == 1
    assert "joints[2]" not in told


def test_a_link_without_mass_has_its_inertia_alone():
    data = _robot_data()
    data["joints"][0]["link"]["mass_kg"] = 0
    robot = RobotFile.model_validate(data).to_robot()
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.array([[0.3, -0.7]])))
    # alpha = 90 deg turns the joint's axis into the link's y axis.
    np.testing.assert_allclose(linear.axial[0], 1.2, rtol=IDENTITY)
    links = [robot.joints[1].link.mass_kg, robot.payload.mass_kg]
    assert model.mujoco.body_subtreemass[model.mujoco.body("one").id] == pytest.approx(sum(links), rel=IDENTITY)


def test_the_puma_is_the_published_one(data_folder):
    published = json.loads((data_folder("robot_models") / "puma560_corke.json").read_text())
    file = load_robot(CONFIGS / "robots" / "puma560.yaml")
    turns = {"pi/2": 90, "-pi/2": -90}
    for index, joint in enumerate(file.joints):
        assert (joint.dh.d_m, joint.dh.a_m) == (published["d"][index], published["a"][index])
        assert joint.dh.alpha_deg == turns.get(published["alpha"][index], 0)
        assert joint.link.mass_kg == published["mass"][index]
        assert list(joint.link.com_m) == published["com_m"][index]
        stated, inertia = joint.link.inertia_kgm2, published["inertia_com"][index]
        for key, value in zip(("xx", "yy", "zz", "xy", "yz", "xz"), inertia, strict=True):
            assert getattr(stated, key) == value or f"inertia_kgm2.{key}" in joint.link.assumed
        motor, coulomb = joint.motor, published["motor_coulomb_pos_neg"][index]
        assert (motor.inertia_kgm2, motor.gear_ratio) == (
            published["motor_inertia"][index],
            published["gear_ratio"][index],
        )
        assert motor.friction.viscous_nms_rad == published["motor_visc"][index]
        assert motor.friction.coulomb_nm == pytest.approx((coulomb[0] - coulomb[1]) / 2)
        assert (motor.max_speed_rad_s, motor.max_torque_nm) == (None, None)


def test_gravity_on_the_motors_of_the_puma():
    """Virtual work on the textbook's chain, through gears whose springs are almost rigid."""
    file = load_robot(CONFIGS / "robots" / "puma560.yaml")
    robot = file.to_robot()
    stiff = tuple(replace(spring, stiffness=1e5 * spring.stiffness) for spring in robot.springs)
    angles = np.deg2rad([20.0, 40.0, 70.0, 30.0, -50.0, 10.0])

    def energy(angles):
        chain, found = np.eye(4), 0.0
        for angle, section in zip(angles, file.joints, strict=True):
            chain = chain @ _standard_dh(angle, section.dh)
            found += 9.81 * section.link.mass_kg * (chain @ [*section.link.com_m, 1])[2]
        return found

    steps = 1e-5 * np.eye(6)
    arm = np.array([(energy(angles + step) - energy(angles - step)) / 2e-5 for step in steps])
    model = build_model(replace(robot, springs=stiff))
    found = solve_statics(model, angles[None]).motor_torque[0]
    ratios = np.array([joint.motor.gear_ratio for joint in file.joints])
    np.testing.assert_allclose(found, arm / ratios, rtol=0, atol=RECOVERY * np.abs(arm / ratios).max())
    assert np.abs(arm[1:3]).min() > 1


@pytest.mark.parametrize(
    ("path", "field"),
    [
        (("joints", 0, "dh", "d_m"), "joints[1].dh.d_m"),
        (("joints", 1, "limits_deg", 1), "joints[2].limits_deg[2]"),
        (("springs", 2, "axis", 0), "springs[3].axis[1]"),
        (("joints", 0, "motor", "gear_ratio"), "joints[1].motor.gear_ratio"),
    ],
)
def test_a_number_that_nothing_has_is_told_and_overflows_nowhere(tmp_path, path, field):
    data = _robot_data()
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = 1e308
    told = _problems(tmp_path, data)
    assert f"{field}: S294 1e+308" in told
    assert len(told.splitlines()) == 1
