"""A motor is told from its load by the response, whatever their inertias, ratio, signs and band."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, dlsim

from robid.logs.inspection.relations import sense_of_inertia, spectrum_of
from robid.logs.inspection.sides import find_motor, is_behind_spring

STEP, COUNT = 1e-3, 10_000


def play(motor, load, antiresonance_hz, band, *, noise=0.0, grounded=False, seed=0):
    """Torque and both angles of a drive under a multisine; grounded by a spring where it hangs."""
    generator = np.random.default_rng(seed)
    k = load * (2 * np.pi * antiresonance_hz) ** 2
    c = 0.04 * np.sqrt(k * load)
    ground = (2 * np.pi * 2.0) ** 2 * load if grounded else 0.0
    stiffness = np.array([[k, -k], [-k, k + ground]])
    damping = np.array([[c + motor, -c], [-c, c + load]])
    inverse = np.diag([1 / motor, 1 / load])
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])
    system = (a, np.array([[0], [0], [1 / motor], [0]]), np.eye(2, 4), np.zeros((2, 1)))
    period = COUNT // 5
    spectrum = np.zeros(period // 2 + 1, complex)
    lines = np.arange(max(1, round(band[0] * period * STEP)), round(band[1] * period * STEP))
    spectrum[lines] = np.exp(2j * np.pi * generator.random(len(lines)))
    torque = np.tile(np.fft.irfft(spectrum, period), 5) * np.sqrt(period)
    _, angles, _ = dlsim((*cont2discrete(system, STEP)[:4], STEP), torque)
    angles = angles + noise * angles.std(axis=0) * generator.normal(size=angles.shape)
    return torque, angles[:, 0], angles[:, 1]


def spectra(*signals):
    return [spectrum_of(one, STEP) for one in signals]


@pytest.mark.parametrize("motor", [0.2, 1.0, 3.0, 10.0])
@pytest.mark.parametrize(("antiresonance_hz", "band"), [(8, (1, 60)), (30, (2, 25)), (8, (20, 100)), (30, (10, 90))])
@pytest.mark.parametrize("ratio", [1.0, -121.0])
def test_the_motor_is_the_one_that_the_torque_reaches_first(motor, antiresonance_hz, band, ratio):
    torque, first, second = play(motor, 1.0, antiresonance_hz, band, noise=1e-7)
    u, x, y = spectra(torque, first, second / ratio)
    assert find_motor(u, x, y, (2, 2), STEP).first
    found = find_motor(u, y, x, (2, 2), STEP)
    assert not found.first
    assert found.is_seen == (band[0] <= antiresonance_hz <= band[1])
    if found.is_seen:
        assert found.antiresonance == pytest.approx(2 * np.pi * antiresonance_hz, rel=0.05)


def test_speeds_and_angles_are_compared_as_well():
    torque, first, second = play(3.0, 1.0, 12, (1, 60))
    u, x, y = spectra(torque, np.gradient(first, STEP), second)
    assert find_motor(u, x, y, (1, 2), STEP).first


@pytest.mark.parametrize(("antiresonance_hz", "noise"), [(200, 1e-3), (12, 3.0)])
def test_what_the_response_does_not_tell_is_left_open(antiresonance_hz, noise):
    torque, first, second = play(1.0, 1.0, antiresonance_hz, (1, 15), noise=noise)
    u, x, y = spectra(torque, first, second)
    assert find_motor(u, x, y, (2, 2), STEP) is None


@pytest.mark.parametrize("motor", [0.3, 1.0, 5.0])
def test_a_lone_load_is_told_from_a_lone_motor(motor):
    torque, first, second = play(motor, 1.0, 12, (1, 60))
    u, x, y = spectra(torque, first, second)
    assert not is_behind_spring(u, x, 2, STEP)
    assert is_behind_spring(u, y, 2, STEP)


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("grounded", [False, True])
def test_the_sign_of_a_motor_is_that_of_its_inertia_even_where_a_spring_holds_it(sign, grounded):
    torque, first, _ = play(1.0, 0.1, 60, (1.0, 10), grounded=grounded)
    u, x = spectra(torque, sign * first)
    assert sign * sense_of_inertia(u, x, 2, (0.0, 2 * np.pi * 10)) > 0.9
