"""A heavy and a light robot of which something is wrong: it is named, and the misfit falls as promised if followed."""

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from exact_systems import exact_frf
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.moves import with_estimated_springs
from robid.models.elastic.fit.nuisance.wording import free_with
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.causes import explain
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.ratios import with_gear_ratio
from robid.models.elastic.judge.reversals import turned
from robid.robot.description import Inertial, Spring
from robid.settings.load import load_robot

ROBOTS = Path(__file__).parents[2] / "configs" / "robots"
FREQUENCY_HZ = np.geomspace(2, 80, 25)
OPTIONS = ElasticOptions(strategy="plain")
DELAY_S = 1e-3
PLACES = np.random.default_rng(3).uniform(-0.8, 0.8, (4, 6)) + np.array([0, -0.9, 0.9, 0, 0.6, 0])


def robot_of(name):
    if name == "ur5e" and not (Path(os.environ.get("ROBID_DATA", "../shared/data")) / "robot_models").is_dir():
        pytest.skip("shared/data/robot_models is absent")
    return load_robot(ROBOTS / f"{name}.yaml").to_robot()


@pytest.mark.parametrize("name", [pytest.param("kr300", marks=pytest.mark.slow), "ur5e"])
def test_a_payload_that_is_off_by_a_thirtieth_is_named_and_found(name):
    stated = robot_of(name)
    load = stated.payload
    heavier = Inertial(load.mass_kg * 31 / 30, load.com_m, load.inertia_kgm2 * 31 / 30)
    frf = exact_frf(replace(stated, payload=heavier), PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=5e-4)
    before = fit_elastic(stated, frf, OPTIONS, DELAY_S)
    first = explain(fitted_model(stated, before, frf, OPTIONS, DELAY_S))[0]
    assert (first.cause, first.free) == ("payload", ("payload",))
    near = dict(zip(before.estimate.names, before.internal.values.tolist(), strict=True))
    after = fit_elastic(stated, frf, replace(OPTIONS, free=first.free), DELAY_S, near=near)
    assert 1 - after.costs.total / before.costs.total > first.share - 0.05
    assert after.estimate.found["payload.mass"] == pytest.approx(heavier.mass_kg, rel=0.003)


@pytest.mark.parametrize(("name", "joint"), [("kr300", 1), pytest.param("ur5e", 4, marks=pytest.mark.slow)])
def test_a_gear_ratio_that_is_off_by_a_tenth_is_named_and_found(name, joint):
    robot = robot_of(name)
    right = robot.joints[joint].motor.gear_ratio
    frf = exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=2e-3)
    stated = with_gear_ratio(joint, robot, 0.1 * right)
    before = fit_elastic(stated, frf, OPTIONS, DELAY_S)
    first = explain(fitted_model(stated, before, frf, OPTIONS, DELAY_S))[0]
    assert first.cause == "gear_ratio"
    told = float(first.correct[0].partition("gear_ratio: ")[2].partition("`")[0])
    assert told == pytest.approx(right, rel=0.01)
    assert f"for {robot.joints[joint].name} in" in first.correct[0]
    followed = with_gear_ratio(joint, stated, told - stated.joints[joint].motor.gear_ratio)
    after = fit_elastic(followed, frf, OPTIONS, DELAY_S)
    assert 1 - after.costs.total / before.costs.total > first.share - 0.05


def followed_together(stated, hidden, wanted):
    """The fit after all springs that a file lacks were named first, in one list, and freed; it ends at these."""
    frf = exact_frf(
        replace(stated, springs=(*stated.springs, *hidden)),
        *(PLACES, FREQUENCY_HZ),
        delay_s=DELAY_S,
        relative_noise=5e-4,
    )
    before = fit_elastic(stated, frf, OPTIONS, DELAY_S)
    first = explain(fitted_model(stated, before, frf, OPTIONS, DELAY_S))[0]
    assert (first.cause, set(first.free)) == ("missing_spring", set(wanted))
    options = replace(OPTIONS, free=free_with(OPTIONS.free, first.free))
    after = fit_elastic(with_estimated_springs(stated, options), frf, options, DELAY_S)
    assert after.costs.total < 1.2 * after.costs.expected.sum() < 0.01 * before.costs.total
    for spring in stated.springs:
        if spring.place == "transmission":
            wanted = {**wanted, spring.name: spring.stiffness}
    for name, stiffness in wanted.items():
        assert after.estimate.found[f"{name}.stiffness"] == pytest.approx(stiffness, rel=0.02)


@pytest.mark.parametrize("name", [pytest.param("kr300", marks=pytest.mark.slow), "ur5e"])
def test_bearings_that_the_file_lacks_are_freed_together_and_found(name):
    robot = robot_of(name)
    stated = replace(robot, springs=tuple(spring for spring in robot.springs if spring.place != "bearing"))
    gears = {spring.joint: spring.stiffness for spring in robot.springs if spring.place == "transmission"}
    wanted = {f"bearing_{robot.joints[joint].name}_{axis}": 4 * gears[joint] for joint in (0, 1, 2) for axis in "xy"}
    bearings = (
        Spring(f"true_{number}", number // 2, "bearing", np.eye(3)[number % 2], stiffness, 1e-3 * stiffness)
        for number, stiffness in enumerate(wanted.values())
    )
    followed_together(stated, bearings, wanted)


def test_a_base_that_tilts_about_two_axes_is_freed_about_both_and_found():
    stated = robot_of("ur5e")
    gear = next(spring for spring in stated.springs if (spring.joint, spring.place) == (0, "transmission"))
    wanted = {"base_x": 6 * gear.stiffness, "base_y": 9 * gear.stiffness}
    tilts = (
        Spring(f"true_{name}", 0, "base", axis, stiffness, 1e-3 * stiffness)
        for (name, stiffness), axis in zip(wanted.items(), np.eye(3)[:2], strict=True)
    )
    followed_together(stated, tilts, wanted)


@pytest.mark.parametrize(("name", "joint"), [pytest.param("kr300", 1, marks=pytest.mark.slow), ("ur5e", 3)])
def test_a_torque_that_is_reversed_is_named_alone(name, joint):
    robot = robot_of(name)
    frf = exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=2e-3)
    told = turned(frf, np.ones(6), np.where(np.arange(6) == joint, -1.0, 1.0))
    before = fit_elastic(robot, told, OPTIONS, DELAY_S)
    (found,) = explain(fitted_model(robot, before, told, OPTIONS, DELAY_S))
    assert (found.cause, found.names) == ("torque_sign", (f"reversed torque of {robot.joints[joint].name}",))
    assert found.share > 0.99
