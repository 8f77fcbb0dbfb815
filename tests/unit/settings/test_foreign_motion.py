"""What of a rigid model moves, is held, or follows: mobile robots with two arms, followers, closed loops."""

import re

import numpy as np
import pytest

from mobile_robot import ARM, mobile_robot, robot_file
from robid.errors import SettingsError
from robid.settings.load import load_robot

LEFT, RIGHT = (tuple(f"{side}_{name}" for name in ARM) for side in ("left", "right"))


def written(folder, joints, more="", model=None):
    (folder / "butler.urdf").write_text(mobile_robot() if model is None else model)
    (folder / "robot.yaml").write_text(robot_file(joints, more))
    return folder / "robot.yaml"


def refused(path):
    with pytest.raises(SettingsError) as caught:
        load_robot(path)
    return caught.value.what.splitlines()


def test_all_joints_off_the_chain_are_told_in_one_message_and_held_by_one_word(tmp_path):
    (told,) = refused(written(tmp_path, ("lift", *RIGHT)))
    others = ("wheel_left", "roller_right", "pan", "tilt", "mast", *LEFT, "left_finger", "right_finger")
    assert all(f"`{name}`" in told for name in others)
    assert "`lift`" not in told
    remedy = re.search(r"`(locked: \w+)`", told)[1]
    robot = load_robot(written(tmp_path, ("lift", *RIGHT), remedy)).to_robot()
    assert [joint.name for joint in robot.joints] == ["lift", *RIGHT]
    notes = "\n".join(robot.notes)
    assert "left_shoulder 0 deg" in notes
    assert "right_thumb 0.01 m" in notes


def test_what_is_at_rest_beyond_its_limits_is_in_their_middle(tmp_path):
    robot = load_robot(written(tmp_path, RIGHT, "locked: rest"))
    assert robot.locked_m["lift"] == pytest.approx(0.25)
    still = load_robot(written(tmp_path, RIGHT, "locked: rest\nlocked_m: {lift: 0.05}"))
    difference = robot.to_robot().joints[0].position_m - still.to_robot().joints[0].position_m
    np.testing.assert_allclose(difference, [0, 0, 0.2], atol=1e-12)


def test_joints_of_both_arms_are_told_with_what_to_do(tmp_path):
    told = refused(written(tmp_path, (*LEFT, *RIGHT), "locked: rest"))
    assert len(told) == 1
    assert all(f"`{name}`" in told[0] for name in RIGHT)
    assert "different branches" in told[0]
    load_robot(written(tmp_path, LEFT, "locked: rest"))


@pytest.mark.parametrize("joints", [("lift", *RIGHT), LEFT])
def test_a_mobile_robot_with_two_arms_is_that_of_pinocchio(tmp_path, joints):
    pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")
    file = load_robot(written(tmp_path, joints, "locked: rest\nlocked_deg: {left_shoulder: 20, pan: 30}"
                              if joints != LEFT else "locked: rest"))  # fmt: skip
    robot = file.to_robot()
    whole = pin.buildModelFromUrdf(str(tmp_path / "butler.urdf"))
    at_rest = pin.neutral(whole)
    for name, position in file.held.items():
        index = whole.joints[whole.getJointId(name)]
        value = [np.cos(position), np.sin(position)] if index.nq == 2 else [position]
        at_rest[index.idx_q : index.idx_q + index.nq] = value
    theirs = pin.buildReducedModel(whole, [whole.getJointId(n) for n in whole.names[1:] if n not in joints], at_rest)
    data = theirs.createData()
    for positions in np.random.default_rng(2).uniform(0, 0.4, (3, len(joints))):
        torque = pin.computeGeneralizedGravity(theirs, data, positions)
        np.testing.assert_allclose(_gravity(robot, positions), torque, atol=1e-6 * np.abs(torque).max())
    assert theirs.nv == len(joints)


