"""Base parameters of textbook chains."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from rigid_robots import planar_arm, random_chain, random_motion, with_gears
from robid.robot.regressor.base import find_base_parameters, label, random_columns, select_base
from robid.robot.regressor.drives import BaseOptions, RigidOptions
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot
from tolerances import IDENTITY

ROBOTS = Path(__file__).parents[3] / "configs" / "robots"
BARE = RigidOptions(friction="none", offsets=False, motor_inertias=False, couplings=False)


def labels(robot, options=BARE):
    return set(find_base_parameters(build_rigid_model(robot, options)).labels)


def test_one_link_under_gravity():
    assert labels(planar_arm(1)) == {"joint1.ZZ", "joint1.MX", "joint1.MY"}
    with_motor = replace(BARE, motor_inertias=True, friction="coulomb")
    drive = {"joint1.viscous", "joint1.coulomb"}
    assert labels(planar_arm(1), with_motor) == {"joint1.ZZ + joint1.motor_inertia", "joint1.MX", "joint1.MY", *drive}
    assert labels(planar_arm(1, gravity=0.0)) == {"joint1.ZZ"}


def test_two_links_in_a_plane():
    # The elbow is 0.9 m out: the second link's mass counts as a point there.
    wanted = {
        "joint1.ZZ + 0.81 joint2.M",
        "joint1.MX + 0.9 joint2.M",
        "joint1.MY",
        "joint2.ZZ",
        "joint2.MX",
        "joint2.MY",
    }
    found = find_base_parameters(build_rigid_model(planar_arm(2), BARE))
    assert set(found.labels) == wanted
    assert found.undetermined == ("joint1.ZZ", "joint1.MX", "joint2.M")
    assert "joint2.MZ" in found.silent
    assert "joint1.M" in found.silent
    assert found.base_names == ("joint1.ZZ", "joint1.MX", "joint1.MY", "joint2.ZZ", "joint2.MX", "joint2.MY")
    assert found.units == ("kg m^2", "kg m", "kg m", "kg m^2", "kg m", "kg m")


@pytest.mark.parametrize("name", ["puma560.yaml", "kr300.yaml"])
def test_six_axes_with_gravity_have_36_inertial_parameters(name):
    # Published for the Puma 560 and all arms of its kind: Khalil and Dombre (2002), Atkeson et al. (1986).
    robot = load_robot(ROBOTS / name).to_robot()
    found = find_base_parameters(build_rigid_model(robot, BARE))
    assert found.columns.size == 36
    assert found.gap > 1e10
    # One motor inertia for each axis but the first two, which turn at right angles on a fixed base.
    with_motors = find_base_parameters(build_rigid_model(robot, replace(BARE, motor_inertias=True)))
    assert with_motors.columns.size == 40
    assert [name for name in with_motors.base_names if name.endswith("motor_inertia")] == [
        f"axis_{axis}.motor_inertia" for axis in range(3, 7)
    ]


def test_the_wrist_of_the_tx40_has_61_with_friction_offsets_and_coupling(data_folder, tmp_path):
    ratios = [32, 32, 45, -48, 45, 32]
    model = data_folder("tx40") / "tx40_meshfree.urdf"
    joints = [
        {"name": f"joint_{axis}", "rigid": True, "motor": {"inertia_kgm2": 1e-5, "gear_ratio": ratio}}
        for axis, ratio in enumerate(ratios, start=1)
    ]
    joints[5]["couplings"] = {"joint_5": -1 / 45}
    YAML().dump({"schema_version": 1, "name": "tx40", "model": str(model), "joints": joints}, tmp_path / "robot.yaml")
    found = find_base_parameters(build_rigid_model(load_robot(tmp_path / "robot.yaml").to_robot()))
    assert found.columns.size == 61
    wanted = {f"joint_{axis}.motor_inertia" for axis in range(3, 7)}
    wanted |= {f"joint_6.coupling_{kind}" for kind in ("inertia", "viscous", "coulomb")}
    wanted |= {f"joint_{axis}.{kind}" for axis in range(1, 7) for kind in ("viscous", "coulomb", "torque_offset")}
    assert wanted <= set(found.base_names)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("form", ["coulomb", "asymmetric", "load", "quadratic"])
def test_base_parameters_give_the_torques_of_the_standard_ones(seed, form):
    robot = with_gears(random_chain(seed))
    model = build_rigid_model(robot, RigidOptions(friction=form, payload="body"))
    base = find_base_parameters(model)
    motion, load = random_motion(robot, 20), np.random.default_rng(1).standard_normal((20, 5))
    columns = model.columns(*motion, torque=load)
    standard = np.random.default_rng(2).standard_normal(len(model.names))
    wanted = columns @ standard
    found = columns[:, :, base.columns] @ base.values(standard)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e3 * IDENTITY * np.abs(wanted).max())
    np.testing.assert_array_equal(base.combination[:, base.columns], np.eye(base.columns.size))
    assert base.gap > 1e8
    assert base.columns.size == np.linalg.matrix_rank(columns_of(model), tol=1e-8)


def columns_of(model):
    columns = random_columns(model, BaseOptions(seed=5)).reshape(-1, len(model.names))
    length = np.linalg.norm(columns, axis=0)
    return columns / np.where(length > 0, length, 1) / np.sqrt(len(model.names))


def test_a_factor_of_the_information_gives_the_same_as_the_rows():
    model = build_rigid_model(random_chain(4))
    rows = random_columns(model, BaseOptions()).reshape(-1, len(model.names))
    from_rows, from_factor = (select_base(each, model) for each in (rows, np.linalg.qr(rows, mode="r")))
    np.testing.assert_array_equal(from_factor.columns, from_rows.columns)
    assert from_factor.labels == from_rows.labels
    np.testing.assert_allclose(from_factor.singular_values[:10], from_rows.singular_values[:10])


def test_a_motion_that_excites_too_little_shows_fewer():
    model = build_rigid_model(planar_arm(2), BARE)
    position, speed, acceleration = random_motion(model.robot, 200)
    for array in (position, speed, acceleration):
        array[:, 0] = 0.0  # the shoulder never moves: its inertia is never felt, and its link weighs always the same
    found = select_base(model.columns(position, speed, acceleration).reshape(-1, 20), model)
    assert "joint1.ZZ" in found.silent
    assert "joint1.MX + 0.9 joint2.M" in found.labels
    assert found.columns.size == 4


def test_sliding_joints_keep_their_masses():
    robot = load_robot(ROBOTS / "gantry.yaml").to_robot()
    names = find_base_parameters(build_rigid_model(robot, RigidOptions(friction="viscous", offsets=False))).base_names
    assert {name for name in names if name.endswith(".M")} == {"x.M", "y.M", "z.M"}


def test_a_payload_of_its_own_is_told_from_the_link_by_runs_without_it():
    robot = load_robot(ROBOTS / "kr300.yaml").to_robot()
    names = find_base_parameters(build_rigid_model(robot, replace(BARE, payload="body"))).base_names
    assert sum(name.startswith("payload.") for name in names) == 10
    assert sum(name.startswith("axis_") for name in names) == 36


def test_coefficients_are_written_tidily():
    names = ("a", "b", "c", "d", "e")
    assert label(np.array([2.0, 1.0, -1.0, 0.0, -0.81]), names, 1) == "b + 2 a - c - 0.81 e"
    assert label(np.array([0.0, 0.0, 0.0, 1.0, 66003.2]), names, 3) == "d + 6.6e+04 e"
    half = 1.3225 * (1 + 1e-12 * np.array([-1, 1]))
    assert len({label(np.array([1.0, value]), names, 0) for value in half}) == 1


def test_a_robot_that_stands_still_shows_what_it_weighs_and_nothing_else():
    model, still = build_rigid_model(planar_arm(2), BARE), np.zeros((20, 2))
    found = select_base(model.columns(still, still, still).reshape(-1, 20), model)
    assert set(found.labels) == {"joint1.MX + 0.9 joint2.M", "joint2.MX"}
    weightless = build_rigid_model(planar_arm(2, gravity=0.0), BARE)
    found = select_base(weightless.columns(still, still, still).reshape(-1, 20), weightless)
    assert (found.columns.size, found.labels, len(found.silent)) == (0, (), 20)


def test_silent_columns_are_told_and_rank_has_a_gap():
    model = build_rigid_model(planar_arm(2), BARE)
    found = find_base_parameters(model)
    silent = set(found.silent)
    assert silent == {f"joint{index}.{name}" for index in (1, 2) for name in ("XX", "XY", "XZ", "YY", "YZ", "MZ")} | {
        "joint1.M"
    }
    assert found.singular_values.shape == (20,)
    assert found.gap > 1e10
