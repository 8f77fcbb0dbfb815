"""Rigid MJCF and URDF files become the same robot: checked against MuJoCo's own model of the file."""

import mujoco
import numpy as np
import pytest

from robid.errors import DataError
from robid.robot.chain import extract_chain, frame_on_last, order_of
from robid.robot.foreign import read_model

# Tilted axes, joint references, welded and locked bodies, an anchor off the body's origin, a mesh that is not there.
AWKWARD = """
<mujoco>
  <compiler angle="radian" autolimits="true"/>
  <asset><mesh name="shell" file="absent.stl"/></asset>
  <worldbody>
    <body name="base" pos="0.1 0.2 0.3" quat="1 0.2 -0.3 0.1">
      <inertial mass="5" pos="0 0 0.1" diaginertia="0.1 0.1 0.1"/>
      <geom type="mesh" mesh="shell"/>
      <body name="mount" pos="0 0 0.2" euler="0.4 0 0">
        <body name="upper" pos="0 0.1 0.2" euler="0.3 -0.2 0.5">
          <inertial mass="6" pos="0.1 0 0.2" fullinertia="0.2 0.3 0.25 0.02 -0.01 0.03"/>
          <joint name="turn" axis="0.3 -1 0.5" pos="0.02 -0.03 0.01" range="-2 2" ref="0.4" damping="3" armature="0.1"/>
          <geom type="mesh" mesh="shell"/>
          <body name="cover" pos="0.2 0 0" euler="0 0.7 0">
            <inertial mass="1.5" pos="0 0.05 0" diaginertia="0.02 0.03 0.04"/>
          </body>
          <body name="lower" pos="0.5 0 0.1" euler="0 1.2 0.1">
            <inertial mass="3" pos="0.2 0.02 0" diaginertia="0.02 0.1 0.11"/>
            <joint name="lift" axis="0 0 -1" frictionloss="2"/>
            <body name="tool" pos="0.4 0 0" euler="0.2 0.1 0">
              <inertial mass="0.8" pos="0 0 0.1" diaginertia="0.004 0.004 0.002"/>
              <site name="tip" pos="0 0 0.2" euler="0 0.5 0"/>
              <body name="finger" pos="0 0.05 0.15">
                <inertial mass="0.2" pos="0 0 0.05" diaginertia="0.0004 0.0004 0.0002"/>
                <joint name="grip" axis="1 0 0" range="0 1"/>
              </body>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator><motor name="m" joint="turn" gear="50" ctrlrange="-2 2"/></actuator>
  <keyframe><key name="home" qpos="0 0 0"/></keyframe>
</mujoco>
"""
MODELS = [
    *(f"mjcf_meshfree/{name}.xml" for name in ("ur5e", "iiwa14", "panda_nohand", "xarm7_nohand")),
    *(
        f"urdf_meshfree/{name}.urdf"
        for name in ("kuka_kr210_r2700_2", "kuka_lbr_iisy3_r760", "staubli_tx60", "abb_irb1200_5_90")
    ),
]


def rigid(chain):
    """The chain as a MuJoCo model of its own."""
    spec = mujoco.MjSpec()
    parent = spec.worldbody
    for joint in chain:
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, joint.rotation.ravel())
        parent = parent.add_body(name=joint.name, pos=joint.position_m, quat=quaternion)
        parent.add_joint(name=joint.name, axis=[0, 0, 1], type=mujoco.mjtJoint.mjJNT_HINGE)
        tensor = joint.link.inertia_kgm2
        parent.explicitinertial, parent.mass, parent.ipos = True, joint.link.mass_kg, joint.link.com_m
        parent.fullinertia = [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]
    return spec.compile()


def inertia_and_gravity(model, angles, locked=None):
    """Inertia matrix and gravity torques of the joints in `angles`, others held."""
    data = mujoco.MjData(model)
    data.qpos[:] = 0
    for name, angle in {**angles, **(locked or {})}.items():
        data.qpos[model.joint(name).qposadr[0]] = angle
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    rows = [model.joint(name).dofadr[0] for name in angles]
    return mass[np.ix_(rows, rows)], data.qfrc_bias[rows]


def write(folder, text, name="robot.xml"):
    path = folder / name
    path.write_text(text)
    return path


