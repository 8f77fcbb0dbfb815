"""What a cubic spring's slope under a swing is, against closed forms and a simulated oscillator."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robid.models.elastic.fit.gear_motion import Swinging, line_frequencies, spring_compliance, swing_shape


def lines_of(count, seed=1):
    generator = np.random.default_rng(seed)
    lines = 1 + 2 * np.sort(generator.choice(4 * count, count, replace=False))
    return lines, np.exp(2j * np.pi * generator.uniform(size=(count, 200)))


def test_many_lines_swing_like_a_normal_signal():
    lines, amplitude = lines_of(100)
    swinging = Swinging(0.0, 1e6, 1e-4 * amplitude, lines, np.zeros(1))
    assert swing_shape(swinging, np.ones(100)) == pytest.approx(1.0, abs=0.02)


def test_a_sine_about_a_bent_rest():
    """Half a normal signal's from the cube; from the doubled line a third of its square and of what it moves."""
    amplitude, rest, cubic, soft = 1e-4, 1e-3, 1e6, 1e-2
    compliance = np.array([7.0, 7.0, soft])
    swinging = Swinging(rest, cubic, np.array([[amplitude / 2 + 0j]]), np.array([1]), compliance)
    wanted = 0.5 - 3 * cubic * rest**2 * soft
    assert swing_shape(swinging, np.ones(1)) == pytest.approx(wanted, rel=3e-4)


def test_compliance_of_an_oscillator():
    omega = line_frequencies(np.array([2.0, 6.0]), np.array([1, 3]))
    np.testing.assert_allclose(omega, 4 * np.pi * np.arange(7))
    found = spring_compliance(tuple(np.diag([9.0, own]) for own in (2.0, 3.0, 4e4)), np.array([1]), omega)[:, 0]
    np.testing.assert_allclose(found[1:], 1 / (4e4 - 2 * omega[1:] ** 2 + 3j * omega[1:]))


def test_the_slope_of_a_simulated_oscillator():
    """Mass on a bent cubic spring under a multisine: the regression of its torque on its swing."""
    inertia, damping, linear, cubic, rest = 2.0, 60.0, 1e5, 4e9, 1.2e-3
    generator = np.random.default_rng(3)
    lines, period_s, count = 1 + 2 * np.arange(7), 1.0, 2048
    phases = generator.uniform(0, 2 * np.pi, lines.size)
    omega = 2 * np.pi * lines / period_s

    def moves(time, state):
        drive = 24 * np.cos(omega * time + phases).sum()
        bent = linear * state[0] + cubic * ((rest + state[0]) ** 3 - rest**3)
        return [state[1], (drive - damping * state[1] - bent) / inertia]

    times = np.arange(count) / count * period_s + 3 * period_s
    found = solve_ivp(moves, (0, times[-1]), [0.0, 0.0], t_eval=times, rtol=1e-8, atol=1e-11, max_step=2e-3)
    swing = np.fft.rfft(found.y[0])[lines] / count
    drive = 12 * np.exp(1j * phases)
    torque = drive - (1j * omega * damping - inertia * omega**2) * swing
    weight = np.abs(swing) ** 2
    true = float((weight * np.real(torque / swing)).sum() / weight.sum())
    square = found.y[0].var()
    mean = rest + found.y[0].mean()
    every = 2 * np.pi * np.arange(2 * lines.max() + 1)
    expected = linear + 3 * cubic * (mean**2 + square)
    matrices = tuple(np.array([[value]]) for value in (inertia, damping, expected))
    compliance = spring_compliance(matrices, np.array([0]), every)[:, 0]

    def slope(compliance):
        shape = swing_shape(Swinging(mean, cubic, swing[:, None], lines, compliance), weight)
        return linear + 3 * cubic * (mean**2 + shape * square)

    unmixed = slope(np.zeros(1)) - true
    assert unmixed > 0.005 * true
    assert abs(slope(compliance) - true) < 0.1 * unmixed
