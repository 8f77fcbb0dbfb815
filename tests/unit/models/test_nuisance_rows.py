"""What a page tells of a robot file's nuisances: amounts that can be."""

import numpy as np

from robid.models.elastic.fit.solution import NuisanceEstimates
from robid.models.elastic.page.gather import nuisance_rows


def test_no_amount_is_told_that_cannot_be():
    names = "payload.mass", "gear_1.hysteresis_early", "axis_2.com_x", "base_x.compliance"
    values = np.array([-170.0, -3.0, 12.0, 4.0])
    ones = np.ones(4)
    nuisances = NuisanceEstimates(
        names, ("payload",) * 4, ("kg",) * 4, ones, 0 * ones, values, 0.5 * ones, np.zeros((0, 4))
    )
    limits = {"payload.mass": (-150.0, 150.0), "gear_1.hysteresis_early": (0.0, 100.0), "base_x.compliance": (0, 100)}
    rows = nuisance_rows(nuisances, limits, 0.95)
    assert [row.amount for row in rows] == [-150.0, 0.0, 12.0, 4.0]
    assert [row.is_off for row in rows] == [True, False, True, True]
