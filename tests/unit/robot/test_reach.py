"""What keeps a robot from a configuration, against kinematics written down by hand."""

from pathlib import Path

import numpy as np
import pytest

from robid.errors import DataError
from robid.robot.reach import Reach, Shapes, mirror, points
from robid.settings.load import load_robot
from tolerances import IDENTITY

TESTS, CONFIGS = Path(__file__).parents[2], Path(__file__).parents[3] / "configs"
FOLDING = """<mujoco><worldbody><body name="base"><geom size="0.1"/>
 <body name="upper" pos="0 0 0.2"><joint name="lift" axis="0 1 0"/>
  <geom type="capsule" fromto="0 0 0.2 0 0 0.9" size="0.05"/>
  <body name="fore" pos="0 0 1"><joint name="bend" axis="0 1 0"/>
   <geom type="capsule" fromto="0 0 0.2 0 0 1.15" size="0.05"/>
  </body></body></body></worldbody></mujoco>"""


@pytest.fixture(scope="module")
def arm():
    return load_robot(TESTS / "stages" / "arm.yaml").to_robot()


def test_the_points_are_those_of_the_arm(arm):
    turn, lift = 0.3, 0.4
    found = points(arm, np.array([[turn, lift]]))[0]
    out = np.array([np.cos(turn), np.sin(turn)])
    tip = 0.1 + 0.8 * np.cos(lift)
    np.testing.assert_allclose(found[-1], [*(out * tip), 0.4 + 0.8 * np.sin(lift)], rtol=IDENTITY)
    np.testing.assert_allclose(found[1], [*(out * 0.1), 0.4], rtol=IDENTITY)


def test_the_floor_is_told_with_how_far_below_it_the_arm_goes(arm):
    down, level = [0.0, np.deg2rad(-60)], [0.0, 0.0]
    problems = Reach(arm, floor_m=0.0).problems(np.array([down, level]))
    assert problems == ["it reaches 293 mm below the floor", ""]
    assert 1e3 * (0.8 * np.sin(np.deg2rad(60)) - 0.4) == pytest.approx(293, abs=0.5)
    assert Reach(arm).problems(np.array([down, level])) == ["", ""]


def test_joint_limits_are_part_of_the_reach(arm):
    problems = Reach(arm).problems(np.deg2rad([[151, 0], [0, 99]]))
    assert problems == ["joint `turn` at 151 deg moves from -150 to 150 deg", ""]


def test_an_arm_that_folds_into_itself_is_named(tmp_path):
    path = tmp_path / "folding.xml"
    path.write_text(FOLDING)
    shapes = Shapes(path, ["lift", "bend"], {})
    assert shapes.touching(np.array([0.0, 1.0])) == ""
    assert shapes.touching(np.array([0.0, np.pi - 0.05])) == "`base` and `fore` touch"


def test_mirrored_configurations_take_the_payload_to_the_other_side():
    robot = load_robot(CONFIGS / "robots" / "kr300.yaml").to_robot()
    angles = np.deg2rad([[30, -70, 50, 40, -60, 80], [-100, -20, 10, 170, 30, -5]])
    mirrored = mirror(robot, angles)
    payload, image = points(robot, angles)[:, -1], points(robot, mirrored)[:, -1]
    np.testing.assert_allclose(image, payload * [1, -1, 1], atol=1e-12)
    assert np.abs(payload[:, 1]).min() > 0.1
    np.testing.assert_allclose(mirror(robot, mirrored), angles, rtol=IDENTITY)


def test_a_robot_with_a_slanted_axis_has_no_mirror_image():
    robot = load_robot(CONFIGS / "robots" / "kr300.yaml")
    slanted = robot.model_copy(update={"base_rpy_deg": (150.0, 0.0, 0.0)}).to_robot()
    with pytest.raises(DataError, match=r"`axis_1`.*no mirror image"):
        mirror(slanted, np.zeros((1, 6)))


def test_shapes_of_a_urdf_ask_for_no_masses_and_no_meshes(tmp_path):
    def link(name, mass, shape):
        inertia = '<inertia ixx="1" iyy="1" izz="9" ixy="0" ixz="0" iyz="0"/>'
        inertial = f'<inertial><mass value="{mass}"/>{inertia}</inertial>'
        return f'<link name="{name}">{inertial}<collision><geometry>{shape}</geometry></collision></link>'

    def joint(name, parent, child, kind="revolute"):
        ends = f'<parent link="{parent}"/><child link="{child}"/><origin xyz="0 0 0.5"/><axis xyz="0 1 0"/>'
        return f'<joint name="{name}" type="{kind}">{ends}<limit lower="-3" upper="3" effort="1" velocity="1"/></joint>'

    parts = [
        link("base", 0, '<box size="0.2 0.2 0.2"/>'),
        link("arm", 0, '<mesh filename="package://absent/arm.dae"/>'),
        link("tip", 1, '<sphere radius="0.1"/>'),
        joint("lift", "base", "arm"),
        joint("bend", "arm", "tip"),
    ]
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="r">{"".join(parts)}</robot>')
    shapes = Shapes(path, ["lift"], {"bend": 0.2})
    assert shapes.touching(np.array([0.0])) == ""
    assert "`tip`" in shapes.touching(np.array([np.pi]))
