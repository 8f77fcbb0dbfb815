"""A step of the penalised fit and a whole descent against cvxpy, which sees all rows of the data."""

import cvxpy
import numpy as np
import pytest

from lpv_baseline import cvxpy_step
from lpv_systems import POSITIONS, basis, local_responses, problem, true_parameters
from robid.models.lpv.fit import sparse as penalised
from robid.models.lpv.fit.responses import normal
from robid.models.lpv.fit.sparse import Penalised, descend, minimise_model
from robid.models.lpv.fit.state_space import list_blocks, measure


def _priced(gamma):
    posed = problem(local_responses(POSITIONS, np.random.default_rng(0), frequency=np.linspace(0.002, 0.4, 40)))
    generator = np.random.default_rng(1)
    start = true_parameters() + 1e-3 * generator.standard_normal(true_parameters().shape)
    norms = measure(start, basis().largest, posed.sizes)
    price = gamma * norms.scale / (norms.relative + 1e-3)
    return Penalised(posed, list_blocks(np.ones((4, 4), bool), posed.sizes), price), start


def test_the_cone_program_of_random_data():
    generator = np.random.default_rng(2)
    rows, right = generator.standard_normal((60, 14)), generator.standard_normal(60)
    point, price = generator.standard_normal(14), np.array([3.0, 8.0, 500.0])
    members = (np.array([2, 3, 4]), np.array([5, 9]), np.array([6, 7, 8, 13]))
    held = np.linalg.qr(generator.standard_normal((14, 2)))[0]
    ours = minimise_model(rows.T @ rows, rows.T @ right, point, members, price, held)
    step = cvxpy.Variable(14)
    norms = sum(one * cvxpy.norm(point[own] + step[own]) for one, own in zip(price, members, strict=True))
    program = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(rows @ step + right) + norms), [held.T @ step == 0])
    program.solve(solver=cvxpy.CLARABEL)
    np.testing.assert_allclose(ours, step.value, atol=1e-5)
    np.testing.assert_allclose(held.T @ ours, 0, atol=1e-8)
    assert np.linalg.norm((point + ours)[members[2]]) < 1e-6 < np.linalg.norm((point + ours)[members[0]])


@pytest.mark.parametrize("gamma", [3.0, 300.0])
def test_a_step_from_reduced_rows_is_that_of_all_rows(gamma):
    priced, start = _priced(gamma)
    point = start.ravel()
    here = normal(priced.problem, start)
    curved = here.hessian + 1e-4 * np.diag(np.diag(here.hessian))
    held = priced.basis_changes(point)
    ours = minimise_model(curved, here.gradient, point, priced.blocks.members, priced.prices, held)
    reference = cvxpy_step(priced, point, 1e-4)

    def value(step):
        return here.cost + step @ (2 * here.gradient + curved @ step) + priced.penalty(point + step)

    assert value(ours) == pytest.approx(value(reference), rel=1e-5)
    assert value(ours) < 0.9 * value(np.zeros(point.size))


def test_a_descent_ends_at_the_cost_of_the_same_one_by_cvxpy(monkeypatch):
    priced, start = _priced(100.0)
    ours = descend(priced, start, tolerance=1e-6, step_limit=30)
    monkeypatch.setattr(
        penalised, "take_step", lambda priced, point, _here, damping: cvxpy_step(priced, point, damping)
    )
    reference = descend(priced, start, tolerance=1e-6, step_limit=30)
    assert ours.objective == pytest.approx(reference.objective, rel=1e-4)
