"""Populations, outliers and drifts: closed forms, known truths, statsmodels."""

import numpy as np
import pytest
import statsmodels.api as sm
from scipy.stats import t as student
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.outliers_influence import OLSInfluence

from robid.fleet.drift import find_drifts, followed
from robid.fleet.population import FEWEST_ROBOTS, Population, Trait, find_outliers, holm, population, populations

CUT = 0.973337  # variance of a standard normal distribution within three deviations


@pytest.fixture
def generator():
    return np.random.default_rng(3)


def trait(value, std, *, only_large=False):
    return Trait(np.arange(len(value)), value, std, only_large)


def accused(value, std, robots=None, *, only_large=False):
    traits = [trait(value, std, only_large=only_large)]
    robots = np.arange(len(value)) if robots is None else robots
    return [each.row for each in find_outliers(traits, populations(traits, robots))]


def test_the_spread_is_the_variance_less_that_of_the_errors(generator):
    value = generator.uniform(-1, 1, 200)
    found = population(value, np.full(200, 0.2))
    assert found.centre == pytest.approx(value.mean())
    assert found.spread == pytest.approx(np.sqrt(value.var(ddof=1) / CUT - 0.04), rel=1e-5)
    assert found.centre_std == pytest.approx(np.sqrt((found.spread**2 + 0.04) / 200))
    assert found.kept.all()


def test_values_of_one_robot_are_alike_where_errors_explain_them(generator):
    assert population(0.1 * generator.standard_normal(30), np.ones(30)).spread == 0
    same = population(np.full(5, 2.0), np.zeros(5))
    assert (same.centre, same.spread) == (2.0, 0.0)


def test_a_third_of_strangers_moves_neither_centre_nor_spread(generator):
    own, std = 5 + 0.1 * generator.standard_normal(200), np.full(300, 0.02)
    found = population(np.concatenate([own, generator.uniform(7, 12, 100)]), std)
    assert found.centre == pytest.approx(5, abs=0.03)
    assert found.spread == pytest.approx(0.1, rel=0.15)
    assert not found.kept[200:].any()


def test_precise_values_count_more(generator):
    std = np.where(np.arange(400) < 40, 0.01, 3.0)
    value = std * generator.standard_normal(400)
    found = population(value, std)
    assert abs(found.centre) < 0.02
    assert found.spread < 0.02


def test_a_robot_that_was_measured_often_counts_once(generator):
    value = np.concatenate([generator.standard_normal(30), np.full(60, 2.0)])
    robots = np.concatenate([np.arange(30), np.full(60, 77)])
    (found,) = populations([trait(value, np.full(90, 0.01))], robots)
    assert found.robots == 31
    once = population(value[:31], np.full(31, 0.01))
    assert found.centre == pytest.approx(once.centre, abs=1e-6)
    assert found.spread == pytest.approx(once.spread, rel=1e-6)


@pytest.mark.parametrize(("count", "fleets"), [(FEWEST_ROBOTS, 400), (40, 400)])
def test_hardly_a_sound_fleet_has_a_robot_accused(generator, count, fleets):
    wrong = 0
    for _ in range(fleets):
        std = 0.3 * generator.uniform(0.5, 1.5, count)
        wrong += bool(accused(generator.standard_normal(count) + std * generator.standard_normal(count), std))
    assert wrong <= 0.025 * fleets


def test_the_chance_of_the_farthest_value_is_that_of_its_deleted_residual(generator):
    value = generator.standard_normal(12)
    value[4] += 6
    found = population(value, np.zeros(12)).chance(value, np.zeros(12))
    residual = OLSInfluence(sm.OLS(value, np.ones(12)).fit()).resid_studentized_external[4]
    assert found[4] == pytest.approx(2 * student.sf(residual, 12 - 1 - 2))
    assert found.argmin() == 4


def test_a_cut_that_leaves_out_too_much_accuses_nobody():
    """The three at the ends are beyond three deviations of the six in the middle, who are alike by chance."""
    value = np.array([-0.02, -0.01, 0.0, 0.0, 0.01, 0.02, 0.1, 0.2, -0.3])
    found = population(value, np.zeros(9))
    assert found.kept.sum() == 6
    assert found.chance(value, np.zeros(9)).min() > 0.01 / 9
    cut = 2 * student.sf(np.abs(found.away(value, np.zeros(9))), 4)
    assert cut.min() < 0.01 / 9, "as chances were found that did not know of the cut"


