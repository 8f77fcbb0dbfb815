"""Encoders on the arm side: lag against shifted motions, play and eccentricity against closed forms."""

from dataclasses import replace

import numpy as np
import pytest
from mujoco.batch import Batch

from elastic_loops import CONFIGURATION, experiment
from exact_systems import linear_axis, two_joint_robot, two_mass_robot
from robid.robot.model import build_model
from robid.simulate.experiment import simulate
from robid.simulate.late import Late
from robid.simulate.link_encoders import LinkEncoders
from robid.simulate.options import Imperfections

PERIOD_S = 1e-3
ARMS = ("shoulder.arm", "elbow.arm")


def shown(flaws, path, rate=None, robot=None):
    """What the encoder of one joint shows (n_sample,) of a path (n_sample,)."""
    model = build_model(robot or two_mass_robot())
    batch = Batch(model.mujoco, 1, nthread=1)
    batch.qpos[:, model.arm] = path[0]
    batch.qvel[:, model.arm] = 0.0 if rate is None else rate[0]
    encoders, found = LinkEncoders(model, batch, [0], flaws, PERIOD_S), []
    for row, position in enumerate(path):
        batch.qpos[:, model.arm] = position
        batch.qvel[:, model.arm] = 0.0 if rate is None else rate[row]
        found.append(encoders.read()[0, 0])
    return np.array(found)


@pytest.mark.parametrize("lag_s", [1e-3, 0.3e-3, 2.8e-3])
def test_a_lag_shifts_a_smooth_motion(lag_s):
    time, omega = np.arange(400) * PERIOD_S, 2 * np.pi * 8.0
    found = shown(Imperfections(link_encoder_lag_s=lag_s), np.sin(omega * time), omega * np.cos(omega * time))
    # Hermite's cubic is off by (w T)^4 / 384 at most.
    error = np.abs(found - np.sin(omega * (time - lag_s)))[5:]
    assert error.max() < 1.05 * (omega * PERIOD_S) ** 4 / 384 + 1e-12
    if lag_s == 0.3e-3:
        assert error.max() > 0.1 * (omega * PERIOD_S) ** 4 / 384


def test_channels_are_late_each_by_its_own_lag():
    rng, late = np.random.default_rng(0), Late(np.array([0.0, 2e-3, 1.5e-3]), PERIOD_S)
    cubic = rng.standard_normal((4, 3))
    powers = np.arange(4)

    def at(time):
        value = (time[..., None] ** powers * cubic.T).sum(-1)
        slope = (powers[1:] * time[..., None] ** powers[:-1] * cubic.T[:, 1:]).sum(-1)
        return value[None], slope[None]

    late.begin(*at(np.zeros(3)))
    for sample in range(8):
        found = late.read(*at(np.full(3, sample * PERIOD_S)))
    wanted = at(7 * PERIOD_S - np.array([0.0, 2e-3, 1.5e-3]))[0]
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


def test_a_lag_in_closed_loop_turns_the_encoders_by_its_phase():
    lag_s, run = 2.8e-3, replace(experiment(rms=2.0, transient_periods=3), outputs=ARMS)
    flaws = Imperfections(link_encoder_lag_s=lag_s)
    plain = simulate(run, CONFIGURATION, 0)
    late = simulate(replace(run, options=replace(run.options, imperfections=flaws)), CONFIGURATION, 0)
    np.testing.assert_array_equal(late.outputs[..., :2], plain.outputs[..., :2])
    np.testing.assert_array_equal(late.inputs, plain.inputs)
    spectra = [np.fft.rfft(each.outputs[0, 0, 0, 0, :, 2:], axis=0)[run.excited_lines] for each in (late, plain)]
    omega = np.pi * run.excited_lines  # lines lie 0.5 Hz apart
    assert np.abs(spectra[0] / spectra[1] - np.exp(-1j * omega * lag_s)[:, None]).max() < 2e-3


@pytest.mark.parametrize("play", [0.2, 1.5, 3.0])
def test_a_loose_shaft_follows_the_play_operator(play):
    turn = np.linspace(0, 4 * np.pi, 4001)
    arm, half = np.sin(turn), play / 2
    found = shown(Imperfections(link_encoder_play_rad=play), arm)
    if play >= 2:
        assert not found.any()
        return
    way = np.cos(turn)
    settled = turn > np.pi / 2
    # From a turning point on, the shaft stays until the arm has gone the full width back.
    wanted = np.where(way < 0, np.minimum(arm + half, 1 - half), np.maximum(arm - half, half - 1))
    np.testing.assert_allclose(found[settled], wanted[settled], atol=1e-5)
    early = turn < np.pi / 2
    np.testing.assert_allclose(found[early], np.maximum(arm - half, 0)[early], atol=1e-12)


def test_a_late_loose_shaft_keeps_its_place_while_the_arm_moves():
    time = np.arange(300) * PERIOD_S
    arm, rate = 0.1 * np.sin(8 * time), 0.8 * np.cos(8 * time)
    found = shown(Imperfections(link_encoder_play_rad=0.02, link_encoder_lag_s=0.5e-3), arm, rate)
    top = (time > np.pi / 16 + 0.004) & (arm > 0.085)
    assert top.sum() > 20
    np.testing.assert_allclose(found[top], 0.09, atol=1e-5)


def test_an_encoder_that_is_not_centred_errs_over_its_turn():
    arm = np.linspace(-4, 4, 101)
    flaws = Imperfections(link_encoder_eccentricity_rad=0.01, link_encoder_eccentricity_phase_rad=0.7)
    np.testing.assert_allclose(shown(flaws, arm), arm + 0.01 * np.sin(arm + 0.7), rtol=1e-14)


def test_a_slides_encoder_is_late_but_neither_loose_nor_off_centre():
    path = np.linspace(0, 0.1, 50)
    rate = np.full(50, 0.1 / 49 / PERIOD_S)
    flaws = Imperfections(link_encoder_play_rad=0.02, link_encoder_eccentricity_rad=0.01)
    np.testing.assert_array_equal(shown(flaws, path, rate, linear_axis()), path)
    late = shown(replace(flaws, link_encoder_lag_s=1.5e-3), path, rate, linear_axis())
    np.testing.assert_allclose(late, path - 1.5 * 0.1 / 49, atol=1e-15)


def test_rounding_comes_last():
    step = 1e-5
    flaws = Imperfections(
        link_encoder_resolution_rad=step, link_encoder_play_rad=1e-4, link_encoder_eccentricity_rad=1e-3
    )
    run = replace(experiment(two_joint_robot(), rms=5.0, imperfections=flaws), outputs=ARMS)
    record = simulate(run, CONFIGURATION, 0)
    seen = (record.outputs + record.output_offset)[..., 2:] / step
    np.testing.assert_allclose(seen, np.rint(seen), atol=1e-6)
