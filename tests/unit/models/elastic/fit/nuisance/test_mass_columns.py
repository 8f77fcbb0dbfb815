"""Columns of uncertain masses and torque constants against responses of robots that are built anew."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import arm_on_rail, exact_frf, springs_everywhere, two_joint_robot, with_spring_factors
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.nuisance.effects import PerturbedRobot
from robid.models.elastic.fit.nuisance.listing import list_nuisances
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Inertial

FREQUENCY_HZ = np.geomspace(2.0, 60.0, 12)
DELAY_S = 1e-3
PLACES = {"two_joints": [[0.3, -0.7], [-0.5, 0.9]], "springs": [[0.3, -0.7], [-0.5, 0.9]], "rail": [[0.5, 0.3, -0.7]]}
ROBOTS = {"two_joints": two_joint_robot, "springs": springs_everywhere, "rail": arm_on_rail}
FACTORS = 1.3, 0.7


def measured(robot, places):
    return exact_frf(robot, np.array(places), FREQUENCY_HZ, delay_s=DELAY_S, declared_noise=0.01)


def columns_of(robot, frf, options, nuisances=None):
    """Columns by name, where all springs are 1.3 times and all dampers 0.7 times as large as the file says."""
    problem, _ = set_up(robot, frf, options, DELAY_S)
    kinds = np.array(problem.parameters.kind_of)
    internal = np.log(FACTORS[0]) * (kinds == "stiffness") + np.log(FACTORS[1]) * (kinds == "damping")
    listed = list_nuisances(robot, ElasticOptions()) if nuisances is None else nuisances
    found = nuisance_columns(problem, internal, robot, options, listed)
    return {nuisance.name: found[..., index] for index, nuisance in enumerate(listed)}


def difference(change, places, step):
    """Derivative of the log response by Richardson's extrapolation of central differences."""

    def central(by):
        ahead, behind = (measured(with_spring_factors(change(each), *FACTORS), places).response for each in (by, -by))
        return np.log(ahead / behind) / (2 * by)

    return (4 * central(step / 2) - central(step)) / 3


def with_payload(robot, **values):
    return replace(robot, payload=replace(robot.payload, **values))


def with_link(robot, index, change):
    """The robot with another link, the part beyond its split too."""
    joints = tuple(replace(j, link=change(j.link)) if i == index else j for i, j in enumerate(robot.joints))
    springs = tuple(
        replace(s, outboard=change(s.outboard)) if s.outboard is not None and s.joint == index else s
        for s in robot.springs
    )
    return replace(robot, joints=joints, springs=springs)


def heavier(body, share):
    return Inertial(body.mass_kg * (1 + share), body.com_m, body.inertia_kgm2 * (1 + share))


def changes_of_base(robot):
    """The same of the base."""

    def based(**values):
        return replace(robot, base=replace(robot.base, **values))

    found = {"base.mass": lambda percent: replace(robot, base=heavier(robot.base, percent / 100))}
    found["base.inertia"] = lambda percent: based(inertia_kgm2=robot.base.inertia_kgm2 * (1 + percent / 100))
    for axis, letter in enumerate("xyz"):
        unit = 1e-3 * np.eye(3)[axis]
        found[f"base.com_{letter}"] = lambda mm, unit=unit: based(com_m=robot.base.com_m + mm * unit)
    return found


def changes(robot):
    """What each nuisance means, by name: a robot of an amount in the nuisance's unit."""
    load, found = robot.payload, {}
    found["payload.mass"] = lambda kg: replace(robot, payload=heavier(load, kg / load.mass_kg))
    found["payload.inertia"] = lambda share: with_payload(robot, inertia_kgm2=load.inertia_kgm2 * (1 + share / 100))
    for axis, letter in enumerate("xyz"):
        unit = np.eye(3)[axis]
        found[f"payload.com_{letter}"] = lambda mm, unit=unit: with_payload(robot, com_m=load.com_m + 1e-3 * mm * unit)
        for index, joint in enumerate(robot.joints):
            found[f"{joint.name}.com_{letter}"] = lambda mm, i=index, unit=unit: with_link(
                robot, i, lambda body: replace(body, com_m=body.com_m + 1e-3 * mm * unit)
            )
    if robot.base is not None:
        found |= changes_of_base(robot)
    for index, joint in enumerate(robot.joints):
        found[f"{joint.name}.mass"] = lambda percent, i=index: with_link(
            robot, i, lambda body: heavier(body, percent / 100)
        )
        found[f"{joint.name}.inertia"] = lambda percent, i=index: with_link(
            robot, i, lambda body: replace(body, inertia_kgm2=body.inertia_kgm2 * (1 + percent / 100))
        )
    return found


@pytest.mark.parametrize("name", ROBOTS)
def test_masses_move_the_response_as_robots_built_anew_do(name):
    robot = ROBOTS[name]()
    found = columns_of(robot, measured(robot, PLACES[name]), ElasticOptions())
    for nuisance, change in changes(robot).items():
        wanted = difference(change, PLACES[name], 0.02)
        scale = np.abs(wanted).max()
        np.testing.assert_allclose(found[nuisance], wanted, rtol=0, atol=1e-6 * scale + 1e-9, err_msg=nuisance)


