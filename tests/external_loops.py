"""Loops seen from outside: plants of known poles, chirps, and what a robot can do otherwise."""

from __future__ import annotations

import numpy as np
from scipy import signal

from robid.models.external.fit.data import Shot, quantum_of
from robid.signals.quantities import Channel
from robid.signals.waveforms import chirp

PERIOD_S, N_SAMPLE = 0.012, 2500
BANDS = ((1.04, 0.05), (5.2, 0.002))
NEW_BAND = (2.08, 0.01)
STEP = 1e-5


def channels(names, quantity="position"):
    return tuple(Channel(name, quantity, "m", "tool") for name in names)


def linear(numerator, denominator, delay):
    """A held transfer function behind a delay."""
    b, a, _ = signal.cont2discrete((numerator, denominator), PERIOD_S, method="zoh")

    def answer(command):
        late = np.concatenate([np.zeros(delay), command[: len(command) - delay]])
        return signal.lfilter(b[0], a, late)

    return answer


def play(width):
    """Backlash behind whatever drives it."""

    def answer(moved):
        found, place = np.empty_like(moved), 0.0
        for index, value in enumerate(moved):
            place = min(max(place, value - width / 2), value + width / 2)
            found[index] = place
        return found

    return answer


def limited_rate(most):
    """A speed limit."""

    def answer(moved):
        found, place = np.empty_like(moved), 0.0
        for index, value in enumerate(moved):
            place += np.clip(value - place, -most * PERIOD_S, most * PERIOD_S)
            found[index] = place
        return found

    return answer


def command_of(band_hz, amplitude):
    return amplitude * chirp(0.01 * PERIOD_S, band_hz * PERIOD_S, N_SAMPLE, peak=0.0)


def shot_of(plants, band, seed=0, *, moving=0, repeats=4, noise=STEP, place=""):
    """One chirp of one command, repeats averaged, on as many plants as there are channels.

    Args:
        plants: A plant of each channel.
        band: Highest frequency [Hz] and amplitude [m].
        seed: Of the noise.
        moving: Index of the command that moves.
        repeats: How many are averaged.
        noise: Standard deviation before quantising, which is to a step as large [m].
        place: Where it was.
    """
    generator = np.random.default_rng([seed, int(100 * band[0]), moving])
    inputs = np.zeros((N_SAMPLE, len(plants)))
    inputs[:, moving] = command_of(*band)
    clean = np.stack([plant(inputs[:, index]) for index, plant in enumerate(plants)], axis=1)
    each = np.array([clean + noise * generator.standard_normal(clean.shape) for _ in range(repeats)])
    each = np.round(each / STEP) * STEP
    scatter = np.sqrt(each.var(axis=0, ddof=1).mean(axis=0) / repeats) if repeats > 1 else None
    quantum = np.array([quantum_of(signal) for signal in each[0].T])
    name = f"{band[0]} Hz {moving}"
    where = place or f"{band[0]} Hz"
    return Shot(inputs, each.mean(axis=0), "free", scatter, repeats, PERIOD_S, name, place=where, quantum=quantum)
