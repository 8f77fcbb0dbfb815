"""Outputs of an elastic robot behind held, delayed torques, exactly as they are sampled."""

import numpy as np
from scipy.linalg import expm

from robid.robot.statespace import state_space


def exact_acceleration(linear, parameters, frequency_hz, period_s, rate):
    """Acceleration that stands for outputs of one rate sampled behind a held, delayed torque (n_freq, n_out, n_in)."""
    n_out, n_in = linear.output.shape[1], linear.n_motor
    names = [tuple(f"{word}{index}" for index in range(count)) for word, count in
             (("m", n_in), ("s", linear.mass.shape[-1] - n_in), ("o", n_out))]  # fmt: skip
    system = state_space(linear, parameters, 0, *names)
    rows = slice(rate * n_out, (rate + 1) * n_out)
    samples = float(parameters.delay[0]) / period_s
    whole = np.floor(samples + 1e-9)
    part, n = max(samples - whole, 0.0), len(system.A)
    generator = np.zeros((n + n_in, n + n_in))
    # Speeds in units per period, so that both halves of the state are of one size.
    unit = np.r_[np.ones(n // 2), np.full(n // 2, period_s)]
    generator[:n, :n] = unit[:, None] * system.A / unit * period_s
    generator[:n, n:] = unit[:, None] * system.B * period_s
    first, second = expm(generator * part), expm(generator * (1 - part))
    step = second[:n, :n] @ first[:n, :n]
    found = []
    for omega in 2 * np.pi * frequency_hz:
        z = np.exp(1j * omega * period_s)
        drive = second[:n, n:] + second[:n, :n] @ first[:n, n:] / z
        state = np.linalg.solve(z * np.eye(n) - step, drive)
        # A torque that acts from an instant on is not in the acceleration of that instant.
        seen = (system.C[rows] / unit) @ state + system.D[rows] / z
        found.append((1j * omega) ** (2 - rate) * seen * z**-whole)
    return np.array(found)
