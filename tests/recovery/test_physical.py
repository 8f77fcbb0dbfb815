"""Robots whose files are wrong: intervals of the springs themselves hold them, and name what is wrong."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from exact_systems import certain, exact_frf, stocky, two_joint_robot
from realizations import averaged
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.effects import RobotMove
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.known import FAMILIES, load_experiment
from robid.robot.nuisance import NuisanceStd

KR300 = Path(__file__).parents[2] / "configs" / "kr300.yaml"
FREQUENCY_HZ = np.geomspace(2.0, 60.0, 40)
OPTIONS = ElasticOptions(free=("stiffness", "damping", "motor_inertia"))
STATED = NuisanceStd(
    coupling_std=0.0, arm_friction=0.0, friction=0.0, loss_factor=0.0, load_stiffness=0.0, compliance=0.0, delay_s=0.0
)
PLACES, RUNS = 6, 30


def perturbed_robot(robot):
    """The robot whose masses, payload and torque constants are stated as well as any, all else exactly."""
    sure = certain(robot)
    return replace(
        sure, joints=tuple(replace(joint, nuisance_std=STATED) for joint in sure.joints), nuisance_std=STATED
    )


def drawn(robot, generator):
    """A true robot that is off by what its file may be, and by how much its torques are measured too large."""
    true, scale = robot, np.ones(len(robot.joints))
    for nuisance in list_nuisances(robot, OPTIONS):
        amount = nuisance.common_std * generator.standard_normal()
        if isinstance(nuisance.effect, RobotMove):
            true = nuisance.effect.moved(true, amount)
        else:
            scale[nuisance.effect.joint] += amount / 100
    return true, scale


@cache
def fits():
    """Estimates of robots that are off by what their files say, and their true springs."""
    nominal, found = perturbed_robot(stocky(two_joint_robot())), []
    springs = np.array([spring.stiffness for spring in nominal.springs])
    for seed in range(RUNS):
        generator = np.random.default_rng(seed)
        places = generator.uniform(-1.4, 1.4, (PLACES, 2))
        true, scale = drawn(nominal, generator)
        exact = exact_frf(true, places, FREQUENCY_HZ)
        frf = averaged(replace(exact, response=exact.response / scale), 0.003, seed=seed)
        found.append(fit_elastic(nominal, frf, OPTIONS, 0.0).estimate)
    return found, springs


def held(lower, upper, truth):
    """Share of the springs' intervals that hold the truth."""
    return float(
        np.mean(
            [
                (low[: truth.size] <= truth) & (truth <= high[: truth.size])
                for low, high in zip(lower, upper, strict=True)
            ]
        )
    )


@pytest.mark.slow
def test_intervals_hold_springs_of_robots_that_are_off_by_what_their_files_say():
    estimates, truth = fits()
    share = held([each.lower for each in estimates], [each.upper for each in estimates], truth)
    narrow = held([each.effective_lower for each in estimates], [each.effective_upper for each in estimates], truth)
    half = np.median([0.5 * np.log(each.upper / each.lower)[: truth.size] for each in estimates], axis=0)
    error = np.quantile([np.abs(np.log(each.physical_value[: truth.size] / truth)) for each in estimates], 0.95, axis=0)
    print(f"physical {share:.3f}, effective {narrow:.3f}, half widths {half}, errors {error}")
    # 120 springs: 0.95 less three deviations.
    assert share > 0.89
    assert narrow < 0.6, "what predicts must not hold them, or nothing is off"
    assert np.median(half / error) < 2


