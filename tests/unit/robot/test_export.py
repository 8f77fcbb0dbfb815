"""MJCF text: what is read back is the model that was written."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from exact_systems import arm_on_rail, two_joint_robot, without_spring
from robid.robot.export import to_mjcf
from robid.robot.friction import LUGRE, Friction
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model

CONFIGURATIONS = np.array([[0.3, -0.7], [-0.5, 0.9]])
FIELDS = [
    "body_pos",
    "body_mass",
    "body_ipos",
    "body_inertia",
    "jnt_axis",
    "jnt_stiffness",
    "jnt_stiffnesspoly",
    "dof_damping",
    "tendon_stiffness",
    "tendon_stiffnesspoly",
    "tendon_damping",
    "wrap_prm",
    "actuator_gainprm",
    "actuator_biasprm",
    "actuator_dynprm",
    "key_qpos",
    "key_ctrl",
]


def full_robot():
    """Every number with many digits, cubic springs, friction and ripple with a phase."""
    robot = two_joint_robot()
    springs = tuple(replace(s, stiffness=s.stiffness / 3, cubic=1e6 / 7) for s in robot.springs)
    joints = tuple(
        replace(joint, motor=replace(joint.motor, friction=friction, ripple_nm=0.1 / 3, ripple_phase_rad=phase))
        for joint, friction, phase in zip(
            robot.joints, (Friction(1e-3 / 3, 0.1 / 3, 0.04, 2.0, 0.03), Friction()), (0.7, -2.0 / 3), strict=True
        )
    )
    return replace(robot, name='two <joints> & "springs"', springs=springs, joints=joints)


@pytest.fixture(scope="module", params=[False, True], ids=["linear", "friction and ripple"])
def written(request):
    model = build_model(full_robot(), friction=LUGRE if request.param else None, ripple=request.param, timestep_s=5e-4)
    rest = solve_statics(model, CONFIGURATIONS)
    return model, rest, to_mjcf(model, rest, ("first", "second"), "first line\n  -- second line")


@pytest.mark.parametrize("field", FIELDS)
def test_numbers_keep_twelve_digits(written, field):
    model, rest, text = written
    found = getattr(mujoco.MjModel.from_xml_string(text), field)
    wanted = {"key_qpos": rest.position, "key_ctrl": rest.motor_torque}.get(field, getattr(model.mujoco, field, None))
    np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-12 * np.abs(wanted).max(initial=0.0))


@pytest.mark.parametrize("field", ["dof_armature", "dof_damping", "actuator_gear", "jnt_type", "jnt_axis", "wrap_prm"])
def test_numbers_of_rigid_and_sliding_joints_keep_twelve_digits(field):
    robot = without_spring(arm_on_rail(), "gear_rail")
    motor = replace(robot.joints[0].motor, inertia_kgm2=2e-3 / 7, gear_ratio=-2000 / 3)
    robot = replace(robot, joints=(replace(robot.joints[0], motor=motor), *robot.joints[1:]))
    model = build_model(robot)
    rest = solve_statics(model, np.array([[0.5, 0.4, -0.9]]))
    found = mujoco.MjModel.from_xml_string(to_mjcf(model, rest, ("rest",), ""))
    np.testing.assert_allclose(getattr(found, field), getattr(model.mujoco, field), rtol=1e-11)


def test_orientations_and_options(written):
    model, _, text = written
    found = mujoco.MjModel.from_xml_string(text)
    for field in ("body_quat", "body_iquat"):
        same = np.abs((getattr(found, field) * getattr(model.mujoco, field)).sum(axis=1))
        np.testing.assert_allclose(same, 1.0, rtol=1e-11)
    assert found.opt.timestep == 5e-4
    assert found.opt.integrator == mujoco.mjtIntegrator.mjINT_RK4
    assert found.opt.disableflags == model.mujoco.opt.disableflags
    assert [found.joint(i).name for i in range(found.njnt)] == [
        model.mujoco.joint(i).name for i in range(model.mujoco.njnt)
    ]
    assert [found.actuator(i).name for i in range(found.nactuator)] == [
        model.mujoco.actuator(i).name for i in range(model.mujoco.nactuator)
    ]


def test_keyframes_are_at_rest(written):
    _, _, text = written
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    for name in ("first", "second"):
        mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
        torque = data.ctrl.copy()
        mujoco.mj_forward(model, data)
        held = data.qfrc_passive + data.qfrc_actuator - data.qfrc_bias
        ripple = 0.1 / 3 if model.na else 0.0
        assert np.abs(held).max() < ripple + 1e-7 * np.abs(data.qfrc_bias).max()
        assert np.abs(torque).max() > 0.1


def test_the_same_motion_after_reading(written):
    model, rest, text = written
    ends = []
    for mjmodel in (model.mujoco, mujoco.MjModel.from_xml_string(text)):
        data = mujoco.MjData(mjmodel)
        data.qpos[:], data.ctrl[:] = rest.position[0], rest.motor_torque[0] + 0.3
        for _ in range(200):
            mujoco.mj_step(mjmodel, data)
        ends.append(data.qpos - rest.position[0])
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-6, atol=1e-9)
    assert np.abs(ends[0]).max() > 0.1


def test_the_header_is_a_comment(written):
    _, _, text = written
    lines = text.splitlines()
    assert lines[0].startswith("<mujoco model=")
    assert lines[1:5] == ["  <!--", "    first line", "      - - second line", "  -->"]
    spec = mujoco.MjSpec.from_string(text)
    assert spec.modelname == 'two <joints> & "springs"'


def test_the_model_is_left_as_it_was(written):
    model, _, _ = written
    assert len(model.spec.keys) == 0
