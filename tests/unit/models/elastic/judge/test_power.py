"""How large a defect data would have shown: the closed form of one element, trials of many, and of a whole fit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2, f, ncx2

from exact_systems import exact_frf, two_joint_robot
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.effects import moved_robot
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.solution import Detectable
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.grading import grade_validation, share_limit, telling_shares
from robid.models.elastic.judge.hidden import asked_for, hidden_findings, worst_hidden
from robid.models.elastic.judge.power import POWER, Elements, detectable_defects
from robid.models.elastic.page.power import power_rows, power_section, power_summary
from robid.settings.load import load_robot

ROOT = Path(__file__).parents[5]
WITHOUT_END = 1e9


def _elements(count, freedom, known=WITHOUT_END):
    freedom, known = np.full(count, float(freedom)), np.full(count, float(known))
    return Elements(freedom, known, f.ppf(0.95, freedom, known))


def _smallest(elements, noncentrality, largest):
    """The amount of one defect, between others that are seen more and less easily."""
    several = noncentrality[:, None] * [4.0, 1.0, 0.0]
    return elements.smallest_shown(several, np.full(3, largest))[1]


@pytest.mark.parametrize("freedom", [1, 6, 80])
def test_a_single_element_has_the_power_of_the_noncentral_chi_square(freedom):
    # Of one element the share is 0 or 1: it is beyond its limit or not.
    def exact(noncentrality):
        return ncx2.sf(chi2.ppf(0.95, freedom), freedom, noncentrality)

    shown = _smallest(_elements(1, freedom), np.ones(1), 100.0)
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
    amount = _smallest(elements, freedom * slopes**2, 100.0)
    seen = _seen(generator, freedom, known, elements.limit, amount, slopes)
    assert seen == pytest.approx(POWER, abs=0.04)
    assert _seen(generator, freedom, known, elements.limit, 0.0, slopes) < 0.02


def test_what_no_element_feels_is_never_seen():
    assert np.isinf(_smallest(_elements(20, 10), np.zeros(20), 10.0))
    # One element of many is less than the share that chance gives.
    assert np.isinf(_smallest(_elements(100, 10), 1.0 * (np.arange(100) == 0), 10.0))


def test_louder_noise_hides_larger_defects_in_proportion():
    slopes = np.linspace(0.5, 1.0, 30)
    quiet, loud = (_smallest(_elements(30, 10), slopes / noise**2, 1e3) for noise in (1.0, 10.0))
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


@pytest.mark.parametrize("noise", [1e-3, 3e-2])
def test_what_is_unseen_of_a_sound_robot_lies_inside_its_intervals(noise, sound):
    solution = sound if noise == 1e-3 else _fitted(noise)
    assert worst_hidden(two_joint_robot(), solution).half_widths < 1.3
    assert hidden_findings(two_joint_robot(), solution) == ()


GEAR = "gear_2.stiffness"
HALF_WIDTHS = 4.0


def _hiding(solution, **changed):
    """A fit with one defect, as large as known beforehand, that puts the true gear 4 half-widths off its middle."""
    gear, defect = solution.estimate.names.index(GEAR), solution.doubts.names.index(DEFECT)
    lower, value, upper = (np.log(getattr(solution.estimate, end)[gear]) for end in ("lower", "value", "upper"))
    off = 0.5 * (lower + upper) + HALF_WIDTHS * 0.5 * (upper - lower)
    moves = np.zeros((len(solution.estimate.names), 1))
    moves[gear] = value - off  # by an amount of one
    doubts = solution.doubts
    doubts = replace(doubts, value=0 * doubts.value, half_width=changed.pop("left", 1.0) + 0 * doubts.half_width)
    one = Detectable(
        (DEFECT,),
        ("masses",),
        ("%",),
        *(np.array([each]) for each in (-1.0, 1.0, np.inf)),
        moves,
        *np.zeros((2, 1)),
    )
    changed = {key: np.array([each]) for key, each in changed.items()}
    assert doubts.names[defect] == DEFECT
    return replace(solution, doubts=doubts, detectable=replace(one, **changed))


def test_a_defect_that_would_be_hidden_and_ruin_a_gear_takes_trust(sound):
    hiding = _hiding(sound)
    hidden = worst_hidden(two_joint_robot(), hiding)
    assert (hidden.amount, hidden.half_widths) == (1.0, pytest.approx(HALF_WIDTHS))
    (finding,) = hidden_findings(two_joint_robot(), hiding)
    assert DEFECT in finding.message
    assert GEAR in finding.message
    assert grade_validation(hiding, (finding,), ()).value == 1
    assert grade_validation(sound, hidden_findings(two_joint_robot(), sound), ()).value == 2


@pytest.mark.parametrize(
    "known",
    [
        {"upper": 0.1},  # known better beforehand: the other way the gear is no farther
        {"amount": 0.1},  # seen from there on
        {"left": 0.1},  # the estimate of the defect leaves no more
        {"lower": 2.0, "upper": 3.0},  # at least so much, where the estimate says that it is less
    ],
)
def test_a_defect_that_cannot_be_so_large_unseen_takes_nothing(known, sound):
    other_way = {"lower": 0.0} if "lower" not in known else {}
    hiding = _hiding(sound, **other_way, **known)
    assert hidden_findings(two_joint_robot(), hiding) == ()


def test_nothing_is_said_of_link_springs_and_without_nuisance_parameters(sound):
    robot, hiding = two_joint_robot(), _hiding(sound)
    springs = tuple(replace(each, place="split") if each.name == "gear_2" else each for each in robot.springs)
    assert hidden_findings(replace(robot, springs=springs), hiding) == ()
    assert hidden_findings(robot, replace(hiding, doubts=None)) == ()
    assert hidden_findings(robot, replace(hiding, detectable=None)) == ()


def test_a_defect_that_the_residual_asks_for_takes_trust_whatever_is_known_beforehand(sound):
    asking = _hiding(sound, upper=0.1, lower=-0.1, asked=1.0, gain=60.0)
    (finding,) = hidden_findings(two_joint_robot(), asking)
    assert finding.cause == "masses"
    assert asked_for(two_joint_robot(), asking).half_widths == pytest.approx(HALF_WIDTHS)


@pytest.mark.parametrize("asked", [{"gain": 40.0}, {"asked": 0.1}, {"asked": -1.0, "lower": 0.0}])
def test_what_chance_asks_for_or_what_cannot_be_takes_nothing(asked, sound):
    known = {"upper": 0.1, "lower": -0.1, "asked": 1.0, "gain": 60.0}
    assert hidden_findings(two_joint_robot(), _hiding(sound, **(known | asked))) == ()


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_a_start_that_is_off_asks_for_no_defect_where_noise_is_far_below_the_model_error(factor):
    # A gear's hysteresis acts on a single drive nearly as its stiffness does, which the start pulls at.
    true = load_robot(ROOT / "configs/robots/geared_drive.yaml").to_robot()
    springs = tuple(replace(one, stiffness=factor * one.stiffness) for one in true.springs)
    robot = replace(true, springs=springs)
    frf = exact_frf(true, np.zeros((1, 1)), np.geomspace(3, 120, 60), relative_noise=1e-4, seed=3)
    solution = fit_elastic(robot, frf, OPTIONS, 0.0)
    found = replace(solution, detectable=detectable_defects(robot, solution, frf, OPTIONS, 0.0))
    assert asked_for(robot, found) is None


def test_what_shows_is_named_before_what_may_be_hidden(sound):
    robot, hiding = two_joint_robot(), _hiding(sound)
    frf = exact_frf(robot, PLACES, FREQUENCY_HZ, relative_noise=1e-3, seed=3)
    assert assess_fit(robot, hiding, frf, OPTIONS, 0.0).causes == ("hidden",)
    estimate = hiding.estimate
    rubs = estimate.kinds.index("viscous")
    lower, upper = estimate.lower.copy(), estimate.upper.copy()
    lower[rubs], upper[rubs] = -50.0, -30.0  # friction that drives
    contradicting = replace(hiding, estimate=replace(estimate, lower=lower, upper=upper))
    assert assess_fit(robot, contradicting, frf, OPTIONS, 0.0).causes == ("friction", "hidden")


@pytest.mark.parametrize("noise", [1e-3, 3e-2])
def test_no_residual_asks_for_hysteresis_that_nothing_tells_from_the_spring(noise, sound):
    found = (sound if noise == 1e-3 else _fitted(noise, 3.0)).detectable
    same = np.array([name.endswith("hysteresis_never") for name in found.names])
    assert same.any()
    assert not found.asked[same].any()
    assert np.mean(found.asked[~same] != 0) > 0.9
