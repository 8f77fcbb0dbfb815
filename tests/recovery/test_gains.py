"""Gains of motors from a known load, of a heavy and a light robot arm: recovered, and inside their intervals."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import lfilter

from rigid_logs import PERIOD_S, fourier_motion
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.gains import estimate_gains
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.shots import Shot
from robid.models.rigid.judge.plausible import assess_rigid
from robid.results.grade import DO_NOT_USE
from robid.robot.description import Inertial
from robid.robot.nuisance import NuisanceStd
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model
from robid.settings.load import load_robot

ROBOTS = Path(__file__).parents[2] / "configs" / "robots"
FILTERS = PreprocessingOptions(position_cut_hz=10.0)
OPTIONS = RigidFitOptions(filters=FILTERS)
N_DRAW, N_SAMPLE, WARM_UP = 30, 9000, 500
LARGEST, NOISE, COLOUR = 0.15, 0.02, 0.9
EXACT = NuisanceStd(payload_relative_std=0.0, payload_com_m=0.0, payload_inertia_relative_std=0.0)
DOUBTED = NuisanceStd(payload_com_m=0.005)


def _with_true_load(robot, generator):
    """The robot with a payload that its file has wrong by as much as it doubts it."""
    std, load = robot.nuisance_std, robot.payload
    heavier = 1 + std.payload_relative_std * generator.standard_normal()
    centre = load.com_m + std.payload_com_m * generator.standard_normal(3)
    inert = heavier + std.payload_inertia_relative_std * generator.standard_normal()
    return replace(robot, payload=Inertial(heavier * load.mass_kg, centre, inert * load.inertia_kgm2))


def _records(robot, gain, generator):
    """Records without and with the payload, whose torques are stated by wrong constants and have coloured noise."""
    model = build_rigid_model(robot, RigidOptions(payload="body"))
    path, shots = fourier_motion(robot, N_SAMPLE) @ robot.motor_per_arm.T, []
    for loaded in (False, True):
        torque = model.torques(model.nominal, *path, loaded=loaded)
        white = generator.standard_normal((N_SAMPLE + WARM_UP, len(gain)))
        coloured = lfilter([np.sqrt(1 - COLOUR**2)], [1, -COLOUR], white, axis=0)[WARM_UP:]
        torque += NOISE * torque.std(axis=0) * coloured
        shots.append(Shot(path[0], torque / gain, PERIOD_S, held=False, loaded=loaded))
    return shots


def robot_of(name, data_folder, doubts):
    if name == "ur5e":  # its model lies there
        data_folder("robot_models")
    return replace(load_robot(ROBOTS / f"{name}.yaml").to_robot(), nuisance_std=doubts)


@pytest.mark.parametrize("doubts", [EXACT, DOUBTED], ids=["known load", "doubted load"])
@pytest.mark.parametrize("name", ["kr300", "ur5e"])
def test_gains_are_recovered_and_their_intervals_hold_them(name, doubts, data_folder):
    robot, off, scaled = robot_of(name, data_folder, doubts), [], []
    for seed in range(N_DRAW):
        generator = np.random.default_rng(seed)
        gain = 1 + LARGEST * generator.uniform(-1, 1, len(robot.joints))
        shots = _records(_with_true_load(robot, generator), gain, generator)
        found = estimate_gains(robot, shots, FILTERS, OPTIONS)
        assert found.determined.all()
        off.append(found.gain / gain - 1)
        scaled.append((found.gain - gain) / found.half_width(0.95))
    share, each = np.mean(np.abs(scaled) < 1), 1.96 * np.sqrt(np.mean(np.square(scaled), axis=0))
    print(f"gains, {name}: {share:.3f} of {np.size(scaled)} intervals of 95 % hold them, off by {np.std(off):.4f}")
    # A load that is doubted moves all gains of a draw alike: 30 draws count, of which 23 or fewer have a chance of
    # 0.1 %.
    assert share >= 24 / 30
    assert 0.7 < np.sqrt(np.mean(each**2)) < 1.3
    assert np.std(off) < (0.01 if doubts is EXACT else 0.05)


@pytest.mark.parametrize(("share", "named"), [(1.0, False), (0.75, False), (0.3, True)])
def test_a_load_that_is_far_from_what_was_carried_is_named(share, named, data_folder):
    robot = robot_of("ur5e", data_folder, EXACT)
    load = robot.payload
    true = Inertial(share * load.mass_kg, load.com_m, share * load.inertia_kgm2)
    shots = _records(replace(robot, payload=true), np.ones(len(robot.joints)), np.random.default_rng(3))
    options = replace(OPTIONS, gain_std=0.1, model=RigidOptions(payload="body"), physical=False)
    grade = assess_rigid(robot, fit_rigid(robot, shots, options), options)
    assert (grade.causes[:1] == ("payload",)) is named
    assert (grade.value == DO_NOT_USE) is named
