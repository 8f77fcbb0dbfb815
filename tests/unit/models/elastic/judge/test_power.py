"""How large a defect data would have shown: the closed form of one element, trials of many, and of a whole fit."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, f, ncx2

from exact_systems import exact_frf, two_joint_robot
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.kinds import list_nuisances, moved_robot
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.grading import share_limit, telling_shares
from robid.models.elastic.judge.power import POWER, Elements, detectable_defects
from robid.models.elastic.page.power import power_rows, power_section, power_summary

WITHOUT_END = 1e9


def _elements(count, freedom, known=WITHOUT_END):
    freedom, known = np.full(count, float(freedom)), np.full(count, float(known))
    return Elements(freedom, known, f.ppf(0.95, freedom, known))


@pytest.mark.parametrize("freedom", [1, 6, 80])
def test_a_single_element_has_the_power_of_the_noncentral_chi_square(freedom):
    # Of one element the share is 0 or 1: it is beyond its limit or not.
    def exact(noncentrality):
        return ncx2.sf(chi2.ppf(0.95, freedom), freedom, noncentrality)

    shown = _elements(1, freedom).smallest_shown(np.ones(1), 100.0)
    assert exact(shown**2) == pytest.approx(POWER, abs=0.015)  # as near as Patnaik comes


def _seen(generator, freedom, known, limit, amount, slopes, trials=4000):
    """Share of the trials of a linear model in which more elements are beyond their limits than are allowed."""
    # Rows of an element's residual: noise of one, and what the defect leaves, alike in all of them.
    square = (generator.standard_normal((trials, slopes.size, freedom)) + amount * slopes[:, None]) ** 2
    variance = generator.chisquare(known, (trials, slopes.size)) / known
    beyond = square.sum(axis=-1) / variance / freedom > limit
    return np.mean(beyond.mean(axis=1) > share_limit(slopes.size))


@pytest.mark.parametrize("known", [12, 200])
@pytest.mark.parametrize("part", [1.0, 0.3])
def test_the_amount_is_seen_in_as_many_trials_as_it_says(known, part):
    # A defect that acts on all elements, or on a part of them by different amounts.
    generator = np.random.default_rng(1)
    count, freedom = 60, 10
    slopes = np.linspace(0.2, 1.0, count) * (np.arange(count) < part * count)
    elements = _elements(count, freedom, known)
    amount = elements.smallest_shown(freedom * slopes**2, 100.0)
    seen = _seen(generator, freedom, known, elements.limit, amount, slopes)
    assert seen == pytest.approx(POWER, abs=0.04)
    assert _seen(generator, freedom, known, elements.limit, 0.0, slopes) < 0.02


def test_what_no_element_feels_is_never_seen():
    assert np.isinf(_elements(20, 10).smallest_shown(np.zeros(20), 10.0))
    # One element of many is less than the share that chance gives.
    assert np.isinf(_elements(100, 10).smallest_shown(1.0 * (np.arange(100) == 0), 10.0))


def test_louder_noise_hides_larger_defects_in_proportion():
    slopes = np.linspace(0.5, 1.0, 30)
    quiet, loud = (_elements(30, 10).smallest_shown(slopes / noise**2, 1e3) for noise in (1.0, 10.0))
    assert loud / quiet == pytest.approx(10.0, rel=5e-3)


FREQUENCY_HZ = np.geomspace(1, 60, 30)
PLACES = np.array([[-0.3, 0.5], [0.4, -0.8], [0.9, 1.2], [-1.1, 0.3], [0.2, 1.6], [1.3, -0.4]])
OPTIONS = ElasticOptions(starts=1)
DEFECT = "elbow.mass"


def _fitted(noise, percent=0.0):
    robot = two_joint_robot()
    defect = next(each for each in list_nuisances(robot, OPTIONS) if each.name == DEFECT)
    true = moved_robot(robot, [defect], np.array([percent]))
    frf = exact_frf(true, PLACES, FREQUENCY_HZ, relative_noise=noise, seed=3)
    solution = fit_elastic(robot, frf, OPTIONS, 0.0)
    return replace(solution, detectable=detectable_defects(robot, solution, frf, OPTIONS, 0.0))


@pytest.fixture(scope="module")
def sound():
    return _fitted(1e-3)


def _shown(solution):
    return solution.detectable.amount[solution.detectable.names.index(DEFECT)]


def test_a_defect_is_seen_from_about_the_amount_that_is_told(sound):
    def seen(amount):
        error = _fitted(1e-3, amount).model_error
        return telling_shares(error)[0] > share_limit(error.count)

    assert not seen(0.4 * _shown(sound))
    assert seen(2.0 * _shown(sound))


def test_springs_move_by_what_is_told(sound):
    springs = [name.endswith("stiffness") for name in sound.estimate.names]
    amount = 0.5
    moved = (_fitted(1e-3, amount).internal.values - sound.internal.values)[springs]
    told = amount * sound.detectable.moves[springs, sound.detectable.names.index(DEFECT)]
    assert np.abs(told).min() > 1e-3
    np.testing.assert_allclose(moved, told, rtol=0.02)


def test_page_and_numbers_say_what_would_have_been_seen(sound):
    rows = power_rows(sound)
    assert {row.name for row in rows} == set(sound.detectable.names)
    (section,) = power_section(rows, sound.estimate.confidence)
    assert f"{sum(row.over_known > 1 for row in rows)} of {len(rows)}" in section.lead
    numbers = power_summary(rows)
    assert numbers[f"detectable.{DEFECT}"] == pytest.approx(_shown(sound))
    assert np.isfinite(list(numbers.values())).all()
    without = replace(sound, detectable=None)
    assert power_rows(without) == () == power_section((), 0.95)
    assert power_summary(()) == {}
