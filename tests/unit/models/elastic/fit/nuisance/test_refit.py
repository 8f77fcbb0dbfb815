"""Springs that a file lacks are put in place where data call for them, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors, without_spring
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.nuisance.missing_springs import add_missing_springs, expected_cost
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Inertial, Spring

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
DELAY_S = 1e-3
OPTIONS = ElasticOptions()


def settled(stated, true, seed=5, options=OPTIONS):
    frf = exact_frf(true, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=seed)
    problem, _ = set_up(stated, frf, options, DELAY_S)
    best = optimise(problem, np.zeros(len(problem.parameters.names))).parameters
    nuisances = list_nuisances(stated, options)
    columns = nuisance_columns(problem, best, stated, options, nuisances)
    return problem, best, add_missing_springs(problem, best, stated, options, nuisances, columns)


@pytest.fixture(scope="module")
def true_arm():
    return with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])


def stiffness_of(found, name):
    problem = found.problem
    return problem.parameters.values(found.internal)[problem.parameters.names.index(f"{name}.stiffness")]


@pytest.mark.parametrize("factor", [1.0, 4.0])
def test_a_bearing_that_the_file_lacks_is_put_in_place_and_the_gears_are_right_again(true_arm, factor):
    soft = [replace(s, stiffness=factor * s.stiffness) if s.name == "bearing_1" else s for s in true_arm.springs]
    true_arm = replace(true_arm, springs=tuple(soft))
    problem, best, found = settled(without_spring(two_joint_robot(), "bearing_1"), true_arm)
    assert found.springs == ("bearing_shoulder_x",)
    np.testing.assert_allclose(stiffness_of(found, "bearing_shoulder_x"), true_arm.springs[2].stiffness, rtol=0.01)
    np.testing.assert_allclose(stiffness_of(found, "gear_1"), 2.6e4, rtol=3e-3)
    before = problem.parameters.values(best)[problem.parameters.names.index("gear_1.stiffness")]
    assert abs(before / 2.6e4 - 1) > 0.005
    assert found.robot.springs[-1].name == "bearing_shoulder_x"
    assert "bearing_shoulder_x.compliance" not in {
        nuisance.name for nuisance in list_nuisances(found.robot, found.options)
    }


def test_two_missing_bearings_are_both_put_in_place(true_arm):
    extra = Spring("bearing_2", 1, "bearing", np.array([0.0, 1.0, 0.0]), 1.2e4, 10.0)
    true = replace(true_arm, springs=(*true_arm.springs, extra))
    _, _, found = settled(without_spring(two_joint_robot(), "bearing_1"), true)
    assert set(found.springs) == {"bearing_shoulder_x", "bearing_elbow_y"}
    np.testing.assert_allclose(stiffness_of(found, "gear_2"), 0.8 * 6e3, rtol=5e-3)


def test_dampers_that_no_fit_estimates_do_not_keep_missing_bearings_from_their_place(true_arm):
    extra = Spring("bearing_2", 1, "bearing", np.array([0.0, 1.0, 0.0]), 1.2e4, 10.0)
    true = replace(true_arm, springs=(*true_arm.springs, extra))
    options = ElasticOptions(free=("stiffness", "viscous", "delay", "motor_inertia"))
    _, _, found = settled(without_spring(two_joint_robot(), "bearing_1"), true, options=options)
    assert set(found.springs) == {"bearing_shoulder_x", "bearing_elbow_y"}
    # Held at the file's values, dampers that are off leave this gear 1 % too soft.
    np.testing.assert_allclose(stiffness_of(found, "gear_2"), 0.8 * 6e3, rtol=2e-3)
    assert found.cost < expected_cost(found.problem)


@pytest.mark.parametrize("payload", [1.0, 1.1])
def test_nothing_is_put_in_place_where_the_file_is_right_or_something_else_is_off(true_arm, payload):
    load = true_arm.payload
    heavier = Inertial(payload * load.mass_kg, load.com_m, payload * load.inertia_kgm2)
    problem, best, found = settled(two_joint_robot(), replace(true_arm, payload=heavier))
    assert found.springs == ()
    assert found.problem is problem
    np.testing.assert_array_equal(found.internal, best)
