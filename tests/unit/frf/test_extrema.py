"""Peaks of measured responses against closed forms, and their intervals against modes that no local model has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import argrelextrema

from robid.frf.extrema import peaks_of
from sample_reports import synthetic_frf

ROTOR, LOAD, STIFFNESS, DAMPING = 2.0, 6.0, 3.0e4, 12.0


def drive(frequency_hz):
    """Torque to motor acceleration of two masses with a spring between them, in closed form."""
    s = 2j * np.pi * frequency_hz
    link = LOAD * s**2 + DAMPING * s + STIFFNESS
    return link / (ROTOR * LOAD * s**2 + (ROTOR + LOAD) * (DAMPING * s + STIFFNESS))


def chain(frequency_hz, generator):
    """Motor's own acceleration of a robot with five modes: a sum of modes with positive residues."""
    s = 2j * np.pi * frequency_hz
    omega = 2 * np.pi * np.sort(generator.uniform(6, 70, 5))
    damping, weight = generator.uniform(0.01, 0.05, 5), generator.uniform(0.1, 1.0, 5)
    modes = weight * s[:, None] ** 2 / (s[:, None] ** 2 + 2 * damping * omega * s[:, None] + omega**2)
    return 1 + modes.sum(axis=1)


def measured(response, frequency_hz, relative_std, *, hold=False, seed=1):
    frf = synthetic_frf(
        response[None, :, None, None], frequency_hz, np.zeros((1, 1)), relative_std, ("motor",), ("motor",), seed
    )
    return replace(frf, input_hold="zoh" if hold else "band_limited")


@pytest.mark.parametrize("hold", [False, True])
def test_two_masses_have_one_peak_and_one_dip_where_the_equations_put_them(hold):
    frequency_hz = np.arange(2.0, 30.0, 0.25)
    response = drive(frequency_hz)
    frf = measured(response, frequency_hz, 1e-4, hold=hold)
    if hold:
        ratio = frequency_hz * frf.sampling_period_s
        frf = replace(frf, response=frf.response * (np.sinc(ratio) * np.exp(-1j * np.pi * ratio))[None, :, None, None])
    dip, peak = peaks_of(frf)
    zero, pole = np.roots([LOAD, DAMPING, STIFFNESS])[0], np.roots(
        [ROTOR * LOAD, (ROTOR + LOAD) * DAMPING, (ROTOR + LOAD) * STIFFNESS]
    )[0]  # fmt: skip
    dense_hz = np.linspace(2, 30, 200_001)
    dense = np.abs(drive(dense_hz))
    for found, kind, root, at in (
        (dip, "antiresonance", zero, dense.argmin()),
        (peak, "resonance", pole, dense.argmax()),
    ):
        assert (found.kind, found.output, found.input) == (kind, "motor", "motor")
        assert found.peak_hz == pytest.approx(dense_hz[at], rel=1e-3)
        assert found.damping == pytest.approx(-root.real / abs(root), rel=0.02)


def test_intervals_hold_peaks_of_robots_with_many_modes():
    generator, inside, count = np.random.default_rng(3), 0, 0
    frequency_hz, dense_hz = np.geomspace(2, 80, 90), np.geomspace(2, 80, 40_001)
    for _ in range(40):
        seed = generator.integers(1 << 30)
        dense = np.abs(chain(dense_hz, np.random.default_rng(seed)))
        exact = chain(frequency_hz, np.random.default_rng(seed))
        frf = measured(exact, frequency_hz, 0.01, seed=seed)
        places = {"resonance": argrelextrema(dense, np.greater)[0], "antiresonance": argrelextrema(dense, np.less)[0]}
        for peak in peaks_of(frf):
            nearest = np.abs(dense_hz[places[peak.kind]] - peak.peak_hz).min(initial=np.inf)
            inside, count = inside + (nearest <= peak.peak_half_hz), count + 1
    assert count > 150
    assert inside / count >= 0.9


def test_noise_and_dropped_lines_are_no_peaks():
    frequency_hz = np.linspace(2, 30, 120)
    for seed in range(20):
        assert peaks_of(measured(np.ones(120, complex), frequency_hz, 0.1, seed=seed)) == ()
    spike = np.ones(120, complex)
    spike[40] = 9
    frf = measured(spike, frequency_hz, 0.01)
    assert len(peaks_of(frf)) == 1
    dropped = np.zeros((1, 120, 1), bool)
    dropped[0, 40] = True
    assert peaks_of(replace(frf, dropped=dropped)) == ()
