"""A cut-off from the data: where the motion ends, and where noise begins to colour."""

import numpy as np
import pytest

from robid.models.rigid.fit.options import PreprocessingOptions
from robid.models.rigid.fit.residuals import choose_cut_off, excited_band
from robid.studies.janot2009.haptic import Bench, Device, record

BENCH = Bench()


@pytest.fixture(scope="module")
def recording():
    return record(range(1), BENCH)


def test_the_excited_band_ends_where_the_motion_does():
    time = 1e-3 * np.arange(20_000)[:, None]
    noise = 1e-5 * np.random.default_rng(0).standard_normal((20_000, 2))
    position = np.sin(2 * np.pi * 0.5 * time) + np.array([0.0, 0.05]) * np.sin(2 * np.pi * 12 * time) + noise
    np.testing.assert_allclose(excited_band(position, 1e-3), [0.5, 12.0], atol=0.3)


def test_a_low_white_cut_off_is_chosen_and_the_noisy_ones_are_not_white(recording):
    options = PreprocessingOptions(20.0, drop_deviations=6.0)
    choice = choose_cut_off(recording.position[0], recording.torque[0], 240e-6, Device(), options, held=True)
    cuts = [trial.cut_hz for trial in choice.trials]
    assert choice.white
    assert choice.cut_hz == cuts[0]
    assert 3.1 < choice.excited_hz[0] < choice.cut_hz < 80
    assert all(trial.correlation[0] > 0.2 for trial in choice.trials if trial.cut_hz > 180)
    assert cuts == sorted(cuts)


def test_candidates_can_be_given(recording):
    options = PreprocessingOptions(20.0, drop_deviations=6.0)
    given = choose_cut_off(
        recording.position[0], recording.torque[0], 240e-6, Device(), options, (300.0, 200.0), held=True
    )
    assert [trial.cut_hz for trial in given.trials] == [200.0, 300.0]
    assert not given.white
