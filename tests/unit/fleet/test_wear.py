"""What grows with wear is accused where it is large, never where it is small."""

import numpy as np
import pytest

from robid.fleet.comparison import Collected
from robid.fleet.population import Trait, find_outliers, populations


@pytest.mark.parametrize(
    ("kind", "only_large"),
    [("lost_motion", True), ("backlash", True), ("transmission_error", True), ("stiffness", False), ("", True)],
)
def test_what_grows_with_wear_has_one_bad_side(kind, only_large):
    assert Collected(kind, "rad", 0.95).only_large is only_large


def test_worn_gears_are_found_and_sound_ones_beside_many_worn_ones_are_not_accused():
    rng = np.random.default_rng(4)
    value = 9e-5 * np.exp(0.13 * rng.standard_normal(100))
    value[70:] += 7.5e-5
    trait = Trait(np.arange(100), value, np.full(100, 1e-6), Collected("lost_motion", "rad", 0.95).only_large)
    rows = {each.row for each in find_outliers([trait], populations([trait], np.arange(100)))}
    assert len(rows & set(range(70, 100))) >= 26
    assert len(rows - set(range(70, 100))) <= 4
