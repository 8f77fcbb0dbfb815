"""What a robot file has wrong is named first: exact responses of robots that differ from their file in one thing."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.moves import with_estimated_springs
from robid.models.elastic.fit.nuisance.wording import free_with
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.causes import _finding, explain
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.ratios import Explanation
from robid.robot.description import Inertial, Spring
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.parameters import FREE
from robid.robot.response import nominal_parameters, response

FREQUENCY_HZ = np.geomspace(1, 60, 40)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
DELAY_S = 1e-3
OPTIONS = ElasticOptions()


def heavier(body, factor):
    return Inertial(body.mass_kg * factor, body.com_m, body.inertia_kgm2 * factor)


def with_payload(robot, factor):
    return replace(robot, payload=heavier(robot.payload, factor))


def with_link(robot, factor):
    elbow = replace(robot.joints[1], link=heavier(robot.joints[1].link, factor))
    springs = tuple(
        replace(spring, outboard=heavier(spring.outboard, factor)) if spring.outboard else spring
        for spring in robot.springs
    )
    return replace(robot, joints=(robot.joints[0], elbow), springs=springs)


def without(robot, name):
    return replace(robot, springs=tuple(spring for spring in robot.springs if spring.name != name))


@pytest.fixture(scope="module")
def true_arm():
    return with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])


def measured(robot, seed=5):
    return exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=seed)


def explained(stated, frf, options=OPTIONS):
    solution = fit_elastic(stated, frf, options, DELAY_S)
    return solution, explain(fitted_model(stated, solution, frf, options, DELAY_S))


@pytest.mark.parametrize("estimator", ["lls", "llsm"])
def test_a_payload_that_is_off_is_weighed(true_arm, estimator):
    options = replace(OPTIONS, estimator=estimator)
    _, found = explained(two_joint_robot(), measured(with_payload(true_arm, 1.1)), options)
    assert (found[0].cause, found[0].names[0]) == ("payload", "payload mass")
    np.testing.assert_allclose(found[0].amounts[0], 0.4, rtol=0.15)  # of 4 kg, to first order
    assert found[0].share > 0.8


def test_a_link_that_is_heavier_is_named(true_arm):
    _, found = explained(two_joint_robot(), measured(with_link(true_arm, 1.1)))
    assert found[0].cause == "masses"
    assert found[0].share > 0.8


def test_a_torque_constant_that_is_off_is_measured(true_arm):
    frf = measured(true_arm)
    column = np.where(np.arange(2) == 1, 1 / 1.08, 1.0)  # the elbow's torque was read 8 % too large
    solution, found = explained(two_joint_robot(), replace(frf, response=frf.response * column))
    assert (found[0].cause, found[0].names[0]) == ("torque_constant", "torque constant of elbow")
    # What is told is to be added to the constant, which is too large.
    np.testing.assert_allclose(found[0].amounts[0], 100 * (1 / 1.08 - 1), rtol=0.1)
    assert solution.model_error.share_above > 0.3


def test_a_spring_that_the_file_lacks_is_found(true_arm):
    _, found = explained(without(two_joint_robot(), "bearing_1"), measured(true_arm))
    assert found[0].cause == "missing_spring"
    assert found[0].share > 0.99


def tilting(robot):
    """The robot on a base that tilts about two axes, as its file does not say."""
    tilts = (Spring(f"tilt_{axis}", 0, "base", np.eye(3)["xyz".index(axis)], k, 1e-3 * k) for axis, k in TILTS.items())
    return replace(robot, springs=(*robot.springs, *tilts))


def with_bearings(robot):
    """The robot with bearings at both joints, as its file does not say."""
    told = (("shoulder", 0, "x"), ("shoulder", 0, "y"), ("elbow", 1, "x"), ("elbow", 1, "y"))
    bearings = (
        Spring(f"true_{name}_{axis}", joint, "bearing", np.eye(3)["xyz".index(axis)], k, 1e-3 * k)
        for (name, joint, axis), k in zip(told, BEARINGS, strict=True)
    )
    return replace(robot, springs=(*robot.springs, *bearings))


TILTS = {"x": 9e4, "y": 6e4}
BEARINGS = (8e4, 5e4, 3e4, 2.5e4)


@pytest.mark.parametrize(
    ("truth", "wanted"),
    [
        (tilting, {f"base_{axis}": k for axis, k in TILTS.items()}),
        (
            with_bearings,
            dict(
                zip(
                    ("bearing_shoulder_x", "bearing_shoulder_y", "bearing_elbow_x", "bearing_elbow_y"),
                    BEARINGS,
                    strict=True,
                )
            ),
        ),
    ],
)
def test_springs_that_the_physical_model_puts_in_place_are_freed_together_and_end_at_the_truth(truth, wanted):
    stated = without(two_joint_robot(), "bearing_1")
    frf = measured(truth(stated))
    before, found = explained(stated, frf)
    assert found[0].cause == "missing_spring"
    assert set(found[0].free) == set(wanted)
    options = replace(OPTIONS, free=free_with(OPTIONS.free, found[0].free))
    after = fit_elastic(with_estimated_springs(stated, options), frf, options, DELAY_S)
    assert after.costs.total < 1.3 * after.costs.expected.sum() < 0.1 * before.costs.total
    for name, stiffness in wanted.items():
        assert after.estimate.found[f"{name}.stiffness"] == pytest.approx(stiffness, rel=0.1)


def test_a_forearm_that_bends_is_a_hinge_before_masses_are_blamed(true_arm):
    """On two joints a centre of mass and an inertia that are off by two deviations do much of what it does."""
    _, found = explained(without(two_joint_robot(), "forearm"), measured(true_arm))
    assert (found[0].cause, found[1].cause) == ("missing_spring", "masses")
    assert found[0].free[0].startswith("hinge_elbow_")


def with_twist(robot, stiffness):
    """The robot with a first link that twists along the second joint's axis, in series with that joint's gear."""
    link, elbow = robot.joints[0].link, robot.joints[1]
    twist = Spring(
        *("twist", 0, "split", elbow.rotation[:, 2], stiffness, 1e-3 * stiffness),
        point_m=elbow.position_m,
        outboard=heavier(link, 0.6),
    )
    return replace(robot, springs=(*robot.springs, twist))


def test_a_spring_in_series_with_a_gear_is_found_and_no_gear_is_called_identified():
    frf = measured(with_twist(two_joint_robot(), 2e4))
    solution, found = explained(two_joint_robot(), frf)
    gear = solution.estimate.names.index("gear_2.stiffness")
    assert solution.estimate.value[gear] > 1.2 * 6e3  # the fit makes a compromise of it
    assert (found[0].cause, found[0].names[0]) == ("missing_spring", "link of shoulder about its z axis")
    np.testing.assert_allclose(found[0].amounts[0], 0.02, rtol=0.02)
    np.testing.assert_allclose(solution.estimate.value[gear] * np.exp(found[0].moved[gear]), 6e3, rtol=0.02)
    assert found[0].share > 0.9
    grade = assess_fit(two_joint_robot(), solution, frf, OPTIONS, DELAY_S)
    assert (grade.value, grade.causes[0]) == (0, "missing_spring")
    # What places differ by makes the gear's interval hold it: nobody relies on it.
    assert solution.estimate.lower[gear] < 6e3 < solution.estimate.upper[gear]
    assert not solution.estimate.identified[gear]


def test_a_series_spring_far_softer_than_the_fitted_gear_is_tried_from_where_both_share_its_compliance():
    _, found = explained(two_joint_robot(), measured(with_twist(two_joint_robot(), 2e3)))
    assert (found[0].cause, found[0].names[0]) == ("missing_spring", "link of shoulder about its z axis")


def test_a_hinge_in_line_with_a_gear_is_found_by_what_lies_between_and_gone_where_it_is_freed():
    robot, upright = two_joint_robot(), np.array([0.0, 0.0, 1.0])
    hinge = Spring("hinge", 0, "split", upright, 2e4, 20.0, outboard=heavier(robot.joints[0].link, 0.5))
    true = replace(robot, springs=(*robot.springs, hinge))
    frf = measured(true)
    before, found = explained(robot, frf)
    assert (found[0].cause, found[0].free) == ("missing_spring", ("hinge_shoulder_50",))
    assert found[0].share > 2 * found[1].share
    options = replace(OPTIONS, free=free_with(OPTIONS.free, found[0].free))
    solution = fit_elastic(with_estimated_springs(robot, options), frf, options, DELAY_S)
    assert solution.costs.total < 1.2 * solution.costs.expected.sum() < 0.01 * before.costs.total
    both = [solution.estimate.found[f"{name}.stiffness"] for name in ("gear_1", "hinge_shoulder_50")]
    np.testing.assert_allclose(both, 2e4, rtol=0.03)


def test_a_base_that_tilts_about_a_point_metres_below_is_found_and_gone_where_it_is_freed():
    robot, y = two_joint_robot(), np.array([0.0, 1.0, 0.0])
    foot = Spring("foot", 0, "base", y, 6e5, 300.0, point_m=np.array([0.0, 0.0, -2.0]))
    frf = measured(replace(robot, springs=(*robot.springs, foot)))
    before, found = explained(robot, frf)
    assert (found[0].cause, found[0].free) == ("missing_spring", ("base_y_2m",))
    options = replace(OPTIONS, free=free_with(OPTIONS.free, found[0].free))
    solution = fit_elastic(with_estimated_springs(robot, options), frf, options, DELAY_S)
    assert solution.costs.total < 1.2 * solution.costs.expected.sum() < 0.01 * before.costs.total
    assert solution.estimate.found["base_y_2m.stiffness"] == pytest.approx(6e5, rel=0.02)


def test_gears_that_stiffen_are_named_and_gone_where_cubic_is_freed():
    robot = two_joint_robot()
    stiffening = [replace(s, cubic=1e8 if s.name == "gear_1" else 5e7) for s in robot.springs[:2]]
    true = replace(robot, springs=(*stiffening, *robot.springs[2:]))
    places = np.vstack([PLACES, [[1.5, 0.2], [-1.5, -1.0]]])
    frf, exact = exact_frf(robot, places, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.001, seed=5), []
    for place in places:  # springs as stiff as where they rest
        linear = linearize(build_model(true), solve_statics(build_model(true), place[None]))
        values = nominal_parameters(true, linear, DELAY_S)
        slopes = values.stiffness + 3 * values.cubic * linear.rest.deflection[0] ** 2
        bent = replace(values, stiffness=slopes, cubic=np.zeros(4))
        exact.append(response(linear, bent, FREQUENCY_HZ, frf.hold_period_s).sampled[0])
    torques = np.broadcast_to(1e-4 * np.eye(2, dtype=complex), (len(places), FREQUENCY_HZ.size, 2, 2))
    frf = replace(frf, response=np.array(exact), input_amplitude=torques)
    before, found = explained(robot, frf)
    assert (found[0].cause, found[0].free) == ("gear_nonlinearity", ("cubic",))
    options = replace(OPTIONS, free=free_with(OPTIONS.free, found[0].free))
    after = fit_elastic(robot, frf, options, DELAY_S)
    assert after.costs.total < 0.02 * before.costs.total
    assert after.estimate.found["gear_1.cubic"] == pytest.approx(1e8, rel=0.05)


def test_a_gear_that_is_stiffer_one_way_is_named_and_gone_where_it_is_freed():
    robot, places = two_joint_robot(), np.vstack([PLACES, [[1.9, 0.2], [-1.9, -1.0]]])
    frf, exact = exact_frf(robot, places, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.001, seed=5), []
    for place in places:
        linear = linearize(build_model(robot), solve_statics(build_model(robot), place[None]))
        values = nominal_parameters(robot, linear, DELAY_S)
        ways = np.sign(linear.rest.deflection[0]) * (np.arange(4) == 1)
        sided = replace(values, stiffness=values.stiffness * (1 + 0.1 * ways))
        exact.append(response(linear, sided, FREQUENCY_HZ, frf.hold_period_s).sampled[0])
    frf = replace(frf, response=np.array(exact))
    before, found = explained(robot, frf)
    assert (found[0].cause, found[0].free) == ("gear_nonlinearity", ("gear_2.one_sided",))
    options = replace(OPTIONS, free=free_with(OPTIONS.free, found[0].free))
    after = fit_elastic(robot, frf, options, DELAY_S)
    assert after.costs.total < 1e-4 * before.costs.total
    assert after.estimate.found["gear_2.one_sided"] == pytest.approx(10.0, rel=1e-3)
    assert after.estimate.found["gear_2.stiffness"] == pytest.approx(6e3, rel=1e-3)


def test_explanations_that_move_springs_little_or_explain_little_or_are_linear_forbid_nothing():
    robot = two_joint_robot()
    estimate = fit_elastic(robot, measured(robot), OPTIONS, DELAY_S).estimate
    gear = np.array(estimate.names) == "gear_2.stiffness"

    def decisive(cause="missing_spring", share=0.8, moved=0.3, leads=True):
        found = Explanation(cause, ("spring",), np.ones(1), ("MN m/rad",), share, moved * gear)
        return _finding(estimate, found, [found] if leads else [], OPTIONS).decisive

    assert decisive()
    assert decisive(moved=-0.2)  # 22 % off
    assert not decisive(moved=0.2)  # 18 % off
    assert not decisive(share=0.4)
    assert not decisive(cause="masses")
    assert not decisive(leads=False)
    unknown = replace(estimate, lower=0.5 * estimate.value, upper=1.5 * estimate.value)
    found = Explanation("missing_spring", ("spring",), np.ones(1), ("MN m/rad",), 0.8, 0.3 * gear)
    assert not _finding(unknown, found, [found], OPTIONS).decisive


def test_a_right_model_has_nothing_to_explain(true_arm):
    frf = measured(true_arm)
    solution, found = explained(two_joint_robot(), frf)
    assert max((one.share for one in found), default=0.0) < 0.1
    grade = assess_fit(two_joint_robot(), solution, frf, OPTIONS, DELAY_S)
    assert (grade.value, grade.causes) == (1, ())


def test_the_fit_alone_names_the_cause_and_how_far_it_moves_a_parameter(true_arm):
    frf = measured(with_payload(true_arm, 1.1))
    solution = fit_elastic(two_joint_robot(), frf, OPTIONS, DELAY_S)
    grade = assess_fit(two_joint_robot(), solution, frf, OPTIONS, DELAY_S)
    assert grade.causes[0] == "payload"
    assert "half-widths of its interval" in grade.messages[0]
    assert grade.messages[0] in grade.sentence


@pytest.mark.parametrize(("kind", "factor"), [("stiffness", 1.5), ("damping", 3.0)])
def test_a_spring_that_is_fixed_and_off_is_to_be_fixed_no_more(kind, factor):
    stated = two_joint_robot()
    forearm = stated.springs[3]
    off = replace(forearm, **{kind: factor * getattr(forearm, kind)})
    frf = measured(replace(stated, springs=(*stated.springs[:3], off)))
    options = replace(OPTIONS, fixed=(f"forearm.{kind}",))
    solution = fit_elastic(stated, frf, options, DELAY_S)
    grade = assess_fit(stated, solution, frf, options, DELAY_S)
    assert grade.causes[0] == "held_spring"
    assert f"(take `forearm.{kind}` out of `fixed`" in grade.messages[0]
    estimated = fit_elastic(stated, frf, OPTIONS, DELAY_S).costs
    assert estimated.total < 1.1 * estimated.expected.sum() < 0.6 * solution.costs.total


@pytest.mark.parametrize("held", ["stiffness", pytest.param("damping", marks=pytest.mark.slow)])
def test_a_missing_spring_is_found_by_its_name_whatever_else_is_free(held):
    free = tuple(kind for kind in FREE if kind != held)
    stated, options = without(two_joint_robot(), "bearing_1"), replace(OPTIONS, free=free)
    # What is not free is right: the spring that lacks is all that is wrong.
    factors = {"stiffness": [1.3, 0.8, 1.2, 0.9], "damping": [0.7, 1.4, 1.2, 0.8], held: np.ones(4)}
    true = with_spring_factors(two_joint_robot(), factors["stiffness"], factors["damping"])
    frf = measured(true)
    before, found = explained(stated, frf, options)
    assert found[0].free == ("bearing_shoulder_x",)
    estimated = replace(options, free=free_with(free, found[0].free))
    solution = fit_elastic(with_estimated_springs(stated, estimated), frf, estimated, DELAY_S)
    assert solution.costs.total < 1.2 * solution.costs.expected.sum() < 0.05 * before.costs.total
    names = {name for name in solution.estimate.names if name.endswith(f".{held}")}
    assert names == {f"bearing_shoulder_x.{held}"}
    spring = next(each for each in true.springs if each.name == "bearing_1")
    assert solution.estimate.found[f"bearing_shoulder_x.{held}"] == pytest.approx(getattr(spring, held), rel=0.05)


@pytest.mark.parametrize("longer_s", [2e-4, -3e-4])
def test_a_delay_that_is_off_and_not_estimated_is_named(true_arm, longer_s):
    options = replace(OPTIONS, free=tuple(kind for kind in FREE if kind != "delay"))
    frf = exact_frf(true_arm, PLACES, FREQUENCY_HZ, delay_s=DELAY_S + longer_s, relative_noise=0.003, seed=5)
    solution, found = explained(two_joint_robot(), frf, options)
    assert found[0].cause == "delay"
    assert found[0].free == ("delay",)
    assert float(found[0].amounts[0]) == pytest.approx(1e6 * longer_s, rel=0.2)
    grade = assess_fit(two_joint_robot(), solution, frf, options, DELAY_S)
    assert grade.causes[0] == "delay"
    assert "delay of the drives" in grade.messages[0]
    assert "(try `free: [stiffness, damping, viscous, motor_inertia, delay]`" in grade.messages[0]


def test_dampers_that_are_off_and_not_estimated_are_no_missing_spring():
    stated, options = two_joint_robot(), replace(OPTIONS, free=("stiffness", "viscous", "delay", "motor_inertia"))
    factors = [2.5, 0.4, 3.0, 0.4]
    off = [replace(s, damping=f * s.damping) for s, f in zip(stated.springs, factors, strict=True)]
    frf = measured(replace(stated, springs=tuple(off)))
    grade = assess_fit(stated, fit_elastic(stated, frf, options, DELAY_S), frf, options, DELAY_S)
    # Trials that estimated all dampers beside a further spring called that one first.
    assert grade.causes[0] == "held_spring"
    assert "(try `free: [stiffness, viscous, delay, motor_inertia, damping]`" in grade.messages[0]


def test_a_rotor_that_is_fixed_and_off_is_to_be_fixed_no_more():
    true, stated = two_joint_robot(), two_joint_robot()
    shoulder, elbow = true.joints
    motor = replace(shoulder.motor, inertia_kgm2=1.15 * shoulder.motor.inertia_kgm2)
    frf = measured(replace(true, joints=(replace(shoulder, motor=motor), elbow)))
    options = replace(OPTIONS, fixed=("shoulder.motor_inertia",))
    solution = fit_elastic(stated, frf, options, DELAY_S)
    grade = assess_fit(stated, solution, frf, options, DELAY_S)
    assert grade.causes[0] == "rotor_inertia"
    assert "(take `shoulder.motor_inertia` out of `fixed`;" in grade.messages[0]
    assert fit_elastic(stated, frf, OPTIONS, DELAY_S).costs.total < 0.2 * solution.costs.total
