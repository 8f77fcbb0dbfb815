"""The haptic device: its simulation against eq. 20, and the study's figures over seeds that chose nothing."""

from dataclasses import replace

import numpy as np
import pytest

from robid.artifacts.artifact import Artifact, Provenance
from robid.artifacts.kinds import TASK
from robid.signals.filters import central_differences
from robid.studies.janot2009.haptic import (
    NOMINAL,
    Bench,
    Device,
    bench_of,
    haptic_machine,
    measured,
    record,
    reference,
    simulate,
    variations,
)
from robid.studies.janot2009.seeded import BENDS, FILTERS, errors_of, gather, judge_chunk, verdict_figures
from robid.studies.settings.parts import SeededCase

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
    case = SeededCase(first_seed=500, seeds=2)
    bench = replace(bench_of(case), substeps=1)
    content = judge_chunk(haptic_machine(bench), record(range(500, 502), bench), case)
    held = Artifact(TASK, content.datasets, content.attributes, Provenance(stage="study"))
    found = {filters: gather([held], filters) for filters in FILTERS}
    figures = verdict_figures("haptic", found)
    assert (figures["haptic.good.verdict_share"], figures["haptic.bad.verdict_share"]) == (1.0, 1.0)
    assert figures["haptic.good.sigma"] == pytest.approx(0.010, abs=0.002)
    assert figures["haptic.bad.sigma"] == pytest.approx(0.039, abs=0.008)
    assert errors_of(found["bad"]).least_squares.max() > 20
    huge = variations(found["bad"], 1 + BENDS.index(1e3))
    assert max(huge.values()) < 1e-6
    assert max(variations(found["good"], 1).values()) < max(variations(found["bad"], 1).values())
