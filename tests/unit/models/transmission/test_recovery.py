"""Gears of a two-joint arm come back from motions that none of the package's laws has made."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from robid.errors import DataError
from robid.models.transmission.fit.fitting import fit_transmissions
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.models.transmission.fit.tracks import tracks_of
from robid.models.transmission.judge.plausible import assess, fit_findings, remedies
from robid.models.transmission.judge.validating import validate_transmissions
from robid.results.grade import DO_NOT_USE, TRUST
from two_encoders import Gear, motion, robot

RATED = {"turn": 300.0, "lift": 400.0}
OPTIONS = TransmissionFitOptions(rated_torque_nm=RATED)
GEAR = Gear(stiffening=1e3, slip=6.0, reach=3e-4)


@cache
def motions(gear=GEAR, count=3, **more):
    return tuple(motion(gear, seed, **more) for seed in range(1, count + 1))


@cache
def fitted(gear=GEAR):
    return fit_transmissions(robot(), motions(gear)[:2], OPTIONS)


def interval(solution, name):
    at = solution.estimate.names.index(name)
    return solution.estimate.lower[at], solution.estimate.value[at], solution.estimate.upper[at]


@pytest.mark.parametrize("joint", ["turn", "lift"])
def test_stiffness_lag_and_errors_are_found(joint):
    solution = fitted()
    low, value, high = interval(solution, f"gear_{joint}.stiffness")
    assert low < GEAR.stiffness < high
    assert value == pytest.approx(GEAR.stiffness, rel=0.03)
    gear = solution.joints.index(joint)
    assert solution.lag_s[gear] == pytest.approx(GEAR.lag_s, abs=2e-5)
    assert interval(solution, f"{joint}.motor_turn_1")[1] == pytest.approx(GEAR.error, rel=0.25)
    assert solution.residual[gear] < 0.02 * solution.size[gear]


def test_a_new_motion_is_predicted_and_the_fit_trusted():
    solution = fitted()
    grade = assess(solution, OPTIONS)
    found = validate_transmissions(robot(), solution, motions()[2:], OPTIONS, grade.findings)
    assert found.relative_error.max() < 0.1
    assert found.outcome.grade.value == TRUST, found.outcome.grade.sentence


def test_a_gear_that_is_another_one_on_the_new_motion_is_not_trusted():
    other = tuple(motion(replace(GEAR, stiffness=0.6e5), 3) for _ in range(1))
    found = validate_transmissions(robot(), fitted(), other, OPTIONS)
    assert found.outcome.grade.value < TRUST


def test_a_loose_encoder_is_not_trusted():
    gear = replace(GEAR, play=8e-4)
    solution = fit_transmissions(robot(), motions(gear)[:2], OPTIONS)
    found = validate_transmissions(robot(), solution, motions(gear)[2:], OPTIONS, fit_findings(solution, OPTIONS))
    assert found.outcome.grade.value < TRUST


def test_a_gear_that_nothing_loads_is_not_identified_and_the_motion_is_named():
    still = tuple(motion(GEAR, seed, size=(0.01, 1.0)) for seed in (1, 2))
    solution = fit_transmissions(robot(), still, OPTIONS)
    assert not solution.determined[solution.joints.index("turn")]
    assert any("turn" in each for each in remedies(solution))


def test_reversed_torques_are_named():
    wrong = tuple(replace(each, torque=-each.torque) for each in motions()[:2])
    grade = assess(fit_transmissions(robot(), wrong, OPTIONS), OPTIONS)
    assert grade.value == DO_NOT_USE
    assert grade.causes[0] == "torque_sign"


def test_torques_of_another_unit_are_named():
    wrong = tuple(replace(each, torque=1e3 * each.torque) for each in motions()[:2])
    grade = assess(fit_transmissions(robot(), wrong, OPTIONS), OPTIONS)
    assert grade.value == DO_NOT_USE
    assert grade.causes[0] == "units"


def test_a_gear_ratio_that_is_off_by_a_hundredth_is_blamed_first():
    arm = robot()
    joints = tuple(
        replace(joint, motor=replace(joint.motor, gear_ratio=1.01 * joint.motor.gear_ratio)) for joint in arm.joints
    )
    grade = assess(fit_transmissions(replace(arm, joints=joints), motions()[:2], OPTIONS), OPTIONS)
    assert grade.value == DO_NOT_USE
    assert grade.causes[0] == "gear_ratio"


@pytest.mark.parametrize(("factor", "code"), [(-1.0, "D678"), (180 / np.pi, "D678"), (0.0, "D677")])
def test_arms_that_move_another_way_than_their_motors_are_refused(factor, code):
    wrong = tuple(replace(each, arm=factor * each.arm) for each in motions()[:2])
    with pytest.raises(DataError, match=code):
        fit_transmissions(robot(), wrong, OPTIONS)


def test_what_is_too_short_or_too_slow_is_refused():
    short = replace(motions()[0], motor=motions()[0].motor[:100], arm=motions()[0].arm[:100])
    with pytest.raises(DataError, match="D676"):
        tracks_of([replace(short, torque=motions()[0].torque[:100])], robot(), OPTIONS)
    with pytest.raises(DataError, match="D675"):
        tracks_of(motions()[:1], robot(), replace(OPTIONS, cut_hz=100.0))


def test_hysteresis_over_a_twentieth_of_the_deflection_is_found():
    gear = Gear(slip=4.0, reach=1e-4, error=3.6e-5)
    solution = fit_transmissions(robot(), [motion(gear, 601)], TransmissionFitOptions())
    for joint in ("turn", "lift"):
        low, _, high = interval(solution, f"gear_{joint}.stiffness")
        assert low < gear.stiffness < high
        assert interval(solution, f"{joint}.slip")[1] == pytest.approx(gear.slip, rel=0.1)


def test_a_gear_that_bears_little_of_its_rated_torque_has_the_hysteresis_that_it_is_made_with():
    gear = Gear(slip=4.0, reach=4e-4, error=1e-5, eccentricity=1e-5, noise=3e-7)
    little = [motion(gear, seed, size=(0.1, 0.1)) for seed in (1, 2)]
    solution = fit_transmissions(robot(), little, OPTIONS)
    assert solution.reached[solution.joints.index("turn")] < 0.1 * RATED["turn"]
    assert interval(solution, "turn.slip")[1] == pytest.approx(gear.slip, rel=0.12)


def test_a_gear_whose_stiffness_rises_in_steps_has_that_of_its_data_sheet():
    gear = Gear(slip=5.0, reach=2e-4, steps=((40.0, 1.35), (120.0, 1.6)))
    every, torques = motions(gear), {"turn": (40.0, 120.0), "lift": (40.0, 120.0)}
    stepped = replace(OPTIONS, stiffness_torques_nm=torques)
    solution = fit_transmissions(robot(), every[:2], stepped)
    found = validate_transmissions(robot(), solution, every[2:], stepped, fit_findings(solution, stepped))
    assert found.outcome.grade.value == TRUST, found.outcome.grade.sentence
    for joint in ("turn", "lift"):
        for name, times in (
            (f"gear_{joint}.stiffness", 1),
            (f"{joint}.stiffness_2", 1.35),
            (f"{joint}.stiffness_3", 1.6),
        ):
            low, value, high = interval(solution, name)
            assert low < times * gear.stiffness < high
            assert value == pytest.approx(times * gear.stiffness, rel=0.02)
    cubic = fit_transmissions(robot(), every[:2], OPTIONS)
    assert np.all(cubic.residual > 5 * solution.residual)
