"""Logs of two inertias with a spring between them, from their exact response."""

import numpy as np
from scipy.signal import cont2discrete

STIFFNESS, DAMPING, MOTOR, LOAD = 546.0, 0.2, 4.8e-3, 4.7e-3
PERIOD_S, STEP_S, N_PERIOD = 0.5, 1e-3, 5
LINES = np.arange(10, 81)


def two_mass(samples, stiffness_nm_rad):
    """Exact steady-state angles (2, n_sample) of the held current's period."""
    stiffness, damping = (
        value / np.array([[MOTOR], [LOAD]]) * np.array([[1, -1], [-1, 1]]) for value in (stiffness_nm_rad, DAMPING)
    )
    continuous = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damping]])
    state, gain, output, *_ = cont2discrete(
        (continuous, np.array([[0], [0], [1 / MOTOR], [0]]), np.eye(4)[:2], np.zeros((2, 1))), STEP_S
    )
    spectrum = np.fft.rfft(samples)
    angle = np.zeros((2, spectrum.size), complex)
    for line in LINES:
        shift = np.exp(2j * np.pi * line / samples.size)
        angle[:, line] = (output @ np.linalg.solve(shift * np.eye(4) - state, gain))[:, 0] * spectrum[line]
    return np.fft.irfft(angle, samples.size)


def bench_log(stiffness_nm_rad=STIFFNESS, seed=3):
    """Five periods of a log whose load angle counts the other way, in degrees."""
    generator = np.random.default_rng(seed)
    n_sample = round(PERIOD_S / STEP_S)
    spectrum = np.zeros(n_sample // 2 + 1, complex)
    spectrum[LINES] = 20 * np.exp(2j * np.pi * generator.uniform(size=LINES.size))
    current = np.fft.irfft(spectrum, n_sample)
    motor, load = two_mass(current, stiffness_nm_rad)
    columns = {"current": current, "motor": motor, "load": -np.rad2deg(load)}
    log = {name: np.tile(values, N_PERIOD)[:, None] for name, values in columns.items()}
    for name in ("motor", "load"):
        log[name] += 1e-3 * log[name].std() * generator.normal(size=log[name].shape)
    log["time"] = np.arange(n_sample * N_PERIOD)[:, None] * STEP_S * 1e3
    return log
