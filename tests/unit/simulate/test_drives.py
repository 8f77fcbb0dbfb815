"""Drives that are late in closed loop, friction that drifts from one configuration to the next."""

from dataclasses import replace

import numpy as np
import pytest

from elastic_loops import CONFIGURATION, PLAIN, analytic, diagonal, experiment
from exact_systems import two_joint_robot
from robid.frf.estimate import estimate_frf
from robid.models.elastic.fitting import true_values
from robid.simulate.experiment import simulate
from robid.simulate.options import Imperfections, Truth
from robid.simulate.truth import TrueRobot


@pytest.mark.parametrize("of", ["torque", "angle"])
@pytest.mark.parametrize("late_s", [1e-3, 2.3e-3, 0.4e-3])
def test_a_late_drive_turns_its_column_or_row_as_its_delay_does(of, late_s):
    run = experiment(rms=0.5, transient_periods=3, truth=Truth(**{f"late_{of}_s": {"elbow": late_s}}))
    frf = estimate_frf(simulate(run, CONFIGURATION, 0), PLAIN)
    exact = analytic(run.robot, CONFIGURATION, frf.frequency_hz, run.controller)
    turned = np.exp(-2j * np.pi * frf.frequency_hz[:, None, None] * late_s * np.array([0.0, 1.0]))
    wanted = exact * (turned if of == "torque" else turned.swapaxes(1, 2))
    assert np.median(np.abs(frf.response / wanted - 1)) < 1e-3
    lateness = np.angle(exact[0] / frf.response[0]) / (2 * np.pi * frf.frequency_hz[:, None, None])
    drive = lateness[:, 0, 1] if of == "torque" else lateness[:, 1, 0]
    assert np.median(drive) == pytest.approx(late_s, rel=5e-3)
    assert abs(np.median(lateness[:, 0, 0])) < 0.01 * late_s


def test_true_values_of_late_drives_and_one_sided_gears_are_those_that_were_set():
    truth = Truth(late_torque_s={"elbow": 4e-4}, late_angle_s={"shoulder": 1e-3})
    robot, flaws = two_joint_robot(), Imperfections(one_sided=-0.1)
    values = true_values(robot, TrueRobot(robot, truth, flaws, 1e-3, 1, None))
    late = [values[f"{joint}.late_{of}"] for of in ("torque", "angle") for joint in ("shoulder", "elbow")]
    np.testing.assert_allclose(late, [0.0, 400.0, 1000.0, 0.0])
    assert values["gear_1.one_sided"] == pytest.approx(-10.0)
    drifting = TrueRobot(robot, truth, Imperfections(viscous_drift=0.5), 1e-3, 1, None)
    assert "elbow.viscous" in values
    assert "elbow.viscous" not in true_values(robot, drifting)


@pytest.mark.parametrize(("index", "left"), [(0, 1.0), (2, 0.5 + 0.5 * np.exp(-1.0)), (40, 0.5)])
def test_viscous_friction_decays_from_one_configuration_to_the_next(index, left):
    robot = two_joint_robot()

    def rubbing(share):
        motors = [
            replace(joint.motor, friction=replace(joint.motor.friction, viscous_nms_rad=0.02 * share))
            for joint in robot.joints
        ]
        joints = tuple(replace(joint, motor=motor) for joint, motor in zip(robot.joints, motors, strict=True))
        return replace(robot, joints=joints)

    flaws = Imperfections(viscous_drift=0.5, drift_configurations=2.0)
    run = experiment(rubbing(1.0), rms=0.5, transient_periods=3, imperfections=flaws)
    frf = estimate_frf(simulate(run, CONFIGURATION, index), PLAIN)
    wanted, off = (
        diagonal(analytic(rubbing(share), CONFIGURATION, frf.frequency_hz, run.controller))
        for share in (left, left + 0.05)
    )
    errors = [np.median(np.abs(diagonal(frf.response) / each - 1)) for each in (wanted, off)]
    assert errors[0] < 1e-4
    assert errors[1] > 5 * errors[0]


def test_drives_that_are_late_by_parts_of_a_sample_take_more_steps():
    from robid.simulate.experiment import with_settled_steps

    def steps(**late):
        run = experiment(count=8, period_s=0.5, truth=Truth(late_torque_s=late))
        return with_settled_steps(run, CONFIGURATION[None])[1].count

    assert steps(elbow=3e-3) == steps() < 4 <= steps(elbow=3.1e-3)
