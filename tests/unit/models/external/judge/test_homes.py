"""A notch that moves with the home position is seen, the same plant twice is not."""

import numpy as np
import pytest

from external_loops import BANDS, channels, linear, shot_of
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.judge.prediction import compare_homes

DENOMINATOR = np.polymul([1.0, 30.0], [1.0, 20.0, 500.0])


def notch(place, seed):
    plant = linear(30 * 500 / place**2 * np.array([1.0, 0.1 * place, place**2]), DENOMINATOR, 2)
    shots = [shot_of([plant], band, seed) for band in BANDS]
    options = ExternalOptions(poles=3, zeros=2, delay_samples=2)
    return fit_external(shots, channels(("X",), "position_command"), channels(("X",)), "zoh", options)


def test_a_moved_notch_is_where_they_differ_most():
    (found,) = compare_homes(notch(18.0, 1), notch(22.0, 2))
    assert found.channel == "X"
    assert found.significant
    assert found.relative > 0.5
    assert found.at_hz == pytest.approx(18 / (2 * np.pi), rel=0.1) or found.at_hz == pytest.approx(
        22 / (2 * np.pi), rel=0.1
    )
    assert abs(found.magnitude_db) > 5 or abs(found.phase_deg) > 30


def test_the_same_plant_does_not_differ():
    (found,) = compare_homes(notch(18.0, 1), notch(18.0, 5))
    assert not found.significant
    assert found.relative < 0.02