def test_an_awkward_file_keeps_inertia_and_gravity_at_every_angle(tmp_path):
    model = read_model(write(tmp_path, AWKWARD))
    bare = AWKWARD.replace('<geom type="mesh" mesh="shell"/>', "").replace(' file="absent.stl"', "")
    bare = bare.replace('<mesh name="shell"/>', "").replace(' armature="0.1"', "")
    original, locked = mujoco.MjModel.from_xml_string(bare), {"grip": 0.7}
    chain = extract_chain(model, ["turn", "lift"], locked)
    ours = rigid(chain)
    for angles in np.random.default_rng(1).uniform(-2, 2, (6, 2)):
        named = dict(zip(("turn", "lift"), angles.tolist(), strict=True))
        mass, gravity = inertia_and_gravity(ours, named)
        wanted_mass, wanted_gravity = inertia_and_gravity(original, named, locked)
        np.testing.assert_allclose(mass, wanted_mass, rtol=1e-10)
        np.testing.assert_allclose(gravity, wanted_gravity, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(sum(joint.link.mass_kg for joint in chain), 6 + 1.5 + 3 + 0.8 + 0.2)
    assert chain[0].range == (-2, 2)
    assert chain[1].range is None


def test_the_tool_frame_is_where_the_file_has_it(tmp_path):
    model = read_model(write(tmp_path, AWKWARD))
    position, rotation = frame_on_last(model, ["turn", "lift"], {}, "tip")
    compiled = model.compiled
    data = mujoco.MjData(compiled)
    data.qpos[:] = [0.3, -0.8, 0]
    mujoco.mj_kinematics(compiled, data)
    body = data.body("lower")
    np.testing.assert_allclose(body.xpos + body.xmat.reshape(3, 3) @ position, data.site("tip").xpos, atol=1e-12)
    np.testing.assert_allclose(body.xmat.reshape(3, 3) @ rotation, data.site("tip").xmat.reshape(3, 3), atol=1e-12)
    assert frame_on_last(model, ["turn", "lift"], {}, "upper") is None
    assert frame_on_last(model, ["turn", "lift"], {}, "nowhere") is None


def test_what_cannot_stay_is_listed_and_limits_are_kept(tmp_path):
    model = read_model(write(tmp_path, AWKWARD))
    told = "\n".join(model.notes)
    for words in (
        "1 keyframe left out (home)",
        "1 actuator left out (m)",
        "damping of joints left out (turn)",
        "frictionloss of joints left out (lift)",
        "armature of joints left out (turn)",
        "2 shapes and their contacts left out",
    ):
        assert f"robot.xml: {words}" in told
    assert model.torque == {"turn": 100.0}
    assert not model.compiled.dof_damping.any()
    assert not model.compiled.dof_armature.any()
    assert not model.compiled.dof_frictionloss.any()


def test_a_body_without_inertial_weighs_what_its_geometry_does(tmp_path):
    ball = '<body><joint name="a"/><geom type="sphere" size="0.1" density="1000"/></body>'
    text = f"<mujoco><worldbody>{ball}</worldbody></mujoco>"
    model = read_model(write(tmp_path, text))
    (joint,) = extract_chain(model, ["a"], {})
    np.testing.assert_allclose(joint.link.mass_kg, 4 / 3 * np.pi * 0.1**3 * 1000)
    assert "taken from geometry" in model.notes[0]


def test_order_and_branches_are_told(tmp_path):
    model = read_model(write(tmp_path, AWKWARD))
    assert order_of(model, ["turn", "lift", "grip"]) == []
    assert "`turn` is listed after lift, but in the file it follows the base" in order_of(model, ["lift", "turn"])[1]
    text = AWKWARD.replace('<joint name="lift"', '<joint name="second" axis="1 0 0"/><joint name="lift"')
    assert "move the same body" in order_of(read_model(write(tmp_path, text)), ["turn", "second", "lift"])[0]


def test_a_urdf_takes_no_mass_from_its_shapes(tmp_path):
    text = """<robot name="r"><link name="base"/>
      <link name="arm"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
      <joint name="a" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
      <limit lower="-1" upper="1" effort="30" velocity="2"/></joint>
      <link name="tip"/><joint name="weld" type="fixed"><parent link="arm"/><child link="tip"/></joint></robot>"""
    model = read_model(write(tmp_path, text, "r.urdf"))
    assert model.weights.mass_kg.sum() == 0
    assert model.fixed == ("weld",)
    assert (model.speed, model.torque) == ({"a": 2.0}, {"a": 30.0})


@pytest.mark.parametrize("text", ["no xml", "<mujoco><worldbody><body/><oops/></worldbody></mujoco>"])
def test_what_is_no_robot_is_refused_by_name(tmp_path, text):
    with pytest.raises(DataError, match="D201") as caught:
        read_model(write(tmp_path, text))
    assert caught.value.where.endswith("robot.xml")


@pytest.mark.parametrize("name", MODELS)
def test_inertia_and_gravity_of_public_robots_are_those_of_pinocchio(data_folder, name):
    pin = pytest.importorskip("pinocchio", reason="Pinocchio (`pin`) is not installed")
    path = data_folder("robot_models") / name
    model = read_model(path)
    ours = rigid(extract_chain(model, model.hinges, {}))
    build = pin.buildModelFromMJCF if path.suffix == ".xml" else pin.buildModelFromUrdf
    theirs = build(str(path))
    theirs.armature = np.zeros(theirs.nv)
    assert list(theirs.names)[1:] == list(model.hinges)
    data = theirs.createData()
    for angles in np.random.default_rng(2).uniform(-2, 2, (4, theirs.nv)):
        mass, gravity = inertia_and_gravity(ours, dict(zip(model.hinges, angles.tolist(), strict=True)))
        wanted = pin.crba(theirs, data, angles)
        wanted = np.triu(wanted) + np.triu(wanted, 1).T
        np.testing.assert_allclose(mass, wanted, atol=1e-6 * np.abs(wanted).max())
        torque = pin.computeGeneralizedGravity(theirs, data, angles)
        np.testing.assert_allclose(gravity, torque, atol=1e-6 * np.abs(torque).max())
