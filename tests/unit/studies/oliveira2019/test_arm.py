"""What maps of homes say against a linearised loop that is made up."""

import numpy as np
import pytest

from robid.models.external.fit.coupling import CouplingMap
from robid.studies.oliveira2019.arm import Mapped, home_figures, resonance, resonant_channel

FREQUENCY_HZ = np.array([1.0, 2, 4, 8])
OWN = np.eye(2, dtype=bool)


def home(peak_hz, *, crossing_hz, linear_coupling, gain_factor=1.0):
    """Two channels; the second resonates, and follows the first one's command."""
    linear = np.ones((4, 2, 2))
    linear[:, 1, 1] += 3 * (peak_hz == FREQUENCY_HZ)
    linear[:, 1, 0], linear[:, 0, 1] = linear_coupling * FREQUENCY_HZ / 8, 0.01
    gain = gain_factor * linear
    gain[0, 1, 0] = np.nan
    crossing = np.array([[np.nan, np.inf], [crossing_hz, np.nan]])
    band = np.zeros((1, 2, 2))
    found = CouplingMap(
        bands=("fast",),
        highest_hz=np.array([8.0]),
        coherence=band,
        limit=np.zeros(1),
        ratio=band,
        own=OWN,
        coupled=band.astype(bool),
        frequency_hz=FREQUENCY_HZ,
        gain=gain,
        gain_radius=0 * gain,
        crossing_hz=crossing,
        examined_hz=8.0,
        decoupled_up_to_hz=np.array([2.0, 2.0]),
        overall_hz=2.0,
        sentence="",
    )
    return Mapped(("X", "Y"), ("X", "Y"), found, gain.astype(complex), linear.astype(complex), linear)


def test_a_resonance_is_where_the_most_resonant_channel_answers_most():
    homes = [home(4.0, crossing_hz=4.0, linear_coupling=0.5), home(2.0, crossing_hz=4.0, linear_coupling=0.5)]
    assert resonant_channel(homes) == 1
    assert resonance(homes[1], 1) == (2, 2)
    figures = home_figures(homes, 0.15)
    assert figures["arm.resonance_shift_percent"] == pytest.approx(100)
    assert figures["arm.home_1.coupled_pairs"] == 1
    assert figures["arm.coupling_agreement"] == 1
    assert figures["arm.linear_error_percent"] == pytest.approx(0)


def test_maps_that_miss_what_the_linearised_loop_has_disagree():
    missing = home(4.0, crossing_hz=np.inf, linear_coupling=0.5, gain_factor=1.1)
    figures = home_figures([missing], 0.15)
    assert figures["arm.coupling_agreement"] == pytest.approx(0.5)
    assert figures["arm.linear_error_percent"] == pytest.approx(10)


def test_pairs_near_the_threshold_are_not_judged():
    doubtful = home(4.0, crossing_hz=np.inf, linear_coupling=0.16)
    assert home_figures([doubtful], 0.15)["arm.coupling_agreement"] == 1
