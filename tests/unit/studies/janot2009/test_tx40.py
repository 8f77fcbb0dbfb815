"""The measured Staubli TX40: its published motors and friction come back, in the literature's own words."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.models.known import load_experiment
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.shots import shots_of
from robid.models.rigid.settings import rigid_fit
from robid.pipeline.acquire import acquire_shots
from robid.robot.description import Inertial, Joint, Motor, Robot
from robid.studies.janot2009.recorded import PUBLISHED, arm_side, published_rows, tx40_figures

EXPERIMENT = Path(__file__).parents[4] / "configs" / "tx40.yaml"
RATIOS = (32.0, 32.0, 45.0, -48.0, 45.0, 32.0)


def _robot():
    still = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))
    joints = [
        Joint(f"joint_{index}", np.zeros(3), np.eye(3), still, -3.0, 3.0, Motor(1.0, ratio, np.inf, np.inf))
        for index, ratio in enumerate(RATIOS, start=1)
    ]
    joints[5] = replace(joints[5], couplings={"joint_5": -1 / 45})
    return Robot("arm", np.zeros(3), tuple(joints), (), still)


def test_the_literatures_torques_are_those_of_our_motors():
    generator, robot = np.random.default_rng(3), _robot()
    kinds = ("motor_inertia", "viscous", "coulomb")
    drawn = {f"joint_{n}.{kind}": generator.uniform(1, 2) for n in range(1, 7) for kind in kinds}
    drawn |= {f"joint_6.coupling_{kind}": generator.uniform(1, 2) for kind in ("inertia", "viscous", "coulomb")}
    found = arm_side(drawn, robot)
    for letter, kind, coupled in (("Ia", "motor_inertia", "inertia"), ("fv", "viscous", "viscous")):
        motion = generator.normal(size=6)
        motors = np.array([drawn[f"joint_{n}.{kind}"] for n in range(1, 7)]) * (robot.motor_per_arm @ motion)
        ours = robot.motor_per_arm.T @ motors
        ours[5] += drawn[f"joint_6.coupling_{coupled}"] * motion[5]
        theirs = np.array([found[f"{letter}{n}"] for n in range(1, 7)]) * motion
        theirs[4] += found[f"{letter}m6"] * motion[5]
        theirs[5] += found[f"{letter}m6"] * motion[4]
        np.testing.assert_allclose(theirs, ours, rtol=1e-12)
    speed = generator.normal(size=6)
    levels = np.array([drawn[f"joint_{n}.coulomb"] for n in range(1, 7)])
    ours = robot.motor_per_arm.T @ (levels * np.sign(robot.motor_per_arm @ speed))
    ours[5] += drawn["joint_6.coupling_coulomb"] * np.sign(speed[5])
    theirs = np.array([found[f"fs{n}"] for n in range(1, 7)]) * np.sign(speed)
    theirs[4:] += found["fsm6"] * np.sign(speed[4] + speed[5])
    np.testing.assert_allclose(theirs, ours, rtol=1e-12)


def test_parameters_that_links_absorb_are_left_out():
    drawn = {f"joint_{n}.{kind}": 1.0 for n in range(1, 7) for kind in ("motor_inertia", "viscous", "coulomb")}
    drawn |= {f"joint_6.coupling_{kind}": 1.0 for kind in ("inertia", "viscous", "coulomb")}
    del drawn["joint_1.motor_inertia"]
    found = arm_side(drawn, _robot())
    assert "Ia1" not in found
    assert set(PUBLISHED) <= set(found)


@pytest.fixture(scope="module")
def fitted(data_folder):
    data_folder("tx40")
    loaded = load_experiment(EXPERIMENT)
    robot, campaign = loaded.robot.to_robot(), loaded.experiment.campaigns["motion"]
    record = acquire_shots(campaign, campaign.source.acquire, EXPERIMENT.parent)
    options = rigid_fit(loaded.experiment, "arm").options()
    return record, fit_rigid(robot, shots_of(record, robot), options), robot


def test_positions_are_absolute_and_torques_come_from_the_other_file(fitted):
    record, _, robot = fitted
    first = robot.arm_per_motor @ record.output_offset[0]
    np.testing.assert_allclose(first, [0, 0, 0, 0, 0, 0], atol=2e-5)
    assert record.inputs.shape == (1, 1, 1, 1, 45000, 6)
    assert 0.5 < np.abs(record.inputs[..., 1]).max() < 5
    np.testing.assert_allclose(record.inputs[0, 0, 0, 0, 0, :2], [-0.0029698, -0.76036], rtol=1e-12)


def test_published_motors_and_friction_come_back(fitted):
    _, solution, robot = fitted
    figures = tx40_figures(solution, robot)
    assert figures["tx40.max_inertia_error_percent"] <= 15
    assert figures["tx40.max_viscous_error_percent"] <= 20
    assert 6 < figures["tx40.relative_error_percent"] < 10  # of the moving rows; 9.1 with those at rest
    assert figures["tx40.trusted"] == 0  # Coulomb and viscous friction are not all that these gears have
    assert "correlated in time" in solution.checks.sentence


def test_rows_show_what_figures_sum_up(fitted):
    _, solution, robot = fitted
    rows = published_rows(solution, robot)
    assert {name: published for name, (published, _) in rows.items()} == PUBLISHED
    worst = max(100 * abs(found / published - 1) for published, found in (rows[f"fv{n}"] for n in range(1, 7)))
    assert worst == tx40_figures(solution, robot)["tx40.max_viscous_error_percent"]
    assert rows["Ia3"][1] == pytest.approx(45**2 * solution.estimate.found["joint_3.motor_inertia"])