@pytest.mark.parametrize("options", [
    ElasticOptions(estimator="nls"), ElasticOptions(estimator="llsm"), ElasticOptions(free=("stiffness", "location")),
    ElasticOptions(free=("stiffness", "damping", "link_inertia"), statics="every_iterate"),
])  # fmt: skip
def test_columns_have_the_sign_and_scale_of_the_problem_s_own(options):
    robot, places = two_joint_robot(), PLACES["two_joints"]
    frf = measured(robot, places)
    problem, _ = set_up(robot, frf, options, DELAY_S)
    here = np.zeros(len(problem.parameters.names))
    nuisances = [nuisance for nuisance in list_nuisances(robot, ElasticOptions()) if nuisance.name == "elbow.mass"]
    found = nuisance_columns(problem, here, robot, options, nuisances)[..., 0]
    ahead, behind = (
        set_up(with_link(robot, 1, lambda body, share=share: heavier(body, share)), frf, options, DELAY_S)[0]
        for share in (1e-4, -1e-4)
    )
    own = problem.parameters

    def residual(off):
        # What the fit estimates of the link stays as it is.
        ours, theirs = (np.where(own.logarithmic, each.nominal_values(), 1.0) for each in (own, off.parameters))
        there = np.log(ours / theirs)
        return off.residual(there, off.model_response(there))

    residuals = [residual(each) for each in (ahead, behind)]
    wanted = -(residuals[0] - residuals[1]) / 0.02
    np.testing.assert_allclose(found, wanted, rtol=1e-5, atol=1e-6 * np.abs(wanted).max())


def test_gears_that_stiffen_are_bent_further_by_what_is_heavier():
    robot, places = two_joint_robot(), PLACES["two_joints"]
    springs = [replace(s, cubic=2e3 * s.stiffness) if s.place == "transmission" else s for s in robot.springs]
    robot = replace(robot, springs=tuple(springs))
    torques = 0.02 * np.exp(1j * np.arange(2 * FREQUENCY_HZ.size * 4)).reshape(2, FREQUENCY_HZ.size, 2, 2)
    frf = replace(measured(robot, places), input_amplitude=torques)
    options = ElasticOptions(free=("stiffness", "damping", "cubic"))
    problem, _ = set_up(robot, frf, options, DELAY_S)
    here = np.zeros(len(problem.parameters.names))
    nuisances = [nuisance for nuisance in list_nuisances(robot, options) if nuisance.name == "payload.mass"]
    found = nuisance_columns(problem, here, robot, options, nuisances)[..., 0]
    ahead, behind = (
        set_up(changes(robot)["payload.mass"](kg), frf, options, DELAY_S)[0].model_response(here)
        for kg in (1e-3, -1e-3)
    )
    close = np.log(ahead / behind) / 2e-3
    np.testing.assert_allclose(found, close, rtol=0, atol=1e-4 * np.abs(close).max())
    linear = replace(robot, springs=tuple(replace(s, cubic=0.0) for s in robot.springs))
    plain = columns_of(linear, frf, ElasticOptions(free=("stiffness", "damping")))["payload.mass"]
    assert np.abs(found - plain).max() > 0.01 * np.abs(plain).max()


def test_torque_constants_scale_the_response_to_their_motor_s_torque():
    robot = two_joint_robot()
    found = columns_of(robot, measured(robot, PLACES["two_joints"]), ElasticOptions())
    exact = measured(robot, PLACES["two_joints"]).response
    stated = exact / np.array([1.0, 1.001])  # a torque that is measured too large by a thousandth
    np.testing.assert_allclose(0.1 * found["elbow.torque_constant"], np.log(stated / exact), atol=1e-6)
    assert np.abs(found["elbow.torque_constant"]).max() > 0.009


def test_priors_are_the_robot_file_s_and_zero_switches_a_nuisance_off():
    robot = two_joint_robot()
    nuisances = {nuisance.name: nuisance for nuisance in list_nuisances(robot, ElasticOptions())}
    assert nuisances["shoulder.mass"].common_std == pytest.approx(5.0)
    assert nuisances["payload.mass"].common_std == pytest.approx(0.02 * robot.payload.mass_kg)
    assert nuisances["payload.com_x"].common_std == pytest.approx(10.0)
    assert nuisances["elbow.torque_constant"].common_std == pytest.approx(2.0)
    elbow = replace(robot.joints[1], nuisance_std=replace(robot.nuisance_std, mass_relative_std=0.0, com_m=0.02))
    other = replace(
        robot,
        joints=(robot.joints[0], elbow),
        nuisance_std=replace(robot.nuisance_std, payload_com_m=0.0, payload_relative_std=0.1),
    )
    changed = {nuisance.name: nuisance for nuisance in list_nuisances(other, ElasticOptions())}
    gone = {"elbow.mass", "payload.com_x", "payload.com_y", "payload.com_z"}
    assert set(nuisances) - set(changed) == gone
    assert changed["elbow.com_y"].common_std == pytest.approx(20.0)
    assert changed["payload.mass"].common_std == pytest.approx(0.1 * robot.payload.mass_kg)
    bare = replace(robot, payload=Inertial(0.0, np.zeros(3), np.zeros((3, 3))))
    assert not [
        nuisance.name for nuisance in list_nuisances(bare, ElasticOptions()) if nuisance.name.startswith("payload")
    ]


def test_a_rigid_fit_s_directions_take_the_place_of_links():
    robot, places = two_joint_robot(), PLACES["two_joints"]
    off = with_link(robot, 0, lambda body: heavier(body, 1e-4))
    nuisances = list_nuisances(robot, ElasticOptions(), [PerturbedRobot(off, 0.01)])
    assert [nuisance.name for nuisance in nuisances if nuisance.cause == "masses"] == ["rigid.1"]
    frf = measured(robot, places)
    file = columns_of(robot, frf, ElasticOptions())
    found = columns_of(robot, frf, ElasticOptions(), nuisances)
    wanted = file["shoulder.mass"]  # a deviation is a percent
    np.testing.assert_allclose(found["rigid.1"], wanted, atol=2e-3 * np.abs(wanted).max())
