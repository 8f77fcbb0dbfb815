"""Prismatic and rigid joints: closed forms, limits, derivatives, and friction of motors that are part of their arms."""

from dataclasses import replace
from pathlib import Path

import mujoco
import numpy as np
import pytest

from exact_systems import arm_on_rail, linear_axis, two_joint_robot, without_spring
from robid.errors import DataError
from robid.robot.collocated import Collocated, has_plain_inertias, is_collocated
from robid.robot.derivatives import jacobian
from robid.robot.description import HarmonicBalance, LoopLink
from robid.robot.friction import LUGRE, Friction
from robid.robot.kinematics import skeleton
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.parameters import element_units
from robid.robot.reach import mirror
from robid.robot.response import nominal_parameters, response, with_values
from robid.settings.load import load_robot
from robid.simulate.options import Imperfections
from robid.simulate.truth import with_imperfections
from tolerances import FINITE_DIFFERENCE

FREQUENCY_HZ = np.array([1.3, 5.0, 11.0, 17.0, 29.0, 47.0, 60.0, 83.0])
RIGID_RAIL = without_spring(arm_on_rail(), "gear_rail")
RIGID_ELBOW = without_spring(two_joint_robot(), "gear_2")
GANTRY = load_robot(Path(__file__).parents[3] / "configs/robots/gantry.yaml").to_robot()
CASES = {
    "gantry": (GANTRY, np.array([[1.0, 0.9, -0.3], [2.0, -1.2, 0.1]])),
    "arm on a rail": (arm_on_rail(), np.array([[0.4, -0.3, 0.5], [1.2, 0.9, 1.2]])),
    "arm on a rigid rail": (RIGID_RAIL, np.array([[0.4, -0.3, 0.5], [1.2, 0.9, 1.2]])),
    "rigid elbow": (RIGID_ELBOW, np.array([[-0.3, 0.5], [0.9, 1.2]])),
}
KINDS = ("stiffness", "damping", "viscous", "arm_viscous", "motor_inertia", "link_inertia", "delay")


def linear_model(robot, configurations, outputs=None):
    model = build_model(robot)
    return linearize(model, solve_statics(model, configurations), outputs)


def response_of(robot, configurations, outputs=None):
    model = linear_model(robot, configurations, outputs)
    return response(model, nominal_parameters(robot, model, 0.0), FREQUENCY_HZ, None).sampled


@pytest.mark.parametrize("ratio", [-628.0, 40.0])
@pytest.mark.parametrize("upright", [False, True])
def test_linear_axis_in_closed_form(ratio, upright):
    rotor, mass, stiffness, damping, viscous = 2e-3, 80.0, 5e6, 3e3, 0.004
    robot = linear_axis(rotor, mass, stiffness, damping, ratio, viscous, upright)
    found = response_of(robot, np.array([[0.7]]), ("rail", "rail.arm"))[0, :, :, 0]
    s = 2j * np.pi * FREQUENCY_HZ
    spring = stiffness + s * damping
    travel = spring / ratio / (s**2 * mass + spring)  # m per motor radian
    wanted = s**2 / (s**2 * rotor + s * viscous + spring / ratio * (1 / ratio - travel))
    np.testing.assert_allclose(found[:, 0], wanted, rtol=1e-9)
    np.testing.assert_allclose(found[:, 1], wanted * travel, rtol=1e-9)


@pytest.mark.parametrize("ratio", [-628.0, 40.0])
def test_rigid_linear_axis_in_closed_form(ratio):
    robot = without_spring(linear_axis(ratio=ratio, upright=True), "gear_rail")
    found = response_of(robot, np.array([[0.7]]), ("rail", "rail.arm"))[0, :, :, 0]
    s = 2j * np.pi * FREQUENCY_HZ
    wanted = s / (s * (2e-3 + 80.0 / ratio**2) + 0.004)
    np.testing.assert_allclose(found[:, 0], wanted, rtol=1e-9)
    np.testing.assert_allclose(found[:, 1], wanted / ratio, rtol=1e-9)


