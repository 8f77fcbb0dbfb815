"""The order that local models need."""

import numpy as np
import pytest

from lpv_systems import POSITIONS, local_responses, problem, true_systems
from robid.errors import DataError
from robid.fit.lpv.orders import choose_order
from robid.fit.lpv.problem import Problem
from robid.fit.lpv.state_space import StateSpace, response


def test_the_order_of_the_system_is_chosen():
    responses = local_responses(POSITIONS, np.random.default_rng(1), frequency=np.linspace(0.002, 0.4, 60))
    found = choose_order(problem(responses), (2, 3, 4))
    assert found.chosen == 3
    assert np.all(np.diff(found.cost) < 0)
    # The fourth state takes 3 more combinations at each of five positions, and on average the cost half of that.
    assert found.cost[1] - found.cost[2] == pytest.approx(15 / 2, abs=15)
    assert found.cost[0] > 10 * found.cost[1]


def test_an_order_that_only_unstable_models_fit_is_passed_over():
    grown = true_systems(POSITIONS)
    wild = StateSpace(1.03 * grown.A, grown.B, grown.C, grown.D)
    exact = local_responses(POSITIONS)
    measured = response(wild, exact.z)
    posed = Problem(exact.z, measured, np.ones(measured.shape), np.ones((5, 1)), problem(exact).sizes)
    with pytest.raises(DataError, match="No order of 3, 4 gives stable local models"):
        choose_order(posed, (3, 4))