@pytest.mark.parametrize("count", [8, 12])
def test_the_least_chance_of_a_sound_fleet_is_below_a_level_as_often_as_it_says(generator, count):
    value = generator.standard_normal((1500, count))
    least = [
        Population(0.0, 0.0, 1.0, 1.0, np.ones(count, bool), np.ones(count)).chance(own, np.zeros(count)).min()
        for own in value - np.median(value, axis=1)[:, None]
    ]
    assert np.mean(np.array(least) * count <= 0.01) <= 0.013


@pytest.mark.slow
@pytest.mark.parametrize("error", [0.0, 1.0])
@pytest.mark.parametrize(("count", "draws"), [(8, 7000), (12, 5000), (30, 3000), (100, 1200)])
def test_the_level_of_a_fleet_holds_for_any_number_of_robots_and_parameters(count, draws, error):
    """Errors differ by half, and are none or as large as what robots differ by; parameters are independent."""
    generator, least = np.random.default_rng(31), []
    for _ in range(draws):
        std = error * np.exp(0.5 * generator.standard_normal(count))
        value = generator.standard_normal(count) + std * generator.standard_normal(count)
        least.append(population(value, std).chance(value, std).min() * count)
    for parameters in (1, 10, 20):
        share = np.mean(np.array(least) <= 0.01 / parameters)
        allowed = 0.013 / parameters
        assert share <= allowed + 3 * np.sqrt(allowed / draws)


@pytest.mark.parametrize(("robots", "soft", "spread"), [(10, 1, 0.03), (30, 1, 0.05), (30, 3, 0.03), (30, 3, 0.01)])
def test_softened_springs_are_found_in_small_fleets(generator, robots, soft, spread):
    found = 0
    for _ in range(10):
        value = spread * generator.standard_normal(robots)
        value[:soft] += np.log(0.7)
        found += set(accused(value, np.full(robots, 0.005))) == set(range(soft))
    assert found >= 9


@pytest.mark.parametrize("std", [0.0, 0.1])
@pytest.mark.parametrize("seven", [np.zeros(7), np.arange(7) / 10])
def test_extremes_are_judged_without_an_error(seven, std):
    """Values of one kind, of two, and one that is far away; two kinds in equal shares are no outliers."""
    for value in (np.append(seven, 0.0), np.append(seven, 1e9), np.append(seven, 1e60), np.append(seven, seven + 1)):
        expected = [7] if value[7] > 1e8 else []
        assert accused(value, np.full(value.size, std)) == expected


def test_misfits_of_two_values_are_judged_without_an_error(generator):
    for pair in np.log(np.round(generator.uniform(0.2, 2, (200, 2)), 6)):
        assert accused(np.repeat(pair, 7), np.zeros(14)) == []


def test_the_softened_robots_are_found_and_those_alone_that_are_known_well_enough(generator):
    value, std = np.log(generator.uniform(0.95, 1.05, 300)), np.full(300, 0.01)
    value[[7, 100, 250]] += np.log(0.7)
    std[100] = 0.5
    assert sorted(accused(value, std)) == [7, 250]


def test_rows_of_two_populations_are_compared_with_their_own(generator):
    """The third row is one of the others; together they are held to the level of one fleet."""
    value = np.concatenate([0.01 * generator.standard_normal(30), 1 + 0.01 * generator.standard_normal(30)])
    value[3] = 1.0
    rows = np.arange(60)
    traits = [Trait(rows[own], value[own], np.full(30, 0.001)) for own in (rows < 30, rows >= 30)]
    [found] = find_outliers(traits, populations(traits, rows))
    assert (found.row, found.trait, found.away > 50) == (3, 0, True)
    assert found.chance < 60 * 1e-12


def test_a_small_misfit_accuses_nobody(generator):
    value = 0.1 * generator.standard_normal(50)
    value[4], value[7] = -3.0, 3.0
    assert sorted(accused(value, np.zeros(50))) == [4, 7]
    assert accused(value, np.zeros(50), only_large=True) == [7]


