"""Visits proposed one after the other, each after a fit, beside a design made at once with the truth known."""

from pathlib import Path

import numpy as np
import pytest

from exact_systems import exact_frf
from robid.design.configurations.comparison import next_visits
from robid.design.configurations.options import InformationOptions
from robid.design.configurations.prediction import ExpectedError
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.solution import fitted_robot
from robid.models.known import load_experiment
from robid.pipeline.configurations import draw_in_reach
from robid.pipeline.design_prediction import assumed_parts
from robid.pipeline.design_tasks import AssumedTask
from robid.settings.experiment import RandomConfigurations
from robid.simulate.options import Truth
from robid.simulate.truth import true_robot

pytestmark = pytest.mark.slow

OFFERED, FIRST, STEPS = 40, 3, 5
PERIOD_S, DELAY_S = 1e-3, 1e-3
LINES_HZ = np.unique(np.round(5 * np.geomspace(2, 80, 20))) / 5
ABOUT = InformationOptions(free=("stiffness",), nuisance=("viscous",), fixed=("forearm.stiffness",))
OPTIONS = ElasticOptions(
    free=("stiffness", "viscous"), fixed=("forearm.stiffness",), weights=Weights(kind="user"), agreeing_starts=1
)


@pytest.fixture(scope="module")
def kr300():
    loaded = load_experiment(Path(__file__).parents[2] / "configs/kr300.yaml")
    robot = loaded.robot.to_robot()
    return robot, draw_in_reach(loaded, robot, RandomConfigurations(count=OFFERED, seed=3))


def error_at(robot, candidates):
    """What is expected of visits, were this robot the true one; and the number of wanted parameters."""
    task = AssumedTask((robot,), ABOUT, DELAY_S, candidates, LINES_HZ, PERIOD_S)
    wanted = len(robot.springs) - 1
    parts = assumed_parts(task, np.full(wanted, 0.02))
    return ExpectedError(parts, parts.known(None)), wanted


def figure(error, counts, wanted, purpose):
    if purpose == "prediction":
        return np.sqrt(sum(error.errors(counts)))
    covariance = error.covariance(counts)[0, :wanted, :wanted]
    return np.exp(np.linalg.slogdet(covariance)[1] / (2 * wanted))


def at_once(error, wanted, purpose, count):
    """Exchange of single configurations from random starts, by this file's own figure."""
    found = []
    for seed in range(3):
        chosen = list(np.random.default_rng(seed).choice(OFFERED, count, replace=False))
        best = np.inf
        while True:
            begun = best
            for place in range(count):
                rest = [each for at, each in enumerate(chosen) if at != place]
                values = [
                    figure(error, np.bincount([*rest, at], minlength=OFFERED), wanted, purpose) for at in range(OFFERED)
                ]
                if min(values) < best * (1 - 1e-9):
                    best, chosen[place] = min(values), int(np.argmin(values))
            if best == begun:
                break
        found.append((best, chosen))
    return min(found)


@pytest.mark.parametrize("purpose", ["parameters", "prediction"])
@pytest.mark.parametrize("seed", range(4))
def test_five_proposed_visits_end_near_the_design_made_at_once_with_the_truth_known(kr300, seed, purpose):
    robot, candidates = kr300
    truth = true_robot(robot, Truth(spring_factor=1.5, friction_relative=0.15, seed=seed + 1))
    # What is measured first is designed by the robot file.
    visited = [int(each) for each in at_once(*error_at(robot, candidates), purpose, FIRST)[1]]
    for step in range(STEPS):
        places = candidates[visited]
        frf = exact_frf(truth, places, LINES_HZ, delay_s=DELAY_S, relative_noise=0.01, seed=10 * seed + step)
        solution = fit_elastic(robot, frf, OPTIONS, DELAY_S)
        error, wanted = error_at(fitted_robot(robot, solution.estimate), candidates)
        _, best = next_visits(error, np.bincount(visited, minlength=OFFERED), wanted, OFFERED)
        chosen = [each.candidate for each in best if each.purpose == purpose]
        assert chosen, "with so few visits, one more helps"
        visited += chosen
    error, wanted = error_at(truth, candidates)
    ended = figure(error, np.bincount(visited, minlength=OFFERED), wanted, purpose)
    best, _ = at_once(error, wanted, purpose, FIRST + STEPS)
    begun = figure(error, np.bincount(visited[:FIRST], minlength=OFFERED), wanted, purpose)
    print(f"{purpose} {seed}: {begun:.4g} at first, {ended:.4g} after five, {best:.4g} at once, {ended / best:.3f}")
    assert ended <= 1.1 * best