@pytest.mark.parametrize("spring", ["gear_rail", ""])
def test_motor_holds_what_hangs_on_an_upright_axis(spring):
    robot = linear_axis(upright=True)
    robot = robot if spring else without_spring(robot, "gear_rail")
    rest = solve_statics(build_model(robot), np.array([[0.7]]))
    np.testing.assert_allclose(rest.motor_torque, [[80.0 * 9.81 / -628.0]], rtol=1e-9)
    if spring:
        np.testing.assert_allclose(rest.deflection, [[80.0 * 9.81 / 5e6]], rtol=1e-9)


@pytest.mark.parametrize(("elastic", "spring"), [(two_joint_robot(), "gear_2"), (arm_on_rail(), "gear_rail")])
def test_rigid_joint_is_the_limit_of_a_stiff_spring(elastic, spring):
    at = np.array([[0.4, -0.3, 0.5]])[:, -len(elastic.joints) :]
    names = tuple(joint.name for joint in elastic.joints)
    outputs = (*names, *(f"{name}.arm" for name in names))
    rigid = without_spring(elastic, spring)
    wanted, errors = response_of(rigid, at, outputs), []
    for factor in (1e4, 1e5, 1e6):
        springs = tuple(replace(s, stiffness=factor * s.stiffness) if s.name == spring else s for s in elastic.springs)
        errors.append(np.abs(response_of(replace(elastic, springs=springs), at, outputs) / wanted - 1).max())
    # What a spring gives way by falls with its stiffness.
    np.testing.assert_allclose(np.diff(np.log10(errors)), -1.0, atol=0.02)
    holding = [
        solve_statics(build_model(robot), at).motor_torque for robot in (rigid, replace(elastic, springs=springs))
    ]
    np.testing.assert_allclose(*holding, rtol=1e-6)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("period_s", [None, 1e-3])
def test_derivatives_against_finite_differences(case, kind, period_s):
    robot, at = CASES[case]
    model = linear_model(robot, at)
    nominal = nominal_parameters(robot, model, 8e-4)
    found = jacobian(model, nominal, response(model, nominal, FREQUENCY_HZ, period_s), (kind,))
    values = getattr(nominal, kind)
    for index, value in enumerate(values.tolist()):
        step = 1e-4 * value if value else {"arm_viscous": 1e-2}.get(kind, 1e-6)
        ends = []
        for side in (-1, 1):
            moved = with_values(nominal, kind, values + side * step * np.eye(values.size)[index])
            ends.append(response(model, moved, FREQUENCY_HZ, period_s).sampled)
        slope = (ends[1] - ends[0]) / (2 * step)
        np.testing.assert_allclose(found[..., index], slope, rtol=0, atol=10 * FINITE_DIFFERENCE * np.abs(slope).max())


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("joint", [0, 1])
def test_links_own_inertia_is_that_of_the_model(case, joint):
    """A point mass more in a link that slides, a disc more in one that turns."""
    robot, at = CASES[case]
    gained = 1e-3
    link = robot.joints[joint].link
    heavier = replace(link, mass_kg=link.mass_kg + gained)
    if robot.joints[joint].type == "revolute":
        heavier = replace(link, inertia_kgm2=link.inertia_kgm2 + np.diag([0.0, 0.0, gained]))
    joints = tuple(replace(j, link=heavier) if i == joint else j for i, j in enumerate(robot.joints))
    free = replace(robot, gravity_m_s2=np.zeros(3))
    model, other = (linear_model(each, at) for each in (free, replace(free, joints=joints)))
    whole = [m.mass + np.einsum("l,clij->cij", m.axial, m.link_inertia) for m in (model, other)]
    np.testing.assert_allclose(whole[1] - whole[0], gained * model.link_inertia[:, joint], atol=1e-12)
    np.testing.assert_allclose(other.axial[joint] - model.axial[joint], gained, rtol=1e-8)


def test_a_link_that_slides_two_ways_is_no_plain_inertia():
    assert has_plain_inertias(linear_model(linear_axis(), np.array([[0.5]])))
    assert has_plain_inertias(linear_model(*CASES["rigid elbow"]))
    assert not has_plain_inertias(linear_model(*CASES["gantry"]))


@pytest.mark.parametrize("case", CASES)
def test_repeated_response_is_the_general_one(case):
    robot, at = CASES[case]
    model = linear_model(robot, at)
    assert is_collocated(model)
    nominal = nominal_parameters(robot, model, 8e-4)
    wanted = response(model, nominal, FREQUENCY_HZ, 1e-3).sampled
    used = np.ones((len(at), FREQUENCY_HZ.size), bool)
    found = Collocated(model, FREQUENCY_HZ, 1e-3, used, ("stiffness", "viscous")).response(nominal)
    rows, columns = np.triu_indices(len(robot.joints))
    np.testing.assert_allclose(found.T, wanted[..., rows, columns].reshape(found.T.shape), rtol=1e-8)


