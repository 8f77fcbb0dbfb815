"""The verdict: sound fits are trusted, each kind of trouble is named with its remedy."""

import numpy as np
import pytest
from scipy.signal import lfilter

from rigid_models import random_rows
from robid.models.rigid.fit.conclusion import INSTRUMENTS, conclude, scale_of, solve_instruments
from robid.models.rigid.fit.options import ConclusionOptions, VerdictOptions
from robid.models.rigid.fit.rows import Rows
from robid.signals.filters import design_decimator

NAMES = ("a", "b", "c")
EVERY = design_decimator(1)


def _with_instruments(seed, error):
    """Rows whose columns carry noise of this deviation, which the torque does not follow."""
    (rows,) = random_rows(n_row=600, deviations=(0.3, 0.1), seed=seed)
    noise = error * np.random.default_rng(seed + 1).standard_normal(rows.columns.shape)
    return (Rows(rows.columns + noise, rows.torque, rows.used, rows.columns),)


def _concluded(rows, instrumented=False, options=None):
    instruments = solve_instruments(rows, np.array([1.0, 1.0])) if instrumented else None
    return conclude(rows, EVERY, NAMES, instruments, options=options)


def test_sound_fits_are_trusted_but_for_the_level():
    trusted = [_concluded(_with_instruments(seed, 0.0), instrumented=True).verdict.trust for seed in range(150)]
    assert np.mean(trusted) >= 0.96


def test_level_without_sizes_that_matter_is_kept_too():
    """Every difference counts here: the share of false alarms is the level, not nothing."""
    strict = ConclusionOptions(verdict=VerdictOptions(level=0.2, variation=0.0, shape=0.0, correlation=0.0))
    trusted = [_concluded(random_rows(n_row=600, seed=seed), options=strict).verdict.trust for seed in range(150)]
    assert 0.72 <= np.mean(trusted) <= 0.92


def test_a_bias_that_huber_shares_is_seen_by_the_instruments_alone():
    found = _concluded(_with_instruments(0, 0.4), instrumented=True)
    verdict = found.verdict
    assert not verdict.trust
    assert verdict.instruments.alarm
    assert verdict.instruments.relative.max() > 0.1
    assert "instrumental variables" in verdict.sentence
    assert _concluded(_with_instruments(0, 0.4)).verdict.instruments is None
    half = found.long_run.half_width(INSTRUMENTS)
    assert np.all(np.abs(found.instruments.parameters - [1.0, -2.0, 3.0]) < 2 * half)


def test_a_difference_that_does_not_matter_is_silent():
    rows = _with_instruments(0, 0.18)
    difference = _concluded(rows, instrumented=True).verdict.instruments
    assert difference.p_value.min() < 1e-6
    assert 0.02 < difference.relative.max() < 0.05
    assert not difference.alarm
    eager = ConclusionOptions(verdict=VerdictOptions(variation=0.01))
    assert _concluded(rows, True, eager).verdict.instruments.alarm


def test_outliers_that_depend_on_the_motion_are_seen_by_huber():
    (rows,) = random_rows(n_row=800, deviations=(0.1,))
    torque = rows.torque.copy()
    torque[::15] += 4 * rows.columns[::15, :, 0]
    verdict = _concluded((Rows(rows.columns, torque, rows.used),)).verdict
    assert verdict.huber.alarm
    assert verdict.huber.relative.argmax() == 0
    assert f"a {100 * verdict.huber.relative[0]:.2g} %" in verdict.sentence
    assert "Huber" in verdict.sentence


def test_colour_and_odd_shapes_have_their_own_remedies():
    def coloured(generator):
        return lfilter([1.0], [1.0, -0.7], generator.standard_normal((800, 1)), axis=0)

    def skewed(generator):
        return generator.exponential(size=(800, 1)) - 1.0

    verdict = _concluded(random_rows(n_row=800, noise=coloured)).verdict
    assert (verdict.whiteness_alarm, verdict.normality_alarm) == (True, False)
    assert "extend the friction" in verdict.sentence
    # Least squares and Huber find different offsets in skewed noise; without an offset only the shape is odd.
    verdict = _concluded(random_rows(n_row=800, noise=skewed)).verdict
    assert verdict.normality_alarm
    assert not verdict.trust


def test_differences_are_relative_to_what_is_known():
    size = scale_of(np.array([10.0, 0.0, 3.0, 4.0]), np.array([1.0, 1.0, 0.1, 2.0]), ((2, 3),))
    assert size == pytest.approx([10.0, 3.0, 5.0, 6.0])
