"""A fit is held to its own data: errors of a known size decide at their limits, with and without a validation."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.assessment import assess_fit, validation_findings
from robid.models.elastic.judge.grading import grade_validation
from robid.models.elastic.judge.plausible_parameters import fitted_carrier
from robid.results.finding import Finding
from robid.robot.balances import balance_torque
from robid.robot.description import HarmonicBalance
from robid.robot.friction import Friction
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
DELAY_S = 1e-3
OPTIONS = ElasticOptions()


@pytest.fixture(scope="module")
def stated():
    return two_joint_robot()


@pytest.fixture(scope="module")
def frf(stated):
    true = with_spring_factors(stated, [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])
    return exact_frf(true, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5)


@pytest.fixture(scope="module")
def sound(stated, frf):
    return fit_elastic(stated, frf, OPTIONS, DELAY_S)


def assessed(stated, sound, frf, factor):
    """The grade of a sound fit beside data that are off by a known factor, and after a validation that holds."""
    alone = assess_fit(stated, sound, replace(frf, response=frf.response * factor), OPTIONS, DELAY_S)
    return alone, grade_validation(sound, alone.findings, ())


def test_a_sound_fit_predicts_alone_and_is_trusted_with_a_validation(stated, sound, frf):
    alone, validated = assessed(stated, sound, frf, 1.0)
    assert (alone.value, alone.findings, validated.value) == (1, (), 2)


@pytest.mark.parametrize(
    ("factor", "told"),
    [
        (10 ** (3 / 20), "in the fit's own data, a motor's own response is off by 3 dB in the median, limit 1"),
        (np.exp(1j * np.deg2rad(20)), "in the fit's own data, a motor's own response is off by 20 degrees"),
    ],
)
def test_own_responses_beyond_the_limits_are_not_to_be_used(stated, sound, frf, factor, told):
    alone, validated = assessed(stated, sound, frf, factor)
    assert alone.value == validated.value == 0
    assert told in alone.sentence
    assert told in validated.sentence


def test_own_errors_within_the_limits_but_beyond_noise_decide_without_a_validation_alone(stated, sound, frf):
    alone, validated = assessed(stated, sound, frf, 10 ** (0.8 / 20))
    assert alone.value == 0
    assert "of the fit's own data costs" in alone.sentence
    assert validated.value > 0


def test_the_limit_of_the_cost_is_that_of_the_assumed_error(stated, sound, frf):
    for factor, value in ((1.02, 1), (1.03, 0)):  # of 2 % assumed, times the root of 1.5: 2.4 %
        assert assessed(stated, sound, frf, factor)[0].value == value


def test_own_resonances_have_their_limit(stated, sound):
    higher = exact_frf(
        with_spring_factors(stated, 1.1**2 * np.array([1.3, 0.8, 1.2, 0.9]), 1.1 * np.array([0.7, 1.4, 1.2, 0.8])),
        PLACES,
        FREQUENCY_HZ,
        delay_s=DELAY_S,
        relative_noise=0.003,
        seed=5,
    )
    alone = assess_fit(stated, sound, higher, OPTIONS, DELAY_S)
    assert "resonances are off by 9.1 %" in alone.sentence  # 1 - 1/1.1


def test_data_of_the_validation_are_named_and_blamed_before_what_does_not_decide(stated, sound, frf):
    payload = Finding("payload", "the payload +2 kg", decisive=False, strength=4.0)
    turned = replace(frf, response=frf.response * np.array([1.0, -1.0]))
    findings = validation_findings((payload,), stated, sound.estimate, turned, "monday")
    assert [finding.cause for finding in findings] == ["torque_sign", "payload"]
    assert findings[0].message.startswith("in campaign monday, ")
    assert validation_findings((payload,), stated, sound.estimate, frf, "monday") == (payload,)
    decided = Finding("angle_sign", "shoulder: its angle has the wrong sign", decisive=True, strength=2.0)
    assert [
        finding.cause for finding in validation_findings((decided, payload), stated, sound.estimate, turned, "monday")
    ] == [
        "angle_sign",
        "torque_sign",
        "payload",
    ]


def test_a_delay_that_is_declared_is_no_doubt_about_a_validation(stated, sound, frf):
    late_s = 0.04
    late = replace(frf, response=frf.response * np.exp(-2j * np.pi * FREQUENCY_HZ * late_s)[:, None, None])
    assert [finding.cause for finding in validation_findings((), stated, sound.estimate, late, "monday", DELAY_S)] == [
        "delay"
    ]
    assert validation_findings((), stated, sound.estimate, late, "monday", DELAY_S + late_s) == ()


def balanced_arm(robot):
    """Responses and mean torques of an arm with a counterbalance that its file lacks."""
    shoulder, elbow = robot.joints
    shoulder = replace(shoulder, counterbalance=HarmonicBalance(np.array([60.0]), np.array([-150.0])))
    true = replace(robot, joints=(shoulder, elbow))
    found = exact_frf(true, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5)
    torque = solve_statics(build_model(true, balanced=True), PLACES).motor_torque
    angle = PLACES @ robot.motor_per_arm.T
    return replace(found, mean_input=torque, mean_output=angle, motion_rms=np.full_like(angle, 0.3))


def test_freeing_the_counterbalance_that_mean_torques_name_ends_their_finding(stated):
    law = Friction(0.0, 0.03, 0.03, 1.0, 0.02)
    joints = tuple(replace(joint, motor=replace(joint.motor, friction=law)) for joint in stated.joints)
    robot = replace(stated, joints=joints)
    frf = balanced_arm(robot)
    plain = fit_elastic(robot, frf, OPTIONS, DELAY_S)
    seen = [
        finding
        for finding in assess_fit(robot, plain, frf, OPTIONS, DELAY_S).findings
        if "mean torques" in finding.message
    ]
    assert [finding.cause for finding in seen] == ["counterbalance"]
    free = seen[0].message.partition("free: [")[2].partition("]")[0]
    options = replace(OPTIONS, free=(free,))
    estimated = fit_elastic(robot, frf, options, DELAY_S)
    grade = assess_fit(robot, estimated, frf, options, DELAY_S)
    assert (grade.value, grade.findings) == (1, ())
    fitted = fitted_carrier(robot, estimated.estimate)
    assert balance_torque(fitted.found.robot.joints[0].counterbalance, 0.7, slides=False) == pytest.approx(
        60 * np.sin(0.7) - 150 * np.cos(0.7), abs=9
    )
    assert fitted_carrier(robot, plain.estimate) is None
    assert validation_findings((), robot, estimated.estimate, frf, "monday", DELAY_S) == ()
    assert validation_findings((), robot, plain.estimate, frf, "monday", DELAY_S) != ()


def rubbing(robot):
    law = Friction(0.0, 0.03, 0.03, 1.0, 0.02)
    joints = tuple(replace(joint, motor=replace(joint.motor, friction=law)) for joint in robot.joints)
    return replace(robot, joints=joints)


def recorded(true, scale=1.0):
    """Responses and mean torques of an arm, the torques recorded too large by a factor."""
    found = exact_frf(true, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5)
    torque = solve_statics(build_model(true, balanced=True), PLACES).motor_torque
    angle = PLACES @ true.motor_per_arm.T
    return replace(
        found,
        response=found.response / scale,
        mean_input=torque * scale,
        mean_output=angle,
        motion_rms=np.full_like(angle, 0.3),
    )


WRONG = {
    "payload": (lambda robot: replace(robot, payload=replace(robot.payload, mass_kg=robot.payload.mass_kg + 2)), 1.0),
    "torque_constant": (lambda robot: robot, np.array([1.2, 1.0])),
}


@pytest.mark.parametrize("cause", WRONG)
def test_what_a_fit_estimated_is_what_mean_torques_are_held_against(stated, cause):
    change, scale = WRONG[cause]
    robot = rubbing(stated)
    frf = recorded(change(robot), scale)
    options = replace(OPTIONS, free=(cause,))
    estimated = fit_elastic(robot, frf, options, DELAY_S)
    plain = fit_elastic(robot, frf, OPTIONS, DELAY_S)
    told = [validation_findings((), robot, each.estimate, frf, "monday", DELAY_S) for each in (plain, estimated)]
    assert [finding.cause for finding in told[0]] == [cause]
    assert told[1] == ()
    # A estimated payload vouches for itself alone: what the fit cannot have found is still seen.
    heavier = recorded(WRONG["payload"][0](WRONG["payload"][0](change(robot))), scale)
    assert [
        finding.cause for finding in validation_findings((), robot, estimated.estimate, heavier, "monday", DELAY_S)
    ] == ["payload"]


def test_how_far_what_a_fit_estimated_may_be_off_is_as_far_as_its_intervals_reach(stated):
    robot = rubbing(stated)
    options = replace(OPTIONS, free=("payload", "torque_constant"))
    estimate = fit_elastic(robot, recorded(robot), options, DELAY_S).estimate
    fitted = fitted_carrier(robot, estimate)
    ends = {}
    for name in ("shoulder.torque_constant", "elbow.torque_constant"):
        row = estimate.names.index(name)
        ends[name] = max(abs(estimate.upper[row] - estimate.value[row]), abs(estimate.lower[row] - estimate.value[row]))
    logs = np.array([np.log(off.torque_factor / fitted.found.torque_factor) for off in fitted.off]) / fitted.share
    np.testing.assert_allclose(100 * np.sqrt((logs**2).sum(axis=0)), np.array([*ends.values()]) / 1.959964, rtol=1e-6)
    kilograms = [off.robot.payload.mass_kg - fitted.found.robot.payload.mass_kg for off in fitted.off]
    row = next(row for row, name in enumerate(estimate.names) if name.startswith("payload") and "mass" in name)
    assert np.linalg.norm(kilograms) / fitted.share == pytest.approx(
        max(estimate.upper[row] - estimate.value[row], estimate.value[row] - estimate.lower[row]) / 1.959964, rel=1e-6
    )