def test_too_few_robots_accuse_nobody():
    value = np.array([0.0, 0.1, -0.1, 0.05, -0.05, 0.02, 100.0, 0.0])
    assert accused(value, np.full(8, 0.01)) == [6]
    assert accused(value[1:], np.full(7, 0.01)) == []
    assert accused(value, np.full(8, 0.01), np.array([1, 1, 2, 3, 4, 5, 6, 7])) == []
    assert find_outliers([], ()) == ()


def test_chances_are_adjusted_as_holm_has_it(generator):
    chance = generator.uniform(0, 0.2, 50) ** 3
    np.testing.assert_allclose(holm(chance), multipletests(chance, method="holm")[1])


def measured(generator, robots, times, scatter, slope=0.0):
    """Rows of robots at some times; the first robot changes."""
    time = np.tile(np.arange(times, dtype=float), robots)
    own = np.repeat(np.arange(robots), times)
    level = 5 * generator.standard_normal(robots)
    value = level[own] + scatter * generator.standard_normal(own.size) + slope * time * (own == 0)
    return value, own, time


def test_the_slope_of_a_drift_is_that_of_weighted_least_squares(generator):
    value, robots, time = measured(generator, 1, 8, 0.0, slope=0.5)
    std = generator.uniform(0.1, 0.3, 8)
    value = value + 0.2 * std * generator.standard_normal(8)
    (drift,) = find_drifts([trait(value, std)], robots, time, level=1.0)
    line = sm.WLS(value, sm.add_constant(time), 1 / std**2).fit(cov_type="fixed scale")
    assert drift.slope == pytest.approx(line.params[1])
    assert drift.slope_half_width == pytest.approx(line.bse[1] * student.ppf(0.975, 3))
    assert drift.change_half_width == pytest.approx(7 * drift.slope_half_width)
    assert drift.change == pytest.approx(7 * drift.slope)
    assert drift.count == 8


@pytest.mark.parametrize("times", [2, 5])
def test_the_robot_that_changes_is_found_among_those_that_differ_from_day_to_day(generator, times):
    value, robots, time = measured(generator, 20, times, 0.1, slope=2.0)
    still = np.zeros(value.size)
    drifts = find_drifts([trait(still, still + 1), trait(value, np.full(value.size, 0.01))], robots, time)
    assert [(drift.robot, drift.trait) for drift in drifts] == [(0, 1)]
    assert drifts[0].slope == pytest.approx(2.0, abs=0.3)


def test_what_differs_from_day_to_day_alone_is_no_drift(generator):
    clear = 0
    for _ in range(100):
        value, robots, time = measured(generator, 15, 4, 0.1)
        clear += bool(find_drifts([trait(value, np.full(value.size, 0.01))], robots, time))
    assert clear <= 4


def test_a_misfit_that_falls_is_no_drift(generator):
    value, robots, time = measured(generator, 20, 5, 0.1, slope=2.0)
    std = np.full(value.size, 0.01)
    for sign, two_sided, one_sided in ((1, [0], [0]), (-1, [0], [])):
        assert [each.robot for each in find_drifts([trait(sign * value, std)], robots, time)] == two_sided
        assert [
            each.robot for each in find_drifts([trait(sign * value, std, only_large=True)], robots, time)
        ] == one_sided


def test_robots_with_values_of_different_times_are_followed():
    time = np.array([0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
    robots = np.array([4, 4, 7, 7, 9, 9])
    some = Trait(np.array([0, 1, 2, 3, 4]), np.zeros(5), np.ones(5))
    assert followed([some], robots, time).tolist() == [4]
    assert followed([some, Trait(np.array([4, 5]), np.zeros(2), np.ones(2))], robots, time).tolist() == [4, 9]
    assert followed([], robots, time).tolist() == []


def test_robots_that_were_measured_once_do_not_drift(generator):
    value, robots, time = measured(generator, 5, 1, 0.1)
    assert find_drifts([trait(value, np.full(5, 0.01))], robots, time, level=1.0) == ()
    assert find_drifts([], robots, time) == ()
