"""Shots of known transfer functions, simulated by code that the fit does not share."""

import numpy as np
from scipy.signal import lsim

from robid.models.external.fit.data import Shot
from robid.models.external.fit.transfer import TransferMatrix
from robid.signals.waveforms import chirp

PERIOD_S = 0.012
# Oliveira et al. (2019), Table 3: channels with poles beyond the sampling, cancelling pairs and an undershoot.
CHANNELS = {
    "X": ([6.803e4, 5.917e5, 1.247e8], [1.0, 1040.0, 9.076e4, 4.693e6, 1.287e8]),
    "Y": ([60.68, 5488.0, 1.657e4], [1.0, 227.1, 5978.0, 1.657e4]),
    "Z": ([24.08, 1362.0], [1.0, 65.0, 1362.0]),
    "C": ([-1906.0, 1.053e5], [1.0, 1846.0, 1.049e5]),
}


def transfer(numerator, denominator, *, delay=0, average=1, period=PERIOD_S, hold="zoh"):
    """A single channel."""
    above = np.array(numerator, dtype=float)[None, None]
    return TransferMatrix(("u",), ("y",), above, np.array(denominator, dtype=float), delay, average, period, hold)


def answer(model, command):
    """What one channel answers (n_sample,) to a command from rest, by SciPy."""
    reach = model.delay_samples + model.moving_average - 1
    before = np.concatenate([np.zeros(reach), command])
    taps = np.ones(model.moving_average) / model.moving_average
    received = np.convolve(before, taps, "valid")[: len(command)]
    time = np.arange(len(command)) * model.sampling_period_s
    system = (model.numerator[0, 0], model.denominator)
    return lsim(system, received, time, interp=model.hold == "foh")[1]


def sweep(high_hz, n_sample, *, low_hz=0.05, amplitude=1.0, period=PERIOD_S):
    """A chirp (n_sample,) whose amplitude falls throughout."""
    return amplitude * chirp(low_hz * period, high_hz * period, n_sample, peak=0)


def shot(model, command, *, noise=0.0, seed=0, resolution=0.0, **fields):
    """What is measured of one channel."""
    told = answer(model, command)
    told = told + noise * np.random.default_rng(seed).standard_normal(len(told))
    if resolution:
        told = np.round(told / resolution) * resolution
    known = {"start": "rest", "noise_std": None, "repeats": 1, "offset": False} | fields
    return Shot(command[:, None], told[:, None], sampling_period_s=model.sampling_period_s, name="sweep", **known)