def test_friction_of_a_rigid_joint_is_that_of_its_motor():
    robot = without_spring(linear_axis(ratio=-628.0, viscous=0.0), "gear_rail")
    law = Friction(coulomb_nm=1.5, static_nm=1.5, stribeck_rad_s=2.0, presliding_rad=0.02)
    joint = replace(robot.joints[0], motor=replace(robot.joints[0].motor, friction=law))
    model = build_model(replace(robot, joints=(joint,)), friction=LUGRE, timestep_s=1e-4)
    data = mujoco.MjData(model.mujoco)
    speed = 0.05
    for _ in range(200):
        data.qvel[:] = speed
        mujoco.mj_step(model.mujoco, data)
    assert data.actuator("friction_rail").force[0] == pytest.approx(1.5, rel=1e-2)  # the motor turns backwards
    assert data.qfrc_actuator[0] == pytest.approx(-628.0 * 1.5, rel=1e-2)
    assert data.actuator("friction_rail").velocity[0] == pytest.approx(-628.0 * speed, rel=0.05)


def test_what_gears_do_wrong_is_stated_by_type_of_joint():
    robot = with_imperfections(arm_on_rail(), Imperfections(stiffening_1_rad2=2.0, stiffening_1_m2=5e4))
    assert [s.cubic / s.stiffness for s in robot.springs[:3]] == pytest.approx([5e4, 2.0, 2.0])
    model = build_model(robot, backlash=(1e-4, 2e-5), hysteresis=(3.0, 40.0)).mujoco
    for name, gap, load in (("gear_rail", 2e-5, 40.0), ("gear_1", 1e-4, 3.0)):
        np.testing.assert_allclose(np.ptp(model.tendon_lengthspring[model.tendon(name).id]), gap)
        joint = {"gear_rail": "rail", "gear_1": "shoulder"}[name]
        bristles = model.actuator(f"hysteresis_{joint}")
        assert load in [*bristles.dynprm, *bristles.gainprm, *bristles.biasprm]


def test_units_follow_the_joint():
    robot = arm_on_rail()
    assert element_units(robot, "stiffness")[:2] == ["N/m", "N m/rad"]
    assert element_units(robot, "damping")[0] == "N s/m"
    assert element_units(robot, "cubic")[0] == "N/m^3"
    assert element_units(robot, "link_inertia") == ["kg", "kg m^2", "kg m^2"]
    assert set(element_units(robot, "motor_inertia")) == {"kg m^2"}


def test_skeleton_and_mirror_of_a_rail():
    robot, at = arm_on_rail(), np.array([[0.8, 0.3, -0.4]])
    away = skeleton(robot, at)[0] - skeleton(robot, at * [0.0, 1.0, 1.0])[0]
    np.testing.assert_allclose(away[1:], np.tile([0.8, 0.0, 0.0], (4, 1)), atol=1e-12)
    np.testing.assert_allclose(mirror(without_spring(linear_axis(), "gear_rail"), np.array([[0.8]])), [[0.8]])


def test_what_only_the_rigid_model_knows_is_refused():
    shoulder, elbow = RIGID_ELBOW.joints
    balance = HarmonicBalance(np.array([1.0]), np.array([0.0]))
    rod = LoopLink("rod", "shoulder", np.zeros(3), np.eye(3), elbow.link, {"elbow": 1.0})
    for change, told in (
        ({"joints": (shoulder, replace(elbow, couplings={"shoulder": 0.01}))}, "move the rigid joint `elbow`"),
        ({"joints": (replace(shoulder, counterbalance=balance), elbow)}, "the counterbalance of `shoulder`"),
        ({"loop_links": (rod,)}, "the loop link `rod`"),
    ):
        with pytest.raises(DataError, match=told):
            build_model(replace(RIGID_ELBOW, **change))


def test_rotors_of_rigid_joints_do_not_ride_on_links():
    with pytest.raises(ValueError, match="spong"):
        build_model(replace(RIGID_ELBOW, rotor="on_link"))
