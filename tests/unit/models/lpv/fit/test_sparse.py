"""Which blocks vanish, and what is left of the model."""

from dataclasses import replace

import numpy as np
import pytest

from lpv_systems import LEFT_OUT, POSITIONS, SIZES, STRUCTURE, basis, local_responses, problem, true_parameters
from robid.models.lpv.fit import sparse as penalised
from robid.models.lpv.fit.options import PathOptions, SparsityOptions
from robid.models.lpv.fit.path import PathPoint, choose_point, follow_path
from robid.models.lpv.fit.responses import cost, normal, solve
from robid.models.lpv.fit.sparse import Penalised, descend, fit_sparse, minimise_model
from robid.models.lpv.fit.state_space import block_names, list_blocks, measure, spread

LARGEST = basis().largest
ALL = np.ones((4, 4), bool)


def _noisy(seed=0):
    posed = problem(local_responses(POSITIONS, np.random.default_rng(seed)))
    start, _ = solve(posed, true_parameters())
    return posed, start


def test_norms_are_relative_to_the_constant_block_and_the_functions_size():
    parameters = np.zeros((3, SIZES.n_local))
    parameters[0, :9], parameters[1, :9] = 2.0, -1.0
    parameters[2, SIZES.parts[3]] = 3.0
    norms = measure(parameters, np.array([1.0, 0.5]), SIZES)
    np.testing.assert_allclose(norms.relative[0], [0.5, 0.0])
    np.testing.assert_allclose(norms.relative[3], [0.0, 0.5 * np.sqrt(18)])
    assert norms.absolute[0, 0] == pytest.approx(6.0)


def test_blocks_know_their_elements():
    kept = np.zeros((4, 4), bool)
    kept[1, 2] = kept[3, 0] = True
    blocks = list_blocks(kept, SIZES)
    assert block_names(kept) == ("B3", "D1")
    free = spread(kept, SIZES)
    np.testing.assert_array_equal(np.flatnonzero(free), blocks.free)
    assert free[0].all()
    assert free.sum() == SIZES.n_local + 3 + 2
    inside = [blocks.free[member] for member in blocks.members]
    np.testing.assert_array_equal(inside[0], 3 * SIZES.n_local + np.arange(9, 12))
    np.testing.assert_array_equal(inside[1], 1 * SIZES.n_local + np.arange(18, 20))


def test_a_cone_program_with_a_unit_hessian_shrinks_every_block_in_closed_form():
    generator = np.random.default_rng(1)
    point = generator.standard_normal(10)
    members = (np.array([2, 3, 4, 5]), np.array([6, 7, 8, 9]))
    price = np.array([0.8, 2.5 * np.linalg.norm(point[6:])])
    step = minimise_model(np.eye(10), -0.1 * np.ones(10), point, members, price, np.eye(10)[:, :1])
    expected = np.concatenate([[0.0, 0.1], point[2:] + 0.1])
    first = expected[members[0]]
    expected[members[0]] = first * (1 - 0.4 / np.linalg.norm(first))
    expected[members[1]] = 0.0
    np.testing.assert_allclose((point + step)[2:], expected[2:], atol=1e-6)
    np.testing.assert_allclose(step[:2], expected[:2], atol=1e-9)


def test_a_descent_ends_where_no_price_could_be_saved():
    """At the end every kept block's gradient is its price, turned against the block; of a vanished one it is less."""
    posed, start = _noisy()
    norms = measure(start, LARGEST, SIZES)
    priced = Penalised(posed, list_blocks(ALL, SIZES), 100 * norms.scale / (norms.relative + 1e-3))
    ended = descend(priced, start, tolerance=1e-9, step_limit=60)
    gradient = 2 * normal(posed, ended.parameters).gradient
    point = ended.parameters.ravel()
    held = priced.basis_changes(point)
    for price, member, (row, column) in zip(priced.prices, priced.blocks.members, priced.blocks.where, strict=True):
        force = -gradient[member]
        if (row, column) in ((0, 0), (1, 1)):
            size = np.linalg.norm(point[member])
            slack = force - price * point[member] / size
            # What is left of the balance may only point along changes of the states' basis, which are held.
            outside = slack - held[member] @ np.linalg.lstsq(held[member], slack, rcond=None)[0]
            assert np.linalg.norm(outside) < 1e-2 * price
        else:
            assert np.linalg.norm(point[member]) < 1e-4


