"""The branch: its motion within all limits, its record against the inverse dynamics."""

from pathlib import Path

import numpy as np
import pytest

from robid.errors import DataError
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.settings.load import load_robot
from robid.signals.filters import central_differences
from robid.studies.janot2009.branch import Branch, make_rig, record_branch
from robid.studies.janot2009.seeded import identify
from robid.studies.settings.parts import BranchCase

FILE = load_robot(Path(__file__).parents[4] / "configs/robots/branch.yaml")
MIDDLE = np.deg2rad([0.0, 25, -90])


def branch(**changes):
    settings = {"campaign": "motion", "harmonics": 5, "duration_s": 4.0, "draws": 10} | changes
    return Branch(BranchCase(**settings), FILE.to_robot(), FILE.controller, MIDDLE)


def test_the_motion_stays_within_the_limits_of_joints_and_torques():
    rig = make_rig(branch(range_share=0.8, torque_share=0.8))
    robot, period = rig.branch.robot, rig.branch.controller.sampling_period_s
    arm = rig.command @ robot.arm_per_motor.T
    room = np.minimum(robot.upper - MIDDLE, MIDDLE - robot.lower)
    np.testing.assert_allclose(np.abs(arm - MIDDLE).max(axis=0) / room, 0.8, rtol=2e-3)
    torque = rig.model.torques(rig.truth, rig.command[1:-1], *central_differences(rig.command, period))
    assert np.abs(torque).max() < 0.81 * robot.joints[0].motor.max_torque_nm


def test_the_motion_begins_at_rest():
    rig = make_rig(branch())
    speed = np.abs(np.diff(rig.command, axis=0))
    assert speed[0].max() < 0.02 * speed.max()


def test_a_better_draw_is_taken():
    def condition(draws):
        rig = make_rig(branch(draws=draws))
        velocity, acceleration = central_differences(rig.command, 1e-3)
        columns = rig.model.columns(rig.command[1:-1], velocity, acceleration).reshape(-1, len(rig.truth))
        return np.linalg.cond(columns / np.linalg.norm(columns, axis=0))

    assert condition(30) < condition(1)


def test_motions_beyond_the_torques_are_refused():
    with pytest.raises(DataError, match="D220") as caught:
        make_rig(branch(torque_share=0.01))
    assert "range_share" in caught.value.remedy


def test_a_record_obeys_the_inverse_dynamics():
    rig = make_rig(branch(duration_s=1.0, harmonics=1, torque_noise_nm=0.0, resolution_rad=0.0))
    exact = record_branch(rig, range(1, 3))
    np.testing.assert_array_equal(exact.position[0], exact.position[1])
    period = exact.sampling_period_s
    position, torque = exact.position[0], exact.torque[0]
    velocity, acceleration = central_differences(position, period)
    needed = rig.model.torques(rig.truth, position[1:-1], velocity, acceleration)
    centred = 0.5 * (torque[1:-1] + torque[:-2])
    moving = np.abs(velocity) > 0.5
    assert np.abs(needed - centred)[moving].max() < 1e-3 * np.abs(centred).max()


def test_encoders_round_in_the_loop_and_torques_have_noise():
    short = {"duration_s": 0.3, "harmonics": 1, "resolution_rad": 1e-3, "range_share": 0.05}
    quiet, noisy = (
        record_branch(make_rig(branch(torque_noise_nm=noise, **short)), range(1, 3)) for noise in (0.0, 0.01)
    )
    steps = np.diff(quiet.position, axis=1) / 1e-3
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-6)
    assert np.abs(quiet.torque[0] - quiet.torque[1]).max() > 1e-3  # each seed's encoders have zeros of their own
    np.testing.assert_array_equal(quiet.position, noisy.position)
    noise = noisy.torque - quiet.torque
    assert noise.std() == pytest.approx(0.01, rel=0.1)
    assert abs(np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]) < 0.2


@pytest.mark.slow
def test_filters_decide_the_verdict():
    rig = make_rig(branch(torque_noise_nm=0.01))
    recording = record_branch(rig, range(500, 502))
    for cut_hz, trusted in ((20.0, 1), (200.0, 0)):
        found = identify(rig.machine, recording, PreprocessingOptions(cut_hz, drop_deviations=15.0))
        assert [one.verdict.trust for one in found.conclusions] == [trusted] * 2
