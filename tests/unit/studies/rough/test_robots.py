"""Robots that are drawn, and the files that say roughly what they are."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from robid.design.excitation.options import TrajectoryOptions
from robid.pipeline.design_excitation import base_model
from robid.settings.load import load_robot
from robid.studies.rough.robots import drawn_robot, rough_file
from robid.studies.settings.rough import FileErrors, RoughArm, Spread

ROOT = Path(__file__).parents[4]
HOME = (0, -70, 70, 0, 30, 0)
ARM = RoughArm(robot="kr300.yaml", home_deg=HOME, payload_kg=150, payload_com_m=(0.15, 0.05, -0.3), balanced="axis_2")
SEEDS = range(1, 9)


@pytest.fixture(scope="module")
def nominal():
    return load_robot(ROOT / "configs/robots/kr300.yaml").to_robot()


def held_nm(robot, lift_rad):
    """Arm-side torques (n_joint,) that hold a robot at home with axis 2 at an angle."""
    place = np.radians(HOME)[None].copy()
    place[0, 1] = lift_rad
    model = base_model(robot, TrajectoryOptions())
    return model.torques(place, np.zeros((3, 1, 6)))[0, 0] @ robot.motor_per_arm


def test_a_counterbalance_takes_its_share_of_gravity(nominal):
    spread = Spread(balance_share=(0.5, 0.5))
    free, balanced = (drawn_robot(nominal, ARM, spread, 3, balanced=has) for has in (False, True))
    balance = balanced.joints[1].counterbalance
    assert [joint.name for joint in balanced.joints if joint.counterbalance is not None] == ["axis_2"]
    # The motor of a balanced robot holds what is left; a second harmonic, a tenth of the first, is no gravity.
    for lift in (0.0, np.pi / 2, 0.4):
        gravity, left = held_nm(free, lift), held_nm(balanced, lift)
        second = [balance.cosine_nm[1] * np.cos(2 * lift), balance.sine_nm[1] * np.sin(2 * lift)]
        assert left[1] == pytest.approx(0.5 * gravity[1] - sum(second), rel=1e-6)
        assert left[[0, 2, 3, 4, 5]] == pytest.approx(gravity[[0, 2, 3, 4, 5]], rel=1e-9, abs=1e-9)
    assert replace(balanced.joints[1], counterbalance=None).motor == free.joints[1].motor


def test_a_file_is_off_as_far_as_is_said_and_lacks_the_counterbalance(nominal):
    ratios = []
    for seed in SEEDS:
        true = drawn_robot(nominal, ARM, Spread(), seed, balanced=True)
        file = rough_file(true, FileErrors(), seed)
        assert all(joint.counterbalance is None for joint in file.joints)
        assert np.linalg.norm(file.payload.com_m - true.payload.com_m) == pytest.approx(0.15, rel=1e-9)
        assert file.payload.mass_kg == true.payload.mass_kg
        pairs = list(zip(file.joints, true.joints, strict=True))
        mass = [stated.link.mass_kg / own.link.mass_kg for stated, own in pairs]
        law = [(stated.motor.friction, own.motor.friction) for stated, own in pairs]
        viscous = [stated.viscous_nms_rad / own.viscous_nms_rad for stated, own in law]
        dry = [stated.coulomb_nm / own.coulomb_nm for stated, own in law]
        assert dry == pytest.approx([stated.static_nm / own.static_nm for stated, own in law], rel=1e-9)
        ratios.append(np.abs(np.log([mass, viscous, dry])))
    most = np.exp(np.max(ratios, axis=0))
    assert 1.1 < most[0, :3].max() <= 1.3
    assert 2 < most[0, 3:].max() <= 3
    assert 10 < most[1:].max() <= 20


def test_no_two_robots_are_alike_and_each_comes_again(nominal):
    def masses(seed):
        return [joint.link.mass_kg for joint in drawn_robot(nominal, ARM, Spread(), seed, balanced=False).joints]

    assert masses(1) == masses(1)
    assert not set(masses(1)) & set(masses(2))