def _gravity(robot, positions):
    """Gravity torques (n_joint,) of rigid links, from where their centres of mass are."""
    place, turn, frames = np.zeros(3), np.eye(3), []
    for joint, position in zip(robot.joints, positions, strict=True):
        place, turn = place + turn @ joint.position_m, turn @ joint.rotation
        if joint.type == "prismatic":
            place = place + position * turn[:, 2]
        else:
            c, s = np.cos(position), np.sin(position)
            turn = turn @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        frames.append((place, turn))
    torques = np.zeros(len(robot.joints))
    for index, joint in enumerate(robot.joints):
        origin, axis = frames[index][0], frames[index][1][:, 2]
        for beyond in range(index, len(robot.joints)):
            link = robot.joints[beyond].link
            weight = link.mass_kg * robot.gravity_m_s2
            arm = frames[beyond][0] + frames[beyond][1] @ link.com_m - origin
            torques[index] -= axis @ weight if joint.type == "prismatic" else axis @ np.cross(arm, weight)
    return torques


def test_links_that_do_not_move_may_have_anything(tmp_path):
    model = mobile_robot().replace(
        '<link name="chassis_link"><inertial>', '<link name="chassis_link"><inertial><!-- -->'
    )
    model = model.replace('<mass value="80"/>', '<mass value="0"/>').replace(
        '<mass value="4"/>', '<mass value="much"/>'
    )
    load_robot(written(tmp_path, RIGHT, "locked: rest", model))


def test_links_that_move_are_all_told_in_one_round(tmp_path):
    model = mobile_robot()
    for old, new in (('<mass value="6"/>', '<mass value="0"/>'), ('<mass value="3"/>', '<mass value="3,1"/>')):
        assert old in model
        model = model.replace(old, new)
    model = re.sub(r'(<link name="right_upper_link">.*?izz=)"[^"]*"', r'\1"9"', model)
    told = refused(written(tmp_path, RIGHT, "locked: rest", model))
    links = ("right_shoulder_link", "right_elbow_link", "right_upper_link")
    assert all(sum(f"`{link}`" in line for line in told) == 1 for link in links)
    assert len(told) == len(links)


def test_an_unreadable_model_leads_to_no_message_about_what_it_would_have_said(tmp_path):
    model = mobile_robot().replace('<parent link="chassis_link"/>', '<parent link="chasis_link"/>', 1)
    text = robot_file(("lift", *RIGHT)).replace("type: prismatic, ", "")
    path = written(tmp_path, (), "", model)
    path.write_text(text)
    (told,) = refused(path)
    assert "chasis_link" in told
    path = written(tmp_path, (), "")
    path.write_text(text + "locked: rest\n")
    (told,) = refused(path)
    assert "joints[1].type" in told


FLOATING = """<mujoco>
  <worldbody><body name="trunk" pos="0 0 0.5" quat="0.8 0.6 0 0"><freejoint/>
    <inertial pos="0 0 0" mass="9" diaginertia="1 1 1"/>
    <body name="arm" pos="0.1 0 0.2"><joint name="lift" axis="0 1 0" range="{range}"/>
      <inertial pos="0.2 0 0" mass="2" diaginertia="0.01 0.1 0.1"/>
      <body name="hand" pos="0.4 0 0"><joint name="bend" axis="0 1 0" range="{range}"/>
        <inertial pos="0.1 0 0" mass="1" diaginertia="0.01 0.02 0.02"/>
        <body name="cup" pos="0.2 0 0"><joint name="hang" type="ball"/>
          <inertial pos="0 0 -0.1" mass="0.3" diaginertia="0.001 0.001 0.001"/></body></body></body>
  </body></worldbody>
</mujoco>"""


def floating(folder, limits="-90 90", more="locked: rest"):
    path = written(folder, ("lift", "bend"), more, FLOATING.format(range=limits))
    path.write_text(
        path.read_text().replace("type: prismatic, ", "").replace("gear_ratio_rad_m: 600", "gear_ratio: 90")
    )
    return path


