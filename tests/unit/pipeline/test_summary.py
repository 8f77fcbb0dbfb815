"""The keys of a run's summary that compare its fits."""

from types import SimpleNamespace

import numpy as np
import pytest

from exact_systems import exact_frf, two_mass_robot
from robid.models.elastic.page.gather import FitContent
from robid.models.elastic.page.report import comparison, fit_report
from robid.pipeline.report import summarize
from robid.report.costs import CostRow
from robid.report.parameters import Estimates, ParameterRow

FRF = exact_frf(two_mass_robot(), np.zeros((1, 1)), np.array([10.0, 20.0]))


def a_fit(name, kinds, excess, campaign="validation"):
    rows = [ParameterRow(f"gear_{i}", kind, "1", 1.0, 2.1, 2.0, 2.2, 0.1, truth=2.0) for i, kind in enumerate(kinds)]
    rows.append(ParameterRow("gear_9", kinds[-1], "1", 1.0, 9.0, 8.0, 10.0, 0.1, truth=2.0, identifiable=False))
    costs = tuple(
        CostRow(campaign, i, cost=100.0 + value, expected_cost=100.0, excess=value) for i, value in enumerate(excess)
    )
    estimates = Estimates(tuple(rows))
    return FitContent(name, "high", FRF, FRF.response, estimates, validation_costs=costs, validation_campaign=campaign)


def summary_of(*fits):
    reports = [fit_report(fit) for fit in fits]
    run = {"designs": {}, "excitations": (), "responses": {}, "comparison": comparison(fits)}
    return summarize(SimpleNamespace(fits=reports, **run))


def test_cubic_fits_against_the_best_linear_one_in_the_same_campaign():
    linear = [a_fit("plain", ["stiffness"], [50.0, 30.0]), a_fit("other", ["stiffness"], [60.0, 40.0])]
    elsewhere = a_fit("elsewhere", ["stiffness"], [1.0], "else")
    found = summary_of(
        *linear, elsewhere, a_fit("bent", ["stiffness", "cubic"], [12.0, 8.0]), a_fit("b", ["cubic"], [-8.0])
    )
    assert found["fits.bent.cubic.cost_ratio"] == found["cubic.cost_ratio"] == pytest.approx(0.25)
    assert found["fits.b.cubic.cost_ratio"] == pytest.approx(-0.1)
    assert found["cubic.max_relative_error"] == pytest.approx(0.05)


def test_nothing_to_compare_says_nothing():
    found = summary_of(a_fit("bent", ["cubic"], [12.0]), a_fit("elsewhere", ["stiffness"], [1.0], "else"))
    assert "cubic.cost_ratio" not in found
    assert "cubic.cost_ratio" not in summary_of(a_fit("plain", ["stiffness"], [50.0]))
