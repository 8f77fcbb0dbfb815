"""A bearing that the file lacks, in line with a gear, under noise that hides it from every element of a response."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from exact_systems import exact_frf
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.grading import is_unexplained
from robid.models.elastic.judge.hidden import hidden_findings
from robid.models.elastic.judge.power import detectable_defects
from robid.models.known import load_experiment

KR300 = Path(__file__).parents[2] / "configs" / "kr300.yaml"
FREQUENCY_HZ = np.geomspace(2.0, 80.0, 60)
OPTIONS = ElasticOptions()
BEARING, GEAR, SHARE = "bearing_axis_5_y", "gear_4.stiffness", 0.5
NOISE = 0.12


@cache
def _robot():
    return load_experiment(KR300).robot.to_robot(150.0)


@cache
def _fitted(compliance):
    """A fit of the robot's file to a robot with a bearing of this share of its gear's compliance."""
    robot = true = _robot()
    if compliance:
        lacking = next(each for each in list_nuisances(robot, OPTIONS) if each.name == f"{BEARING}.compliance")
        spring = lacking.effect.spring
        softer = replace(spring, stiffness=spring.stiffness / compliance, damping=spring.damping / compliance)
        true = replace(robot, springs=(*robot.springs, softer))
    places = np.random.default_rng(2).uniform(-1.0, 1.0, (8, 6)) + np.deg2rad([0, -60, 70, 0, 40, 0])
    frf = exact_frf(true, places, FREQUENCY_HZ, relative_noise=NOISE, seed=4)
    solution = fit_elastic(robot, frf, OPTIONS, 0.0)
    return replace(solution, detectable=detectable_defects(robot, solution, frf, OPTIONS, 0.0))


def test_a_bearing_that_noise_hides_is_named_where_it_ruins_a_gear():
    solution = _fitted(SHARE)
    row = solution.estimate.names.index(GEAR)
    truth = next(each.stiffness for each in _robot().springs if GEAR.startswith(each.name))
    lower, upper = np.log([solution.estimate.lower[row], solution.estimate.upper[row]])
    half_widths = abs(np.log(truth) - 0.5 * (lower + upper)) / (0.5 * (upper - lower))
    assert not is_unexplained(solution)
    assert half_widths > 3
    assert any(
        BEARING in each.message and each.cause == "missing_spring" for each in hidden_findings(_robot(), solution)
    )


def test_a_sound_robot_under_this_noise_keeps_its_trust():
    assert hidden_findings(_robot(), _fitted(0.0)) == ()
