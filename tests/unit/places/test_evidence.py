"""What places say, compressed to few rows."""

import numpy as np
import pytest

from robid.places.evidence import gather, summarise
from tolerances import IDENTITY


@pytest.mark.parametrize("kind", [float, complex])
def test_compressed_rows_have_the_normal_equations_of_all(kind):
    generator = np.random.default_rng(1)
    derivative = generator.standard_normal((5, 7, 2, 3)).astype(kind)
    residual = generator.standard_normal((5, 7, 2)).astype(kind)
    if kind is complex:
        derivative = derivative + 1j * generator.standard_normal(derivative.shape)
        residual = residual + 1j * generator.standard_normal(residual.shape)
    found = gather(residual, derivative, [[0, 3], [1], [2, 4]], np.eye(3), np.ones(3))
    rows, left = derivative.reshape(5, 14, 3), residual.reshape(5, 14)
    factor = 2 if kind is complex else 1
    each = factor * np.real(np.einsum("crp,crq->cpq", rows.conj(), rows))
    pulls = factor * np.real(np.einsum("crp,cr->cp", rows.conj(), left))
    for place, members in enumerate([[0, 3], [1], [2, 4]]):
        np.testing.assert_allclose(found.information[place], each[members].sum(axis=0), rtol=IDENTITY)
        np.testing.assert_allclose(found.score[place], pulls[members].sum(axis=0), rtol=1e-9)


def test_a_moved_point_leaves_what_is_said_of_it():
    generator = np.random.default_rng(2)
    derivative, residual = generator.standard_normal((3, 9, 2)), generator.standard_normal((3, 9))
    places, shift = [[0], [1], [2]], np.array([0.3, -0.7])
    known = np.array([[2.0, 0.1], [0.1, 1.0]])
    there = gather(residual - derivative @ shift, derivative, places, known, np.array([0.5, 1.0]) - known @ shift)
    moved = gather(residual, derivative, places, known, np.array([0.5, 1.0])).moved(shift)
    np.testing.assert_allclose(moved.score, there.score, rtol=1e-9)
    np.testing.assert_allclose(moved.pull, there.pull, rtol=IDENTITY)


def test_fewer_rows_than_parameters_say_nothing_of_the_rest():
    found = gather(np.ones((1, 1)), np.array([[[1.0, 2.0, 0.0]]]), [[0]], np.zeros((3, 3)), np.zeros(3))
    np.testing.assert_allclose(found.information[0], [[1, 2, 0], [2, 4, 0], [0, 0, 0]], atol=IDENTITY)


def test_a_weighted_estimate_is_known_by_its_sandwich():
    # Twice the right weights in half of the rows: the estimate has another covariance than the weights say.
    generator = np.random.default_rng(3)
    rows, residual = generator.standard_normal((40, 3)), generator.standard_normal(40)
    weight = np.where(np.arange(40) < 20, 2.0, 1.0)
    bread = rows.T @ (weight[:, None] * rows)
    meat = rows.T @ (weight[:, None] ** 2 * rows)
    score = rows.T @ (weight * residual)
    found = summarise(bread[None], score[None], meat[None], np.zeros((3, 3)), np.zeros(3))
    own = np.linalg.inv(bread)
    np.testing.assert_allclose(np.linalg.inv(found.information[0]), own @ meat @ own, rtol=1e-9)
    np.testing.assert_allclose(np.linalg.solve(found.information[0], found.score[0]), own @ score, rtol=1e-9)


def test_a_place_that_sees_nothing_of_a_parameter_is_no_obstacle():
    bread = np.diag([4.0, 0.0])
    found = summarise(bread[None], np.array([[2.0, 0.0]]), 2 * bread[None], np.zeros((2, 2)), np.zeros(2))
    np.testing.assert_allclose(found.information[0], np.diag([2.0, 0.0]), atol=IDENTITY)
    np.testing.assert_allclose(found.score[0], [1.0, 0.0], atol=IDENTITY)