def test_free_and_ball_joints_rest_where_the_file_has_them(tmp_path):
    (told,) = refused(floating(tmp_path, more=""))
    assert "`joint_of_trunk` (neither hinge nor slide)" in told
    assert "`hang`" in told
    robot = load_robot(floating(tmp_path)).to_robot()
    # The trunk is turned about x by 2 atan(3/4): the arm's y axis leans, and the cup hangs on in the hand's frame.
    turn = np.array([[1, 0, 0], [0, 0.28, -0.96], [0, 0.96, 0.28]])
    np.testing.assert_allclose(robot.joints[0].position_m, [0, 0, 0.5] + turn @ [0.1, 0, 0.2], atol=1e-12)
    np.testing.assert_allclose(robot.joints[0].rotation[:, 2], turn[:, 1], atol=1e-12)
    assert robot.joints[1].link.mass_kg == pytest.approx(1.3)


def with_option(path, option):
    """The floating robot with another gravity in its model."""
    model = path.with_name("butler.urdf")
    line = f"<option>{option}</option>" if option.startswith("<") else f"<option {option}/>"
    model.write_text(model.read_text().replace("<worldbody>", f"{line}<worldbody>"))
    return path


@pytest.mark.parametrize("option", ['gravity="0 0 0"', '<flag gravity="disable"/>', 'gravity="0 0 -1.62"'])
def test_gravity_that_no_robot_on_earth_feels_is_asked_for(tmp_path, option):
    (told,) = refused(with_option(floating(tmp_path), option))
    assert "gravity_m_s2" in told
    path = with_option(floating(tmp_path, more="locked: rest\ngravity_m_s2: [0, 0, -9.81]"), option)
    np.testing.assert_array_equal(load_robot(path).to_robot().gravity_m_s2, [0, 0, -9.81])


def test_a_mounting_that_is_stated_twice_is_asked_for(tmp_path):
    turned = 'gravity="9.81 0 0"'
    assert load_robot(with_option(floating(tmp_path), turned)).gravity_m_s2 == (9.81, 0, 0)
    (told,) = refused(with_option(floating(tmp_path, more="locked: rest\nbase_rpy_deg: [0, 90, 0]"), turned))
    assert "base_rpy_deg" in told
    more = "locked: rest\nbase_rpy_deg: [0, 90, 0]\ngravity_m_s2: [0, 0, -9.81]"
    assert load_robot(with_option(floating(tmp_path, more=more), turned)).gravity_m_s2 == (0, 0, -9.81)


def test_radians_that_are_read_as_degrees_are_told(tmp_path):
    (told,) = refused(floating(tmp_path, "-1.5 3.1"))
    assert "S314" in told
    model = (tmp_path / "butler.urdf").read_text().replace("<mujoco>", '<mujoco><compiler angle="radian"/>')
    (tmp_path / "butler.urdf").write_text(model)
    assert load_robot(tmp_path / "robot.yaml").to_robot().joints[0].upper == pytest.approx(3.1)
    model = mobile_robot().replace('lower="-2" upper="2"', 'lower="-170" upper="170"')
    told = refused(written(tmp_path, RIGHT, "locked: rest", model))
    assert len(told) == len(RIGHT)
    assert "degrees are read as radians" in told[0]


def test_positions_of_locked_joints_that_cannot_be(tmp_path):
    more = "locked: rest\nlocked_deg: {left_upper: 170}\nlocked_m: {right_thumb: 0.03, lift: 0.4}"
    told = "\n".join(refused(written(tmp_path, RIGHT, more)))
    assert "locked_deg.left_upper: 170 deg lies outside the limits" in told
    assert "locked_m.right_thumb: `right_thumb` follows `right_finger`, which puts it at 0.01 m" in told
    assert "lift" not in told