def test_vanished_blocks_are_exactly_zero_and_true_ones_stay():
    posed, start = _noisy()
    found = fit_sparse(posed, start, LARGEST, 100.0, SparsityOptions())
    assert block_names(found.kept) == STRUCTURE
    free = spread(found.kept, SIZES)
    assert np.all(found.parameters[~free] == 0)
    refit, _ = solve(posed, found.parameters, free=free)
    assert np.all(refit[~free] == 0)
    assert cost(posed, refit) < cost(posed, found.parameters)
    # 2000 complex elements against 23 free combinations: 32 elements less 9 of the states' basis.
    assert abs(cost(posed, refit) - (2000 - 23 / 2)) < 4 * np.sqrt(2000)


def test_a_block_that_has_just_vanished_is_zero_too():
    posed, start = _noisy()
    found = fit_sparse(posed, start, LARGEST, 100.0, SparsityOptions(reweightings=1))
    assert not found.kept.all()
    assert np.all(found.parameters[~spread(found.kept, SIZES)] == 0)


def test_a_price_near_nothing_drops_nothing_that_the_data_need():
    posed, start = _noisy()
    found = fit_sparse(posed, start, LARGEST, 1e-3, SparsityOptions())
    assert cost(posed, found.parameters) < cost(posed, start) + 1e-3 * 16 * 1.5


def test_the_path_falls_to_the_true_blocks_and_is_chosen_there():
    posed, start = _noisy()
    judge = problem(local_responses(LEFT_OUT, np.random.default_rng(9)))
    path = follow_path(posed, judge, (start,), LARGEST, PathOptions(count=4), SparsityOptions())
    counts = [int(point.kept.sum()) for point in path.points]
    assert counts[0] == 16
    assert sorted(counts, reverse=True) == counts
    assert path.points[0].gamma == 0.0
    assert block_names(path.best.kept) == STRUCTURE
    assert path.best.gamma == min(point.gamma for point in path.points if point.kept.sum() == 2)
    for point in path.points[1:]:
        held = fit_sparse(posed, start, LARGEST, point.gamma, SparsityOptions())
        assert point.refit_cost <= cost(posed, held.parameters) * (1 + 1e-9)
        assert np.all(point.relative[~point.kept] < 1e-5)


def _point(blocks, refit_cost, validation_cost):
    kept = np.arange(16).reshape(4, 4) < blocks
    return PathPoint(1.0, kept, np.zeros((4, 4)), np.zeros((5, 20)), refit_cost, validation_cost, "converged", 0)


def test_the_choice_is_the_sparsest_within_the_allowance_then_the_best_fit():
    points = [_point(16, 90, 100.0), _point(4, 95, 104.0), _point(4, 94, 104.9), _point(2, 99, 106.0)]
    assert choose_point(points, 0.05) == 2
    assert choose_point(points, 0.07) == 3
    assert choose_point(points, 0.0) == 0


def test_a_fit_that_has_not_converged_is_chosen_only_where_no_other_is_as_good():
    points = [_point(16, 90, 100.0), _point(2, 99, 101.0)]
    points[1] = replace(points[1], status="iteration_limit")
    assert choose_point(points, 0.05) == 0
    points[0] = replace(points[0], validation_cost=110.0)
    assert choose_point(points, 0.05) == 1


def test_a_step_that_the_solver_does_not_find_is_tried_shorter(monkeypatch):
    posed, start = _noisy()
    norms = measure(start, LARGEST, SIZES)
    priced = Penalised(posed, list_blocks(ALL, SIZES), 100 * norms.scale / (norms.relative + 1e-3))
    take, lost = penalised.take_step, []

    def fails_at_first(priced, point, here, damping):
        step = take(priced, point, here, damping)
        if len(lost) < 2:
            lost.append(damping)
            return np.full(step.size, np.nan)
        return step

    expected = descend(priced, start, tolerance=1e-6, step_limit=60)
    monkeypatch.setattr(penalised, "take_step", fails_at_first)
    found = descend(priced, start, tolerance=1e-6, step_limit=60)
    assert lost[1] > lost[0]
    assert found.objective == pytest.approx(expected.objective, rel=1e-4)
