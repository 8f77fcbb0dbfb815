"""Figures over the seeds of a simulated machine, from estimates that are made up."""

from dataclasses import replace

import numpy as np
import pytest

from robid.studies.janot2009.haptic import variations
from robid.studies.janot2009.seeded import Judged, errors_of, verdict_figures
from robid.studies.page import Asked

TRUTH = np.array([2.0, 3.0, 4.0])


def judged(**changes):
    scatter = 0.01 * np.array([[-1.0, 1, -1], [1, -1, 1], [-1, 1, 1], [1, -1, -1]])
    made = Judged(
        names=("inertia", "x", "y"),
        units=("kg m^2", "kg m", "kg m"),
        truth=TRUTH,
        size=np.array([2.0, 5.0, 5.0]),
        trust=np.array([1, 1, 0, 1]),
        alarms=np.array([[0, 0, 0, 0], [0, 0, 0, 0], [1, 1, 0, 0], [0, 0, 0, 0]]),
        plain=TRUTH + np.array([0.5, -1.0, 0.0]) + scatter,
        instrumental=TRUTH + np.array([0.0, 0.2, 0.0]) + scatter,
        deviation=np.array([[3.0, 4.0]] * 4),
        value=np.array([[2.0, 4.0, 8.0], [1.0, 4.0, 10.0]]),
        std=np.full((2, 3), 0.1),
        sigma=np.array([[0.04], [0.03]]),
        iterations=np.array([1, 5]),
        time_s=np.arange(3.0),
        residual=np.array([[0.1], [np.nan], [-0.1]]),
        weight=np.array([[1.0], [np.nan], [0.5]]),
        sentence="Do not trust.",
    )
    return replace(made, **changes)


def test_errors_are_those_of_the_means_and_a_vectors_of_its_norm():
    errors = errors_of(judged())
    np.testing.assert_allclose(errors.least_squares, [25, 20, 0], atol=1e-9)
    np.testing.assert_allclose(errors.instruments, [0, 4, 0], atol=1e-9)
    one = 0.01 * np.sqrt(4 / 3) / 2
    np.testing.assert_allclose(errors.standard, 100 * one / np.array([2.0, 5, 5]))
    assert errors.excess == pytest.approx(2)  # 4 % where 2 % are allowed


def test_what_scatters_may_be_further_off():
    offset = np.array([[0, -0.8, 0], [0, 1.2, 0], [0, -0.8, 0], [0, 1.2, 0]])
    wide = judged(instrumental=TRUTH + offset)
    assert errors_of(wide).excess == pytest.approx(0.2 / (3 * np.sqrt(4 / 3) / 2))


def test_shares_count_right_verdicts():
    figures = verdict_figures("arm", {"good": judged(), "bad": judged()})
    assert figures["arm.good.verdict_share"] == 0.75
    assert figures["arm.bad.verdict_share"] == 0.25
    assert figures["arm.good.sigma"] == pytest.approx(np.sqrt(12.5))
    assert figures["arm.bad.alarms.huber"] == 0.25
    assert figures["arm.bad.alarms.whiteness"] == 0


def test_variations_are_those_of_eq_22():
    assert variations(judged(), 1) == pytest.approx({"inertia": 50, "x": 0, "y": 25, "sigma": 25})


@pytest.mark.parametrize(("value", "reached"), [(0.9, False), (1.0, True), (2.0, True), (2.1, False)])
def test_limits_are_part_of_what_is_asked(value, reached):
    assert Asked(1.0, 2.0).is_reached(value) is reached