def test_few_places_leave_open_what_all_of_it_scales_by():
    nominal = perturbed_robot(two_joint_robot())
    places = np.random.default_rng(3).uniform(-1.4, 1.4, (3, 2))
    frf = averaged(exact_frf(nominal, places, FREQUENCY_HZ), 0.003, seed=1)
    unsure, sure = (fit_elastic(robot, frf, OPTIONS, 0.0).estimate for robot in (nominal, certain(nominal)))
    np.testing.assert_allclose(unsure.value, sure.value)
    np.testing.assert_allclose(unsure.effective_upper, sure.upper)
    assert (unsure.upper / unsure.value > sure.upper / sure.value).all()
    assert np.isinf(unsure.degrees_of_freedom).all()
    # Springs, torque constants, masses and rotors by one factor are the same response: springs are no better known
    # than what is known of the others beforehand, 2 % of torques and payload, 5 % of links and rotors.
    reach = np.log(unsure.upper / unsure.lower)[:4] / 2
    assert (reach > 1.96 / np.sqrt(3 / 0.02**2 + 4 / 0.05**2)).all()
    assert (reach[:3] < 0.04).all()
    assert unsure.interval_rule.endswith("nuisance parameters of the robot file")


@pytest.fixture(scope="module")
def kr300():
    return load_experiment(KR300, FAMILIES).robot.to_robot()


def test_a_wrong_payload_is_named_and_moves_the_springs_themselves_back():
    nominal = perturbed_robot(two_joint_robot())
    unsure = replace(STATED, payload_relative_std=0.1, torque_relative_std=0.0, mass_relative_std=0.0, com_m=0.0)
    joints = tuple(replace(joint, nuisance_std=unsure) for joint in nominal.joints)
    load = nominal.payload
    lighter = replace(load, mass_kg=0.9 * load.mass_kg, inertia_kgm2=0.9 * load.inertia_kgm2)
    places = np.random.default_rng(4).uniform(-1.4, 1.4, (PLACES, 2))
    frf = averaged(exact_frf(nominal, places, FREQUENCY_HZ), 0.003, seed=2)
    wrong = replace(nominal, payload=lighter, joints=joints, nuisance_std=unsure)
    solution = fit_elastic(wrong, frf, OPTIONS, 0.0)
    estimate, nuisances, size = solution.estimate, solution.doubts, len(nominal.springs)
    index = nuisances.names.index("payload.mass")
    assert abs(nuisances.value[index] - 0.1 * load.mass_kg) < nuisances.half_width[index] < 0.05 * load.mass_kg
    truth = np.array([spring.stiffness for spring in nominal.springs])
    error = [np.abs(each[:size] / truth - 1).max() for each in (estimate.value, estimate.physical_value)]
    assert error[1] < 0.2 * error[0]
    assert ((estimate.lower[:size] <= truth) & (truth <= estimate.upper[:size])).all()


@pytest.mark.slow
def test_on_a_large_robot_too(kr300):
    load, generator = kr300.payload, np.random.default_rng(5)
    places = generator.uniform(0.8 * kr300.lower, 0.8 * kr300.upper, (8, 6))
    frf = averaged(exact_frf(kr300, places, np.geomspace(2.2, 79.8, 40)), 0.003, seed=1)
    factor = 1 + 5 / load.mass_kg
    heavier = replace(load, mass_kg=factor * load.mass_kg, inertia_kgm2=factor * load.inertia_kgm2)
    solution = fit_elastic(replace(kr300, payload=heavier), frf, ElasticOptions(), 0.0)
    estimate, nuisances = solution.estimate, solution.doubts
    value, half = (
        dict(zip(nuisances.names, each, strict=True))["payload.mass"]
        for each in (nuisances.value, nuisances.half_width)
    )
    print(f"payload {value:.2f} +- {half:.2f} kg")
    assert value + half < 0
    assert abs(value + 5) < half
    truth = np.array([spring.stiffness for spring in kr300.springs])
    size = truth.size
    assert np.mean((estimate.lower[:size] <= truth) & (truth <= estimate.upper[:size])) > 0.85
    error = [np.median(np.abs(each[:size] / truth - 1)) for each in (estimate.value, estimate.physical_value)]
    assert error[1] < 0.6 * error[0]
