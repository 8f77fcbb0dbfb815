"""Joints that follow others: the loop links that a refusal tells give the dynamics of the file's own tree."""

import re

import mujoco
import numpy as np
import pytest

from arm_regressor import arm_columns
from robid.errors import SettingsError
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot

BARE = RigidOptions(friction="none", offsets=False, motor_inertias=False, couplings=False)
# A wrist that follows the elbow, a plate that follows the wrist, and a crank on the base that follows the shoulder.
TREE = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="post" pos="0 0 0.4" euler="0.1 0 0.3">
      <inertial pos="0.1 0 0.1" mass="9" fullinertia="0.3 0.4 0.2 0.01 0 0.02"/>
      <joint name="shoulder" axis="0.1 1 0" pos="0 0.02 0" range="-1 1" ref="0.2"/>
      <body name="beam" pos="0 0 0.6">
        <inertial pos="0.2 0 0" mass="5" fullinertia="0.05 0.2 0.2 0 0.01 0"/>
        <joint name="elbow" axis="0 1 0" range="-1 1"/>
        <body name="hand" pos="0.5 0 0" euler="0 0.4 0.2">
          <inertial pos="0.1 0 -0.1" mass="3" fullinertia="0.03 0.05 0.04 0 0 0.005"/>
          <joint name="level" axis="0 -1 0.2" pos="0.01 0 0" ref="-0.1"/>
          <body name="plate" pos="0.1 0.1 0">
            <inertial pos="0.05 0 0" mass="1" diaginertia="0.01 0.02 0.02"/>
            <joint name="turn" axis="0 0 1"/>
            <body name="cap" pos="0 0.1 0.1"><inertial pos="0 0 0" mass="0.5" diaginertia="0.001 0.001 0.001"/></body>
          </body>
        </body>
      </body>
    </body>
    <body name="crank" pos="0.3 0.2 0.4" euler="0.5 0 0">
      <inertial pos="0.2 0 0" mass="2" diaginertia="0.01 0.05 0.05"/>
      <joint name="crank" axis="0 1 0"/>
    </body>
  </worldbody>
  <equality>
    <joint joint1="level" joint2="elbow" polycoef="0.3 -1.5 0 0 0"/>
    <joint joint1="turn" joint2="level" polycoef="0.1 0.5 0 0 0"/>
    <joint joint1="crank" joint2="shoulder" polycoef="0 1 0 0 0"/>
  </equality>
