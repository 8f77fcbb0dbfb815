"""Inputs that act at an end of a log: their response is that of a transient, and is said to be."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter, ss2tf

from robid.errors import DataError
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.signals.quantities import Channel
from robid.signals.record import Record

STEP_S, BAND_HZ = 1e-3, np.arange(5, 61)
OPTIONS = EstimateOptions(estimator="local", compensation="none")


def structure(seed):
    """Position over force of two modes, as polynomials in z."""
    generator = np.random.default_rng(seed)
    A, B, C = np.zeros((4, 4)), np.zeros((4, 1)), np.array([[1.0, 0, 1, 0]])
    for place, frequency_hz in enumerate((generator.uniform(12, 25), generator.uniform(40, 70))):
        omega, part = 2 * np.pi * frequency_hz, slice(2 * place, 2 * place + 2)
        A[part, part] = [[0, 1], [-(omega**2), -2 * generator.uniform(0.03, 0.08) * omega]]
        B[2 * place + 1] = 1 / generator.uniform(0.5, 2)
    Ad, Bd, Cd, Dd, _ = cont2discrete((A, B, C, np.zeros((1, 1))), STEP_S)
    numerator, denominator = ss2tf(Ad, Bd, Cd, Dd)
    return numerator[0], denominator


def recorded(force, seed, noise=0.01):
    """A record of a force from rest, and the exact response at its lines."""
    numerator, denominator = structure(seed)
    position = lfilter(numerator, denominator, force)
    position += noise * position.std() * np.random.default_rng(seed).standard_normal(len(force))
    segments = round(len(force) * STEP_S)
    record = Record(
        sampling_period_s=STEP_S,
        configurations=np.zeros((1, 1)),
        inputs=force[None, None, None, None, :, None],
        outputs=position[None, None, None, None, :, None],
        output_offset=np.zeros((1, 1)),
        input_channels=(Channel("point", "force", "N", "motor"),),
        output_channels=(Channel("point", "position", "m", "motor"),),
        excited_lines=BAND_HZ * segments,
        segments=segments,
    )
    z, omega = np.exp(2j * np.pi * BAND_HZ * STEP_S), 2 * np.pi * BAND_HZ
    return record, -(omega**2) * np.polyval(numerator, z) / np.polyval(denominator, z)


def sweep(high_hz, seconds=16.0, low_hz=3.0):
    time, rate = STEP_S * np.arange(round(seconds / STEP_S)), np.log(high_hz / low_hz)
    return np.sin(2 * np.pi * low_hz * seconds / rate * (np.exp(rate * time / seconds) - 1))


def blow(at_s, seconds):
    force = np.zeros(round(seconds / STEP_S))
    force[round(at_s / STEP_S) :][:6] = np.sin(np.linspace(0, np.pi, 8))[1:-1]
    return force


def inside(forces):
    """Share of the lines kept whose error is within the band, and the estimates."""
    shares, found = [], []
    for seed, force in enumerate(forces):
        record, truth = recorded(force, seed)
        frf = estimate_frf(record, OPTIONS)
        radius = frf.error_radius(0.95)[0, :, 0, 0]
        kept = np.isfinite(radius)
        shares.append((np.abs(frf.response[0, :, 0, 0] - truth) <= radius)[kept].mean())
        found.append(frf)
    return np.mean(shares), found


def test_lines_that_a_sweep_reaches_as_the_log_ends_are_left_out_with_cause_and_remedy():
    share, found = inside([sweep(60.0)] * 30)
    assert 0.93 <= share <= 0.97
    dropped = found[0].dropped[0, :, 0]
    assert dropped[-5:].all()
    assert not dropped[: len(dropped) // 2].any()
    (note,) = [note for note in found[0].notes if "D231" in note]
    assert "D231" in note
    assert "lower the band's upper end (of a sweep)" in note
    # The remedy: the sweep goes on beyond the band.
    share, found = inside([sweep(180.0)] * 30)
    assert 0.93 <= share <= 0.97
    assert found[0].dropped is None or not found[0].dropped.any()


def test_a_sweep_that_is_a_period_is_told_to_take_an_estimator_of_periods():
    record, truth = recorded(sweep(60.0), 1, noise=0.0)
    lines = BAND_HZ * record.segments
    again = replace(record, segments=0, excited_lines=lines)
    (note,) = [note for note in estimate_frf(again, OPTIONS).notes if "D231" in note]
    assert "resolution_hz" not in note
    assert "leave out `estimator: local`" in note
    # The remedy: in steady state, which is the second of two periods, nothing is left out.
    numerator, denominator = structure(1)
    force = np.tile(record.inputs[0, 0, 0, 0, :, 0], 3)
    position = lfilter(numerator, denominator, force).reshape(1, 1, 1, 3, -1, 1)[:, :, :, 1:]
    steady = replace(again, inputs=force.reshape(1, 1, 1, 3, -1, 1)[:, :, :, 1:], outputs=position)
    frf = estimate_frf(steady, EstimateOptions(compensation="none"))
    assert not frf.dropped.any()
    np.testing.assert_allclose(frf.response[0, :, 0, 0], truth, rtol=1e-3)


def test_noise_that_goes_on_to_the_ends_hides_nothing():
    _, found = inside([np.random.default_rng(seed).standard_normal(8000) for seed in range(5)])
    assert all(frf.dropped is None or not frf.dropped.any() for frf in found)


@pytest.mark.parametrize("at_s", [0.8, 1.2])
def test_a_blow_that_is_hardly_told_from_the_transient_is_refused(at_s):
    with pytest.raises(DataError, match="D231"):
        estimate_frf(recorded(blow(at_s, 8.0), 1)[0], OPTIONS)


def test_a_blow_as_the_log_begins_is_refused_and_one_later_is_within_its_band():
    with pytest.raises(DataError, match="D231") as caught:
        estimate_frf(recorded(blow(0.3, 8.0), 1)[0], OPTIONS)
    assert "begin the log 2 s before" in str(caught.value)
    share, _ = inside([blow(2.3, 8.0)] * 30)
    assert 0.93 <= share <= 0.97
