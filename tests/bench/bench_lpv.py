"""The penalised fit of position-dependent models against the same iteration through cvxpy."""

import numpy as np
import pytest

from lpv_baseline import cvxpy_step
from lpv_systems import POSITIONS, basis, local_responses, problem
from robid.models.lpv.fit import sparse as penalised
from robid.models.lpv.fit.local import align_neighbours, fit_local_models, interpolate
from robid.models.lpv.fit.options import SparsityOptions
from robid.models.lpv.fit.responses import cost
from robid.models.lpv.fit.sparse import fit_sparse

_GAMMA = 100.0
_ROUNDS = 3


@pytest.fixture
def start():
    """Responses with noise, and their interpolation in a basis in which every block varies."""
    posed = problem(local_responses(POSITIONS, np.random.default_rng(0)))
    aligned = align_neighbours(fit_local_models(posed).systems, POSITIONS)
    return posed, interpolate(aligned, posed.values)


def test_the_whole_fit_against_cvxpy_with_the_stacked_jacobian(start, monkeypatch, compare):
    posed, parameters = start
    options = SparsityOptions()
    results = {}

    def ours():
        results["ours"] = fit_sparse(posed, parameters, basis().largest, _GAMMA, options)

    def reference():
        with monkeypatch.context() as patch:
            patch.setattr(penalised, "take_step", lambda priced, point, _, damping: cvxpy_step(priced, point, damping))
            results["reference"] = fit_sparse(posed, parameters, basis().largest, _GAMMA, options)

    compare("lpv.vs_cvxpy", ours, reference, _ROUNDS)
    reached = {name: cost(posed, fit.parameters) for name, fit in results.items()}
    assert reached["ours"] == pytest.approx(reached["reference"], rel=1e-4)
    np.testing.assert_array_equal(results["ours"].kept, results["reference"].kept)
