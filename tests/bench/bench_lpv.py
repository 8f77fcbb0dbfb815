"""The penalised fit of position-dependent models against the same iteration through cvxpy."""

import time

import numpy as np
import pytest

from lpv_baseline import cvxpy_step, stacked_rows
from lpv_systems import POSITIONS, basis, local_responses, problem
from robid.fit.lpv import penalised
from robid.fit.lpv.alignment import align_neighbours, middle_position
from robid.fit.lpv.local import fit_local_models
from robid.fit.lpv.smile import interpolate
from robid.fit.lpv.sparse import SparsityOptions, fit_sparse

_GAMMA = 100.0
_ROUNDS = 3


@pytest.fixture
def start():
    """Responses with noise, and their interpolation in a basis in which every block varies."""
    posed = problem(local_responses(POSITIONS, np.random.default_rng(0)))
    aligned = align_neighbours(fit_local_models(posed).systems, POSITIONS)
    assert middle_position(POSITIONS) == 2
    return posed, interpolate(aligned, posed.values)


def test_the_whole_fit_against_cvxpy_with_the_stacked_jacobian(start, monkeypatch, compare):
    posed, parameters = start
    options = SparsityOptions()
    results = {}

    def ours():
        results["ours"] = fit_sparse(posed, parameters, basis().largest, _GAMMA, options)

    def reference():
        given = []

        def step(priced, point, _here, damping):
            begun = time.perf_counter()
            rows = stacked_rows(priced.problem, priced.place(point), priced.blocks.free)
            given.append(time.perf_counter() - begun)
            return cvxpy_step(priced, point, damping, rows)

        with monkeypatch.context() as patch:
            patch.setattr(penalised, "take_step", step)
            results["reference"] = fit_sparse(posed, parameters, basis().largest, _GAMMA, options)
        results["given"] = sum(given)

    compare("lpv.vs_cvxpy", ours, reference, _ROUNDS)
    assert results["ours"].cost == pytest.approx(results["reference"].cost, rel=1e-4)
    np.testing.assert_array_equal(results["ours"].kept, results["reference"].kept)
