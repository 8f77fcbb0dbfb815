"""A slow motion that keeps the motors moving, and the lines that it and what it stirs up occupy."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray


def slow_motion(
    amplitude: float, line: int, n_real: int, n_motor: int, n_sample: int, generator: np.random.Generator
) -> FloatArray:
    """Returns a sine of one low line for every motor and experiment.

    Friction answers it at odd multiples of the line, ripple and gear mesh at sidebands that are multiples of it too,
    since the motor angle repeats with it. The motors reverse one after the other, never all at once, in another
    order of phases in each experiment; each realization begins at random.

    Args:
        amplitude: Peak [any unit].
        line: DFT line.
        n_real: Number of realizations.
        n_motor: Number of motors and of experiments.
        n_sample: Samples of one period.
        generator: Draws the phase of each realization.

    Returns:
        The signal (n_real, n_exp, n_sample, n_motor).
    """
    motor = np.arange(n_motor)
    start = generator.uniform(0, 2 * np.pi, (n_real, 1, 1, 1))
    # Reversals of a motor are half a turn apart: the motors share that half.
    phase = np.pi * (motor[None, :] + motor[:, None]) / n_motor
    turn = 2 * np.pi * line * np.arange(n_sample) / n_sample
    return np.asarray(amplitude * np.cos(turn[None, None, :, None] + start + phase[None, :, None, :]))
