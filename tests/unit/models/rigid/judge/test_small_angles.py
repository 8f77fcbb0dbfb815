"""The angle of one joint in the wrong unit is named, too small ones where a motion seems too poor; small ones not."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rigid_logs import fourier_motion, shot_along, with_masses
from rigid_robots import random_chain
from robid.models.known import load_experiment
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.shots import shots_of
from robid.models.rigid.judge.motors import EXPECTED_ERROR_LIMIT, added_error
from robid.models.rigid.judge.plausible import assess_rigid
from robid.models.rigid.judge.scales import Motions, motions_of, rigid_scale_findings
from robid.models.rigid.judge.small_angles import small_angle_findings
from robid.models.rigid.settings import rigid_fit
from robid.pipeline.acquire import acquire_shots
from robid.results.plausible.hypotheses import Pair
from robid.signals.quantities import Channel

EXPERIMENT = Path(__file__).parents[5] / "configs" / "tx40.yaml"
OPTIONS = RigidFitOptions(filters=PreprocessingOptions(position_cut_hz=10.0), physical=False)
N_JOINT = 4


def _real(folder, **units):
    """The TX40's fit with the unit of some outputs stated, its grade and the wrong angles that it shows."""
    text = EXPERIMENT.read_text().replace("robots/tx40.yaml", str(EXPERIMENT.parent / "robots" / "tx40.yaml"))
    for name, unit in units.items():
        column = name.capitalize()
        assert f"{{name: {name}, variable: {column}}}" in text
        text = text.replace(
            f"{{name: {name}, variable: {column}}}", f"{{name: {name}, variable: {column}, unit: {unit}}}"
        )
    (folder / "tx40.yaml").write_text(text)
    loaded = load_experiment(folder / "tx40.yaml")
    robot, campaign = loaded.robot.to_robot(), loaded.experiment.campaigns["motion"]
    record = acquire_shots(campaign, campaign.source.acquire, EXPERIMENT.parent)
    options = replace(rigid_fit(loaded.experiment, "arm").options(), physical=False)
    shots = shots_of(record, robot)
    solution = fit_rigid(robot, shots, options)
    found = small_angle_findings(robot, shots, motions_of(record, robot), solution, options)
    return found, assess_rigid(robot, solution, options, found), assess_rigid(robot, solution, options)


@pytest.mark.parametrize("joint", ["joint_1", "joint_4", "joint_5", "joint_6"])
def test_radians_of_one_joint_of_a_real_arm_that_are_read_as_degrees_are_named(data_folder, tmp_path, joint):
    data_folder("tx40")
    (found,), grade, blind = _real(tmp_path, **{joint: "deg"})
    assert blind.causes[0] != "units"  # something else is blamed otherwise
    assert (grade.value, grade.causes[0]) == (0, "units")
    assert [str(scale) for scale in found.scales] == [f"motor_angle / 180/pi of {joint}"]
    assert f"state `unit: rad` for the motor angle of {joint}" in found.message
    found, grade, _ = _real(tmp_path, **{joint: "rad"})
    assert found == ()
    assert grade.value > 0


def test_degrees_of_a_motor_that_turns_another_arm_too_are_named(data_folder):
    data_folder("tx40")
    loaded = load_experiment(EXPERIMENT)
    robot, campaign = loaded.robot.to_robot(), loaded.experiment.campaigns["motion"]
    record = acquire_shots(campaign, campaign.source.acquire, EXPERIMENT.parent)
    wrong = np.ones(6)
    wrong[4] = 180 / np.pi  # motor 5, with which arm 6 turns too
    record = replace(record, outputs=record.outputs * wrong, output_offset=record.output_offset * wrong)
    options = rigid_fit(loaded.experiment, "arm").options()
    (found,) = rigid_scale_findings(robot, shots_of(record, robot), motions_of(record, robot), options)
    assert str(found.scales[0]) == "motor_angle x 180/pi of joint_5"
    assert "state `unit: deg` for the motor angle of joint_5" in found.message


def _arm(seed, rough=3.0):
    """A robot, its file with links off by up to a factor, and what its record says of its motions."""
    generator = np.random.default_rng(seed)
    robot = replace(random_chain(seed, N_JOINT, slides=0.0), gravity_m_s2=np.array([0.0, 0.0, -9.81]))
    file = with_masses(robot, rough ** generator.uniform(-1, 1, N_JOINT))
    channels = tuple(Channel(joint.name, "angle", "rad") for joint in robot.joints)
    return robot, file, Motions(channels, np.arange(N_JOINT), ())


def _found(file, shot, motions):
    solution = fit_rigid(file, [shot], OPTIONS)
    poor = bool((added_error(solution) > EXPECTED_ERROR_LIMIT).any())
    return poor, small_angle_findings(file, [shot], motions, solution, OPTIONS)


def _factor(joint):
    factor = np.ones(N_JOINT)
    factor[joint] = np.pi / 180
    return factor


def test_a_joint_that_hardly_moves_is_not_accused_and_one_that_was_misread_is():
    poor, named, seeds = [], [], range(12)
    for seed in seeds:
        robot, file, motions = _arm(seed)
        joint, motion = seed % N_JOINT, fourier_motion(robot, 6000)
        still, found = _found(file, shot_along(robot, motion * _factor(joint), 0.03), motions)
        poor.append(still)
        assert found == ()
        moved = shot_along(robot, motion, 0.03)
        _, found = _found(file, replace(moved, position=moved.position * _factor(joint)), motions)
        assert all(each.scales[0].joints == (robot.joints[joint].name,) for each in found)
        named.append(bool(found))
    assert sum(poor) >= 3  # the sound ones include such as a motion is blamed for
    assert sum(named) >= 8


def test_an_angle_that_another_channel_measures_is_left_to_that():
    robot, file, motions = _arm(1)
    shot = shot_along(robot, fourier_motion(robot, 6000), 0.03)
    shot = replace(shot, position=shot.position * _factor(1))
    assert _found(file, shot, motions)[1]
    assert not _found(file, shot, replace(motions, pairs=(Pair(1, 2, 0, 1.0, 0.01),)))[1]


def test_a_larger_angle_that_explains_all_as_well_is_no_evidence_by_itself():
    # Inertia and friction of one axis without gravity fit a motion of any size: only the robot file tells it.
    robot = replace(random_chain(2, 1, slides=0.0), gravity_m_s2=np.zeros(3))
    motions = Motions((Channel(robot.joints[0].name, "angle", "rad"),), np.array([0]), ())
    motion = fourier_motion(robot, 6000)
    poor, found = _found(robot, shot_along(robot, motion * np.pi / 180, 10.0), motions)
    assert poor
    assert found == ()
    moved = shot_along(robot, motion, 0.3)
    poor, found = _found(robot, replace(moved, position=moved.position * np.pi / 180), motions)
    assert poor
    assert [str(each.scales[0]) for each in found] == ["motor_angle / 180/pi"]
