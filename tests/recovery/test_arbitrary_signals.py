"""Logs of signals that nobody designed, on the simulated KR300: responses within their own bands, with figures."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from arbitrary_logs import SIGNALS, STEP_S, play, truth
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.models.files import load_experiment
from robid.pipeline.estimate_frf import stated_law
from robid.simulate.options import Imperfections

pytestmark = pytest.mark.slow

SECONDS, RESOLUTION_HZ, LOGS = 30, 0.5, 6
CONFIGURATION = np.deg2rad([0.0, -70.0, 60.0, 20.0, 40.0, 0.0])
NOISE = Imperfections(encoder_noise_rad=1e-5, torque_noise_nm=0.05)
LOCAL = EstimateOptions(estimator="local", compensation="none")


@pytest.fixture(scope="module")
def kr300():
    loaded = load_experiment(Path(__file__).parents[2] / "configs/kr300_linear.yaml")
    return loaded.robot.to_robot()


def estimated(robot, name, flaws, *, reference, compensated=False):
    n_motor = len(robot.joints)
    signal = np.stack([SIGNALS[name](round(SECONDS / STEP_S), n_motor, seed) for seed in range(LOGS)])
    record = play(robot, signal, CONFIGURATION, flaws)
    segments = round(SECONDS * RESOLUTION_HZ)
    lines = np.arange(round(3 / RESOLUTION_HZ), round(60 / RESOLUTION_HZ) + 1)
    record = replace(record, excited_lines=lines * segments, segments=segments)
    record = record if reference else replace(record, reference=None, reference_channels=())
    if not compensated:
        return estimate_frf(record, LOCAL)
    laws = tuple(stated_law(joint.motor) for joint in robot.joints)
    return estimate_frf(record, replace(LOCAL, compensation="nominal"), laws, STEP_S)


def coverage(frf, robot):
    """Share of the elements that are kept, of all and of the motors' own, that lie within their 95 % bands."""
    wanted, radius = truth(robot, CONFIGURATION, frf.frequency_hz), frf.error_radius(0.95)[0]
    inside, kept, own = np.abs(frf.response[0] - wanted) <= radius, np.isfinite(radius), np.arange(len(robot.joints))
    relative = (radius / np.abs(wanted))[:, own, own]
    return (
        float(inside[kept].mean()),
        float(inside[:, own, own][kept[:, own, own]].mean()),
        float(kept.mean()),
        float(np.median(relative[np.isfinite(relative)])),
    )


@pytest.mark.parametrize("reference", [False, True])
@pytest.mark.parametrize("name", list(SIGNALS))
def test_responses_of_the_linear_robot_lie_within_their_bands(kr300, name, reference):
    shares = coverage(estimated(kr300, name, NOISE, reference=reference), kr300)
    print(
        f"\nlinear, {name}, reference {reference}: inside {shares[0]:.3f}, own {shares[1]:.3f}, kept {shares[2]:.3f},"
        f" median half-width {100 * shares[3]:.1f} %"
    )
    assert min(shares[:2]) >= 0.90
    assert shares[2] >= 0.95
    assert shares[3] < 0.25


@pytest.mark.parametrize("compensated", [False, True])
@pytest.mark.parametrize("name", list(SIGNALS))
def test_with_friction_the_share_is_printed_and_compensation_takes_most_of_the_error(kr300, name, compensated):
    frf = estimated(kr300, name, replace(NOISE, friction="lugre"), reference=True, compensated=compensated)
    shares, own = coverage(frf, kr300), np.arange(6)
    error = np.median(np.abs(frf.response[0] / truth(kr300, CONFIGURATION, frf.frequency_hz) - 1)[:, own, own])
    print(
        f"\nfriction, {name}, compensated {compensated}: inside {shares[0]:.3f}, own {shares[1]:.3f},"
        f" median half-width {100 * shares[3]:.1f} %, error {100 * error:.1f} %"
    )
    assert error < (0.02 if compensated else 0.5)
