"""Doubts that stay at their nominal values: what they leave open of the parameters."""

import numpy as np
import pytest

from robid.places.considered import considered_covariance
from robid.places.evidence import Evidence
from robid.places.pooling import pool


def evidence_of(rows, target=None):
    size = rows.shape[-1]
    left = np.zeros(rows.shape[:2]) if target is None else target
    return Evidence(rows, left, np.zeros((size, size)), np.zeros(size))


def test_one_parameter_and_one_doubt_in_closed_form():
    # In every place y = 2 k + 3 h: a doubt h of variance 0.25 moves k by 3 / 2 of it.
    rows = np.tile(np.array([[[2.0, 3.0]]]), (5, 1, 1))
    found = considered_covariance(evidence_of(rows), np.zeros(2), np.array([[0.25]]))
    assert found[0, 0] == pytest.approx(2.25 * 0.25)


def test_a_doubt_that_the_data_do_not_see_leaves_nothing_open():
    rows = np.tile(np.array([[[2.0, 0.0]]]), (5, 1, 1))
    assert considered_covariance(evidence_of(rows), np.zeros(2), np.array([[0.25]]))[0, 0] == 0.0


def test_it_is_how_far_wrong_doubts_move_an_estimate():
    generator = np.random.default_rng(1)
    rows = generator.standard_normal((6, 9, 4))
    between = np.array([0.2, 0.0, 0.1, 0.3])
    prior = np.array([[0.5, 0.2], [0.2, 0.4]])
    moved = []
    for doubt in np.linalg.cholesky(prior).T:
        target = rows[..., 2:] @ doubt
        total, slope = np.zeros((2, 2)), np.zeros(2)
        for place, left in zip(rows, target, strict=True):
            weight = np.linalg.inv(np.eye(9) + (place * between) @ place.T)
            total += place[:, :2].T @ weight @ place[:, :2]
            slope += place[:, :2].T @ weight @ left
        moved.append(np.linalg.solve(total, slope))
    expected = np.array(moved).T @ np.array(moved)
    np.testing.assert_allclose(considered_covariance(evidence_of(rows), between, prior), expected, rtol=1e-9)


def test_estimating_doubts_along_leaves_no_more_open_than_considering_them():
    generator = np.random.default_rng(2)
    rows, prior = generator.standard_normal((6, 9, 4)), np.diag([0.5, 0.1])
    considered = considered_covariance(evidence_of(rows), np.zeros(4), prior)
    alone = pool(evidence_of(rows[..., :2]), np.zeros(2)).assumed
    precision = np.diag([0.0, 0.0, 2.0, 10.0])
    along = pool(Evidence(rows, np.zeros((6, 9)), precision, np.zeros(4)), np.zeros(4)).assumed[:2, :2]
    assert np.linalg.eigvalsh(alone + considered - along).min() > -1e-12
    assert np.linalg.eigvalsh(along - alone).min() > -1e-12
