"""A payload of known parameters under an arm, from motions with and without it: its intervals hold the truth."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_robots import random_body
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.shots import Shot
from robid.robot.description import Joint, Motor, Robot
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.links import COMPONENTS
from robid.robot.regressor.model import build_rigid_model

OPTIONS = RigidFitOptions(
    model=RigidOptions(friction="viscous", payload="body"), filters=PreprocessingOptions(position_cut_hz=20.0)
)
PERIOD_S, N_SAMPLE = 2e-3, 2500
ANGLE_NOISE, TORQUE_NOISE = 2e-6, 0.2
NAMES = [f"payload.{component}" for component in COMPONENTS]


def arm(axes):
    """Links whose axes are turned by the given angles about x against each other, with gears of ratio 1."""
    generator, joints = np.random.default_rng(8), []
    for index, angle in enumerate(np.deg2rad(axes)):
        turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
        place = np.array([0.5, 0.1, 0.0]) if index else np.zeros(3)
        joints.append(
            Joint(f"joint{index + 1}", place, turn, random_body(generator), -3, 3, Motor(1e-3, 1.0, 1e2, 1e3))
        )
    return Robot("arm", np.array([0.0, 0.0, -9.81]), tuple(joints), (), random_body(generator))


def record(model, seed, loaded):
    """A shot of smooth random motion of all joints, with noise."""
    generator, n_joint = np.random.default_rng(seed), len(model.robot.joints)
    time, motion = np.arange(N_SAMPLE) * PERIOD_S, np.zeros((3, N_SAMPLE, n_joint))
    for hertz in (0.2, 0.5, 0.9, 1.6):
        size, phase = generator.uniform(0.3, 0.6, n_joint) / np.sqrt(hertz), generator.uniform(0, 2 * np.pi, n_joint)
        omega = 2 * np.pi * hertz
        angle = omega * time[:, None] + phase
        motion += size * np.array([np.sin(angle), omega * np.cos(angle), -(omega**2) * np.sin(angle)])
    torque = model.torques(model.nominal, *motion, loaded=loaded)
    torque += TORQUE_NOISE * generator.standard_normal(torque.shape)
    noise = ANGLE_NOISE * generator.standard_normal(motion[0].shape)
    return Shot(motion[0] + noise, torque, PERIOD_S, held=False, loaded=loaded)


def fitted(true, nominal, seed):
    model = build_rigid_model(true, OPTIONS.model)
    shots = [record(model, 2 * seed, loaded=False), record(model, 2 * seed + 1, loaded=True)]
    return fit_rigid(nominal, shots, OPTIONS)


@pytest.fixture(scope="module")
def runs():
    """Fits of a robot whose file knows neither link nor payload well."""
    true = arm((0, 90, 0))
    heavier = [replace(joint, link=replace(joint.link, mass_kg=1.1 * joint.link.mass_kg)) for joint in true.joints]
    guessed = replace(true.payload, mass_kg=2.0, inertia_kgm2=0.2 * np.eye(3))
    nominal = replace(true, joints=tuple(heavier), payload=guessed)
    truth = build_rigid_model(true, OPTIONS.model)
    return dict(zip(truth.names, truth.nominal.tolist(), strict=True)), [fitted(true, nominal, s) for s in range(12)]


def test_intervals_of_all_ten_parameters_hold_the_truth(runs):
    truth, found = runs
    held = []
    for solution in found:
        estimate = solution.estimate
        at = [estimate.names.index(name) for name in NAMES]
        wanted = np.array([truth[name] for name in NAMES])
        # Torque constants are exact here: residuals alone are what may be off.
        lower, upper = (each[at] for each in estimate.effective_interval)
        held.append((lower <= wanted) & (wanted <= upper))
    share = float(np.mean(held))
    print(f"payload: {share:.3f} of {np.size(held)} intervals of 95 % hold the truth")
    # Ten parameters of twelve runs, correlated within a run: 0.95 +- 0.03.
    assert 0.87 <= share <= 0.995


def test_estimates_scatter_about_the_truth_as_they_say(runs):
    truth, found = runs
    at = [found[0].estimate.names.index(name) for name in NAMES]
    values = np.array([solution.estimate.value[at] for solution in found])
    std = np.array([np.sqrt(np.diag(solution.estimate.covariance))[at] for solution in found])
    pull = (values - [truth[name] for name in NAMES]) / std
    assert np.abs(pull.mean(axis=0)).max() < 4 / np.sqrt(len(found))
    assert 0.7 < np.sqrt(np.mean(pull**2)) < 1.4
    mass = NAMES.index("payload.M")
    assert np.abs(values[:, mass] / truth["payload.M"] - 1).max() < 0.02


def test_a_payload_that_turns_about_parallel_axes_alone_shows_four_parameters():
    true = arm((0, 0))
    solution = fitted(true, true, 0)
    own = [name for name in solution.estimate.names if name.startswith("payload.")]
    assert own == ["payload.ZZ", "payload.MX", "payload.MY", "payload.M"]
    assert {"payload.XX", "payload.XY", "payload.XZ", "payload.YZ", "payload.MZ"} <= set(solution.base.silent)
