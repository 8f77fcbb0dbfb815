"""Gains of motors from a known load: recovered, inside their intervals, and the prior's where nothing tells them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from rigid_logs import PERIOD_S, fourier_motion
from rigid_robots import random_chain
from robid.errors import DataError
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.gains import corrected, estimate_gains
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.shots import Shot
from robid.robot.description import Inertial
from robid.robot.nuisance import NuisanceStd
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model

FILTERS = PreprocessingOptions(position_cut_hz=10.0)
OPTIONS = RigidFitOptions(filters=FILTERS)
N_DRAW = 30
WARM_UP = 500
EXACT = NuisanceStd(payload_relative_std=0.0, payload_com_m=0.0, payload_inertia_relative_std=0.0)


def _arm(scale):
    """A chain with a payload as heavy as a link, all masses and inertias multiplied."""
    robot = replace(random_chain(4, 3, slides=0.0), gravity_m_s2=np.array([0.0, 0.0, -9.81]))
    joints = tuple(
        replace(
            joint,
            link=replace(joint.link, mass_kg=scale * joint.link.mass_kg, inertia_kgm2=scale * joint.link.inertia_kgm2),
        )
        for joint in robot.joints
    )
    mass = scale * robot.joints[-1].link.mass_kg
    payload = Inertial(mass, np.array([0.1, 0.05, 0.15]), 0.01 * mass * np.eye(3))
    return replace(robot, joints=joints, payload=payload)


def _pair(robot, gain, noise, seed, n_sample=4000, colour=0.0):
    """Records of one motion without and with the payload, whose torques are stated by wrong constants."""
    generator, shots = np.random.default_rng(seed), []
    model = build_rigid_model(robot, RigidOptions(payload="body"))
    path = fourier_motion(robot, n_sample) @ robot.motor_per_arm.T
    for loaded in (False, True):
        torque = model.torques(model.nominal, *path, loaded=loaded)
        # Noise of first order, of the same deviation whatever its colour.
        white = generator.standard_normal((n_sample + WARM_UP, len(gain)))
        coloured = lfilter([np.sqrt(1 - colour**2)], [1, -colour], white, axis=0)[WARM_UP:]
        torque += noise * torque.std(axis=0) * coloured
        shots.append(Shot(path[0], torque / gain, PERIOD_S, held=False, loaded=loaded))
    return shots


@pytest.mark.parametrize(("scale", "colour"), [(1.0, 0.0), (40.0, 0.98)])
def test_gains_are_recovered_and_their_intervals_hold_them(scale, colour):
    robot, gain, off = replace(_arm(scale), nuisance_std=EXACT), np.array([1.15, 0.87, 1.06]), []
    for seed in range(N_DRAW):
        found = estimate_gains(robot, _pair(robot, gain, 0.02, seed, colour=colour), FILTERS, OPTIONS)
        assert found.determined.all()
        off.append((found.gain - gain) / found.half_width(0.95))
    # 90 intervals, three of a draw correlated: fewer than 79 held has a chance of 1 % or less.
    assert np.sum(np.abs(off) < 1) >= 79
    assert 0.7 < 1.96 * np.sqrt(np.mean(np.square(off))) < 1.4


def test_corrected_torques_are_those_that_the_motors_had():
    robot, gain = replace(_arm(1.0), nuisance_std=EXACT), np.array([1.15, 0.87, 1.06])
    stated, true = (_pair(robot, each, 0.0, 0) for each in (gain, np.ones(3)))
    noisy = _pair(robot, gain, 0.001, 0)
    found = estimate_gains(robot, noisy, FILTERS, OPTIONS)
    for one, other in zip(corrected(stated, found), true, strict=True):
        np.testing.assert_allclose(one.torque, other.torque, rtol=0.01)
    assert corrected(stated, None) == tuple(stated)


def test_nothing_is_known_better_than_the_load_that_tells_the_gains():
    robot = replace(_arm(1.0), nuisance_std=replace(EXACT, payload_relative_std=0.1))
    options = replace(OPTIONS, model=RigidOptions(payload="body"), gain_std=0.5)
    found = fit_rigid(robot, _pair(robot, np.array([1.15, 0.87, 1.06]), 0.001, 0), options).estimate
    # All gains are off alike by the load's 10 %, and all parameters with them; the constants' own doubt is 2 %.
    assert found.relative_half_width.min() > 1.96 * 0.09
    predicted = (found.effective_upper - found.effective_lower) / 2 / np.abs(found.value)
    assert predicted.min() < 0.01


def test_a_motor_that_the_load_does_not_move_keeps_its_prior():
    robot = _arm(1.0)
    turn, lift = robot.joints[:2]
    upright = {"position_m": np.zeros(3), "rotation": np.eye(3)}
    joints = replace(turn, **upright), replace(lift, type="prismatic", **upright)
    # A point on the vertical axis: lifting it takes a force, turning it nothing.
    load = Inertial(5.0, np.array([0.0, 0.0, 0.1]), np.zeros((3, 3)))
    robot = replace(robot, joints=joints, payload=load, nuisance_std=EXACT)
    found = estimate_gains(robot, _pair(robot, np.array([1.1, 0.9]), 0.02, 0), FILTERS, OPTIONS, prior_std=0.08)
    assert found.determined.tolist() == [False, True]
    assert found.gain[0] == pytest.approx(1.0, abs=0.01)
    assert found.deviation[0] == pytest.approx(0.08, rel=0.05)
    assert found.gain[1] == pytest.approx(0.9, abs=4 * found.deviation[1])


def test_gains_need_both_kinds_of_records_and_a_load():
    robot = _arm(1.0)
    shots = _pair(robot, np.ones(3), 0.02, 0)
    empty = replace(robot, payload=replace(robot.payload, mass_kg=0.0))
    growing = replace(OPTIONS, model=RigidOptions(friction="load"))
    currents = [replace(shot, torque_unit="A") for shot in shots]
    tried = (robot, shots[1:], OPTIONS), (empty, shots, OPTIONS), (robot, shots, growing), (robot, currents, OPTIONS)
    codes = []
    for arm, given, options in tried:
        with pytest.raises(DataError) as caught:
            estimate_gains(arm, given, FILTERS, options)
        codes += caught.value.codes
    assert codes == ["D452", "D452", "D453", "D494"]