</mujoco>"""
JOINTS = ("shoulder", "elbow")


def written(folder, model=TREE, more="", joints=JOINTS):
    (folder / "arm.xml").write_text(model)
    lines = [f"- {{name: {n}, rigid: true, motor: {{inertia_kgm2: 2.0e-4, gear_ratio: 100}}}}" for n in joints]
    text = ["schema_version: 1", "name: arm", "model: arm.xml", "joints:", *lines, more]
    (folder / "robot.yaml").write_text("\n".join(text) + "\n")
    return folder / "robot.yaml"


def refused(path):
    with pytest.raises(SettingsError) as caught:
        load_robot(path)
    return caught.value.what.splitlines()


def remedy(told):
    return re.search(r"`(loop_links: \[.*?\}\])`", told)[1]


def torques(robot, motion):
    """Torques (n_joint,) at the arm side, of position, velocity and acceleration."""
    rows = [np.array(part)[None] for part in motion]
    return (arm_columns(robot, *rows) @ build_rigid_model(robot, BARE).nominal)[0]


def law(positions):
    """Positions (n_joint,) of all joints of the tree, in its order, by those of the chain, and their derivative."""
    shoulder, elbow = positions
    level = -0.1 + 0.3 - 1.5 * elbow
    turn = 0.1 + 0.5 * (level + 0.1)
    return np.array([shoulder, elbow, level, turn, shoulder - 0.2])


SPEEDS = np.array([[1, 0], [0, 1], [0, -1.5], [0, -0.75], [1, 0]])


def wanted(positions, velocities, accelerations):
    """Torques of the file's own tree, projected by the followers' laws."""
    bare = mujoco.MjSpec.from_string(TREE)
    for equality in list(bare.equalities):
        bare.delete(equality)
    model = bare.compile()
    data = mujoco.MjData(model)
    data.qpos, data.qvel, data.qacc = law(positions), SPEEDS @ velocities, SPEEDS @ accelerations
    mujoco.mj_inverse(model, data)
    # Limits are not reached and nothing rubs: the inverse dynamics are those of the bodies alone.
    return SPEEDS.T @ data.qfrc_inverse


LEVEL = '<joint joint1="level" joint2="elbow" polycoef="0.3 -1.5 0 0 0"/>'
# The same law with the joints in the other order: level + 0.1 = 0.3 - 1.5 elbow.
TURNED = f'<joint joint1="elbow" joint2="level" polycoef="0.2 {-1 / 1.5:.17g} 0 0 0"/>'


@pytest.mark.parametrize("law_of_level", [LEVEL, TURNED])
def test_the_loop_links_that_are_told_move_like_the_tree(tmp_path, law_of_level):
    tree = TREE.replace(LEVEL, law_of_level)
    (told,) = refused(written(tmp_path, tree))
    for name in ("`level`", "`turn`", "`crank`", "`elbow`", "`shoulder`"):
        assert name in told
    robot = load_robot(written(tmp_path, tree, remedy(told))).to_robot()
    rng = np.random.default_rng(3)
    for _ in range(4):
        motion = rng.uniform(-1, 1, (3, 2))
        np.testing.assert_allclose(torques(robot, motion), wanted(*motion), rtol=1e-6, atol=1e-6)


def test_a_follower_that_carries_the_next_joint_or_is_not_linear_has_no_remedy_that_does_not_work(tmp_path):
    curved = TREE.replace("0.3 -1.5 0 0 0", "0.3 -1.5 0.2 0 0")
    told = "\n".join(refused(written(tmp_path, curved)))
    assert "`level`" in told
    assert "not linear" in told
    free = TREE.replace('joint1="turn"', 'active="false" joint1="turn"')
    carrying = refused(written(tmp_path, free, joints=(*JOINTS, "turn")))
    (told,) = (line for line in carrying if "`level`" in line)
    assert "carries `turn`" in told
    assert "S326" not in told


def test_a_joint_that_follows_is_not_driven_by_a_motor(tmp_path):
    told = "\n".join(refused(written(tmp_path, joints=(*JOINTS, "level"))))
    assert "joints[3].name: S323 joint `level` follows `elbow`" in told


def test_a_loop_link_that_turns_otherwise_than_the_model_is_refused(tmp_path):
    (told,) = refused(written(tmp_path))
    (found,) = refused(written(tmp_path, more=remedy(told).replace("turns: {elbow: -1.5}", "turns: {elbow: -1}")))
    assert "loop_links[1].turns" in found
    assert "-1.5" in found


CLOSED = """<mujoco>
  <worldbody>
    <body name="arm" pos="0 0 0.4"><inertial pos="0 0 0.4" mass="9" diaginertia="0.3 0.3 0.1"/>
      <joint name="lift" axis="0 1 0" range="-40 40"/>
      <body name="forearm" pos="0 0 0.8"><inertial pos="0.3 0 0" mass="4" diaginertia="0.02 0.1 0.1"/>
        <joint name="bend" axis="0 1 0" range="-40 40"/>
        <body name="jaw" pos="0.6 0 0"><inertial pos="0 0 0" mass="0.2" diaginertia="1e-4 1e-4 1e-4"/>
          <joint name="grip" type="slide" axis="0 1 0" range="0 0.02"/></body>
        <body name="nail" pos="0.6 0 0"><inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/>
          <joint name="pinch" type="slide" axis="0 -1 0"/></body>
      </body>
    </body>
    <body name="crank" pos="0 0 0.4"><inertial pos="-0.1 0 0" mass="2" diaginertia="0.01 0.05 0.05"/>
      <joint name="swing" axis="0 1 0"/>
      <body name="rod" pos="-0.2 0 0"><inertial pos="0 0 0.4" mass="1" diaginertia="0.05 0.05 0.01"/>
        <joint name="pivot" axis="0 1 0"/><site name="end" pos="0 0 0.8"/></body>
    </body>
    <body name="target" mocap="true"/>
  </worldbody>
  <tendon><fixed name="both"><joint joint="grip" coef="1"/><joint joint="pinch" coef="-1"/></fixed></tendon>
  <equality>
    <connect name="pin" body1="rod" body2="forearm" anchor="0 0 0.8"/>
    <weld name="drag" body1="target" body2="forearm"/>
    <tendon tendon1="both"/>
  </equality>
</mujoco>"""
CRANK = (
    "frame: {{position_m: {place}, rotation: [[1, 0, 0], [0, 0, 1], [0, -1, 0]]}}, turns: {turns}, link: {{mass_kg: 2,"
    " com_m: [-0.1, 0, 0], inertia_kgm2: {{xx: 0.05, yy: 0.05, zz: 0.05}}}}"
)


def test_a_closed_loop_is_refused_and_held_by_loop_links(tmp_path):
    told = "\n".join(refused(written(tmp_path, CLOSED, "locked: rest", ("lift", "bend"))))
    assert "`connect` pin" in told
    assert "`rod` and `forearm`" in told
    assert "drag" not in told
    assert "both" not in told
    crank = CRANK.format(place="[0, 0, 0.4]", turns="{lift: 1, bend: 1}")
    rod = CRANK.format(place="[-0.2, 0, 0]", turns="{bend: -1}").replace(
        "rotation: [[1, 0, 0], [0, 0, 1], [0, -1, 0]]", "rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]"
    )
    links = f"locked: rest\nloop_links:\n- {{name: swing, {crank}}}\n- {{name: pivot, parent: swing, {rod}}}"
    robot = load_robot(written(tmp_path, CLOSED, links, ("lift", "bend")))
    assert [round(joint.link.mass_kg, 12) for joint in robot.joints] == [9, 4.3]
    notes = "\n".join(robot.notes)
    assert "grip 0 m" in notes
    assert "tendon" in notes
