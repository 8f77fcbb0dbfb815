"""The haptic device: its simulation against eq. 20, and the study's figures over seeds that chose nothing."""

from dataclasses import replace

import numpy as np
import pytest

from robid.signals.filters import central_differences
from robid.studies.janot2009.haptic import NOMINAL, Bench, Device, measured, reference, simulate
from robid.studies.janot2009.haptic_runs import identify, record, summarise

BENCH = Bench()


def test_simulated_motion_obeys_the_inverse_dynamics_to_first_order_of_its_step():
    errors = []
    for substeps in (2, 4):
        position, torque = simulate(np.array([NOMINAL]), replace(BENCH, duration_s=1.0, substeps=substeps))
        velocity, acceleration = central_differences(position, BENCH.sampling_period_s)
        centred = 0.5 * (torque[1:-1] + torque[:-2])
        needed = Device().columns(position[1:-1], velocity, acceleration) @ np.array(NOMINAL)
        moving = np.abs(velocity) > 0.05
        errors.append(np.abs(needed - centred)[moving].max())
    assert errors[0] < 2e-3
    assert errors[1] < 0.8 * errors[0]


def test_the_device_follows_its_reference():
    position, _ = simulate(np.array([NOMINAL]), BENCH)
    wanted, _ = reference(BENCH.sampling_period_s * np.arange(len(position)))
    assert 1e-4 < np.abs(position[:, 0] - wanted).max() < 0.02


def test_encoders_round_about_their_own_zero():
    position = np.linspace(0, 1, 1000)[:, None] * [1.0, 1.0]
    phase = np.array([0.0, 0.3 * BENCH.quantum_rad])
    seen = measured(position, BENCH, phase)
    assert np.abs(seen - position).max() <= BENCH.quantum_rad / 2 + 1e-12
    turns = (seen - phase) / BENCH.quantum_rad
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-9)


def test_filters_decide_the_verdict():
    recording = record(range(500, 502), replace(BENCH, substeps=1))
    good, bad = (summarise(*identify(recording, cut_hz)) for cut_hz in (20.0, 200.0))
    assert (good["trust_share"], bad["trust_share"]) == (1.0, 0.0)
    assert good["sigma"] == pytest.approx(0.010, abs=0.002)
    assert bad["sigma"] == pytest.approx(0.039, abs=0.008)
    assert bad["ls.max_error_percent"] > 20


@pytest.mark.slow
def test_figures_of_100_seeds():
    recording = record(range(1000, 1100), BENCH)
    good, bad = (summarise(*identify(recording, cut_hz)) for cut_hz in (20.0, 200.0))
    assert good["trust_share"] >= 0.95
    assert bad["trust_share"] <= 0.05
    assert good["sigma"] == pytest.approx(0.010, abs=0.002)
    assert bad["sigma"] == pytest.approx(0.039, abs=0.008)
    assert bad["iv.max_error_percent"] <= 5
    assert bad["iv.max_excess"] <= 1
    assert bad["ls.max_error_percent"] >= 20
