"""Robots that are off by what they are doubted for: exact responses against the nuisances' own derivatives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.nuisance.columns import column
from robid.models.elastic.fit.nuisance.effects import Hysteresis
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.nuisance.scene import Scene
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.known import load_experiment
from robid.studies.trust.linear import Perturbed, as_file, draw_perturbed, load_shares, perturbed_responses

CONFIGS = Path(__file__).parents[4] / "configs"
OPTIONS = ElasticOptions(free=("stiffness", "damping"))
PLACES = np.array([[0.3, -0.8], [0.9, 0.4], [-0.5, 1.2]])
FREQUENCY_HZ = np.geomspace(2, 60, 12)
SAMPLING = 1e-3, 2e-3


def responses(off, robot=None):
    return perturbed_responses(robot or two_joint_robot(), off, PLACES, FREQUENCY_HZ, SAMPLING)


def off_by(index, amount):
    plain = as_file(two_joint_robot(), OPTIONS, len(PLACES))
    amounts = plain.amounts.copy()
    amounts[index] = amount
    return replace(plain, amounts=amounts)


def test_a_robot_that_is_as_its_file_has_its_response():
    robot = two_joint_robot()
    exact = exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=SAMPLING[1]).response
    np.testing.assert_allclose(responses(as_file(robot, OPTIONS, len(PLACES))), exact, rtol=1e-10)


def test_small_amounts_do_what_the_nuisances_derivatives_say():
    robot = two_joint_robot()
    frf = exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=SAMPLING[1], declared_noise=1e-3)
    problem = set_up(robot, frf, OPTIONS, SAMPLING[1])[0]
    scene = Scene(problem, np.zeros(len(problem.parameters.names)), robot, OPTIONS)
    nuisances, nothing = list_nuisances(robot, OPTIONS), responses(as_file(robot, OPTIONS, len(PLACES)))
    assert any(isinstance(nuisance.effect, Hysteresis) for nuisance in nuisances)
    assert {nuisance.cause for nuisance in nuisances} >= {"payload", "masses", "torque_constant", "missing_spring"}
    for index in range(len(nuisances)):
        step = 1e-3 * nuisances[index].common_std
        found = np.log(responses(off_by(index, step)) / nothing) / step
        wanted = column(nuisances[index].effect, scene)
        assert np.linalg.norm(found - wanted) < 0.02 * np.linalg.norm(wanted), nuisances[index].name


def test_amounts_are_drawn_from_their_priors():
    robot = two_joint_robot()
    drawn = [draw_perturbed(robot, OPTIONS, 40, seed) for seed in range(150)]
    nuisances, amounts = drawn[0].nuisances, np.array([one.amounts for one in drawn])
    np.testing.assert_array_equal(amounts[3], draw_perturbed(robot, OPTIONS, 40, 3).amounts)
    for nuisance, own in zip(nuisances, amounts.transpose(1, 0, 2), strict=True):
        if nuisance.least == 0:
            assert (own >= 0).all()
            continue
        total = np.hypot(nuisance.common_std, nuisance.cluster_std)
        assert np.sqrt(np.mean(own**2)) == pytest.approx(total, rel=0.25), nuisance.name
        assert own.std(axis=1).mean() == pytest.approx(nuisance.cluster_std, rel=0.1, abs=1e-12), nuisance.name


def test_every_place_has_its_own_torque_constants():
    nuisances = list_nuisances(two_joint_robot(), OPTIONS)
    index = [nuisance.name for nuisance in nuisances].index("elbow.torque_constant")
    plain = as_file(two_joint_robot(), OPTIONS, len(PLACES))
    amounts = plain.amounts.copy()
    amounts[index] = [0.0, 5.0, -20.0]
    ratio = responses(Perturbed(nuisances, amounts)) / responses(plain)
    np.testing.assert_allclose(ratio[..., 0], 1.0)
    np.testing.assert_allclose(ratio[:, 0, 0, 1], 1 / np.array([1.0, 1.05, 0.8]))


def test_an_upright_axis_bears_the_same_load_everywhere():
    robot = load_experiment(CONFIGS / "kr300.yaml").robot.to_robot()
    places = np.random.default_rng(1).uniform(-1, 1, (8, 6))
    most = np.abs(load_shares(robot, places)).max(axis=0)
    names = [spring.name for spring in robot.springs]
    assert most[names.index("gear_1")] == 0  # rounding alone: no load
    assert most[names.index("gear_2")] == 1
