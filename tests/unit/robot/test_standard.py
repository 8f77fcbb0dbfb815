"""Standard parameters back in a robot: what is written is what its rigid model reads again."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import two_joint_robot
from rigid_robots import planar_arm, random_body, random_chain
from robid.robot.description import HarmonicBalance, SpringBalance
from robid.robot.inertia import about_origin, remove
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model
from robid.robot.standard import deformed, is_real, with_standard
from tolerances import IDENTITY


def balanced_chain():
    """A chain whose first joints have counterbalances of either kind."""
    robot = random_chain(4)
    harmonic = HarmonicBalance(np.array([30.0, 2.0]), np.array([-4.0, 0.5]))
    spring = SpringBalance(np.array([0.3, 0.1, 0.0]), np.array([0.2, -0.1, 0.1]), 0.1, 2e3, 50.0)
    first, second, *rest = robot.joints
    joints = (replace(first, counterbalance=harmonic), replace(second, counterbalance=spring), *rest)
    return replace(robot, joints=joints)


def named(model, values):
    return dict(zip(model.names, values.tolist(), strict=True))


@pytest.mark.parametrize("payload", ["link", "body"])
def test_a_model_reads_the_parameters_that_were_written(payload):
    robot, options = balanced_chain(), RigidOptions(payload=payload, offsets=False)
    model = build_rigid_model(robot, options)
    # A body's parameters stay those of a real one where all grow by the same factor.
    owners = list(dict.fromkeys(name.rpartition(".")[0] for name in model.names))
    factor = dict(zip(owners, np.linspace(1.1, 1.5, len(owners)), strict=True))
    mixed = model.nominal * [factor[name.rpartition(".")[0]] for name in model.names]
    found = with_standard(robot, named(model, mixed))
    again = build_rigid_model(found.robot, options).nominal
    np.testing.assert_allclose(again, mixed, rtol=0, atol=IDENTITY * np.abs(mixed).max())
    assert not found.payload_is_in_link
    assert not found.homeless


def test_a_payload_that_leaves_no_real_link_stays_in_it():
    robot = random_chain(1)
    model = build_rigid_model(robot)
    values = named(model, model.nominal)
    last = robot.joints[-1].name
    values[f"{last}.M"] = 0.9 * robot.payload.mass_kg
    found = with_standard(robot, values)
    assert found.payload_is_in_link
    assert found.robot.payload.mass_kg == 0
    assert build_rigid_model(found.robot).nominal[model.names.index(f"{last}.M")] == values[f"{last}.M"]


def test_friction_is_the_mean_of_both_directions_and_breakaway_keeps_its_ratio():
    robot = planar_arm(1)
    joint = robot.joints[0]
    motor = replace(joint.motor, friction=replace(joint.motor.friction, coulomb_nm=2.0, static_nm=3.0))
    robot = replace(robot, joints=(replace(joint, motor=motor),))
    friction = {"viscous_forward": 0.3, "viscous_backward": 0.1, "coulomb_forward": 5.0, "coulomb_backward": 3.0}
    values = {f"joint1.{name}": value for name, value in friction.items()}
    found = with_standard(robot, {**values, "joint1.torque_offset": 0.4})
    law = found.robot.joints[0].motor.friction
    assert (law.viscous_nms_rad, law.coulomb_nm, law.static_nm) == (0.2, 4.0, 6.0)
    assert found.averaged == ("joint1",)
    assert found.homeless == ("joint1.torque_offset",)


def test_friction_that_would_drive_is_none():
    assert with_standard(planar_arm(1), {"joint1.viscous": -0.1}).robot.joints[0].motor.friction.viscous_nms_rad == 0


def test_a_part_is_deformed_as_its_body():
    generator = np.random.default_rng(2)
    part, rest, after = (random_body(generator) for _ in range(3))
    before = joined(part, rest)
    whole = joined(deformed(part, before, after), deformed(rest, before, after))
    assert whole.mass_kg == pytest.approx(after.mass_kg)
    np.testing.assert_allclose(whole.com_m, after.com_m, rtol=1e-9)
    np.testing.assert_allclose(about_origin(whole), about_origin(after), rtol=1e-9)
    same = deformed(part, before, before)
    np.testing.assert_allclose(about_origin(same), about_origin(part), rtol=1e-9)


def joined(first, second):
    return remove(first, replace(second, mass_kg=-second.mass_kg, inertia_kgm2=-second.inertia_kgm2))


def test_what_lies_beyond_a_split_follows_its_link():
    robot = replace(two_joint_robot(), payload=replace(two_joint_robot().payload, mass_kg=0.0))
    model = build_rigid_model(robot)
    values = named(model, model.nominal)
    values |= {name: 0.3 * value for name, value in values.items() if name.startswith("elbow.M")}
    values |= {f"elbow.{one}": 0.3 * values[f"elbow.{one}"] for one in ("XX", "XY", "XZ", "YY", "YZ", "ZZ")}
    found = with_standard(robot, values).robot
    outboard, whole = found.springs[-1].outboard, found.joints[1].link
    assert outboard.mass_kg == pytest.approx(0.3 * robot.springs[-1].outboard.mass_kg)
    assert is_real(remove(whole, outboard))
    assert not is_real(remove(whole, robot.springs[-1].outboard))
