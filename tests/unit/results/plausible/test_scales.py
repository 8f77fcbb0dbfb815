"""Wrong units, sides and times are named first, with the factor; sound data whose robot file is rough accuse nobody."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot
from robid.errors import DataError
from robid.results.finding import CAUSES, blamed
from robid.results.plausible.findings import data_findings
from robid.results.scale import SCALES, Scale, read_scale
from robid.robot.linearize import solve_statics
from robid.robot.model import build_model
from robid.signals.quantities import Channel, motor_channels

FREQUENCY_HZ = np.geomspace(1.0, 60.0, 30)
CONFIGURATIONS = np.array([[0.3, -0.7], [-0.5, 0.9], [1.1, 0.2], [-1.2, -1.5]])
NAMES = ("shoulder", "elbow")


def robot():
    return two_joint_robot()


def exact(configurations=CONFIGURATIONS):
    """The response of the robot with means of a log whose angles and torques are right."""
    frf = exact_frf(robot(), configurations, FREQUENCY_HZ)
    held = solve_statics(build_model(robot()), configurations).motor_torque
    angle = configurations @ robot().motor_per_arm.T
    return replace(
        frf,
        mean_input=held,
        mean_output=angle,
        motion_rms=np.full_like(angle, 0.3),
        measured_channels=motor_channels(frf.output_names, "angle"),
    )


def misread(frf, torque=1.0, angle=1.0, time=1.0, derivatives=2):
    """The response as it comes out where values of each motor, or times, are so many times too large."""
    torque, angle = np.ones(2) * torque, np.ones(2) * angle
    return replace(
        frf,
        response=frf.response * angle[:, None] / torque / time**derivatives,
        mean_input=frf.mean_input * torque,
        mean_output=frf.mean_output * angle,
        motion_rms=frf.motion_rms * np.abs(angle),
        frequency_hz=frf.frequency_hz / time,
        sampling_period_s=frf.sampling_period_s * time,
    )


def first(frf, of=None):
    findings = data_findings(of or robot(), frf)
    return findings[0] if findings else None


@pytest.mark.parametrize(
    ("change", "scale"),
    [
        ({"torque": 1e3}, Scale("torque", "1000")),
        ({"torque": 1e-3}, Scale("torque", "1000", inverse=True)),
        ({"torque": 1 / SCALES["9.81"]}, Scale("torque", "9.81", inverse=True)),
        ({"torque": [1e3, 1]}, Scale("torque", "1000", joints=("shoulder",))),
        ({"torque": [1, 100]}, Scale("torque", "gear_ratio", joints=("elbow",))),
        ({"angle": SCALES["180/pi"]}, Scale("motor_angle", "180/pi")),
        ({"angle": 1 / SCALES["180/pi"]}, Scale("motor_angle", "180/pi", inverse=True)),
        ({"angle": 1 / SCALES["2pi"]}, Scale("motor_angle", "2pi", inverse=True)),
        ({"angle": 8192 / SCALES["2pi"]}, Scale("motor_angle", "counts")),
        ({"angle": 4.0}, Scale("motor_angle", "counts")),
        ({"angle": [1, SCALES["180/pi"]]}, Scale("motor_angle", "180/pi", joints=("elbow",))),
        ({"angle": [1 / 120, 1 / 100]}, Scale("motor_angle", "gear_ratio", inverse=True)),
        ({"time": 1e3}, Scale("time", "1000")),
        ({"time": 1e-3}, Scale("time", "1000", inverse=True)),
    ],
)
def test_a_wrong_scale_is_named_before_anything_else(change, scale):
    found = first(misread(exact(), **change))
    assert (found.cause, found.decisive, found.scales[0]) == ("units", True, scale)


def test_the_factor_stands_in_the_message_with_its_interval_and_what_to_write():
    told = first(misread(exact(), angle=SCALES["180/pi"])).message
    factor, low, high = (
        float(told.split(mark)[1].split(end)[0]) for mark, end in ((" are ", " "), ("[", ","), (", ", "]"))
    )
    assert low < SCALES["180/pi"] < high
    assert factor == pytest.approx(SCALES["180/pi"], rel=1e-3)
    assert high / low < 1.1
    assert "`unit: deg`" in told


def test_torques_and_angles_of_the_joints_read_as_the_motors_are_named_together():
    ratio = robot().gear_ratio
    found = first(misread(exact(), torque=ratio, angle=1 / ratio))
    assert found.scales == (Scale("torque", "gear_ratio"), Scale("motor_angle", "gear_ratio", inverse=True))
    assert "`<joint>.arm`" in found.message


def test_what_gives_the_same_data_is_named_beside_it():
    # Where no angle is known against the configurations, angles that are too small look like torques too large.
    frf = replace(exact(), mean_output=None, mean_input=None, motion_rms=None)
    found = first(misread_responses(frf, 1e-3))
    assert {(one.channel, one.factor) for one in found.scales} == {("torque", "1000"), ("motor_angle", "1000")}


def misread_responses(frf, factor):
    return replace(frf, response=frf.response * factor)


@pytest.mark.parametrize("inverse", [False, True])
@pytest.mark.parametrize("rough", [0.6, 1.0, 1.6])
def test_accelerations_of_both_sides_in_degrees_are_named_beside_or_before_the_other_side_of_a_gear(inverse, rough):
    """A response without means: 57 times too small is also a torque of the arm's side of a gear of 120 or 100."""
    outputs = (*NAMES, *(f"{name}.arm" for name in NAMES))
    frf = exact_frf(robot(), CONFIGURATIONS, FREQUENCY_HZ, output_names=outputs)
    sides = ["arm" if name.endswith(".arm") else "motor" for name in outputs]
    channels = tuple(Channel(name, "acceleration", "rad/s^2", side) for name, side in zip(outputs, sides, strict=True))
    frf = replace(frf, measured_channels=channels, output_channels=channels)
    factor = SCALES["180/pi"] ** (-1 if inverse else 1)
    found = first(misread_responses(frf, rough * factor))
    assert Scale("acceleration", "180/pi", inverse) in found.scales
    assert first(misread_responses(frf, rough)) is None


def test_speeds_in_rpm_have_no_mean_that_tells_of_them():
    frf = exact()
    speeds = tuple(Channel(name, "speed", "rad/s") for name in NAMES)
    frf = replace(frf, measured_channels=speeds, mean_output=None, motion_rms=None)
    found = first(misread_responses(frf, SCALES["60/2pi"]))
    assert {("speed", "60/2pi"), ("torque", "9.81")} >= {(one.channel, one.factor) for one in found.scales[:1]}
    assert "60/2pi" in {one.factor for one in found.scales}


def test_currents_are_known_by_the_torque_constants_that_the_robot_file_states():
    def stated(constant):
        joints = robot().joints
        motors = [replace(joint.motor, torque_constant_nm_a=constant) for joint in joints]
        return replace(robot(), joints=tuple(replace(j, motor=m) for j, m in zip(joints, motors, strict=True)))

    frf = misread(exact(), torque=1 / 0.2)
    found = first(frf, stated(0.2))
    assert (found.cause, found.scales[0]) == ("units", Scale("torque", "torque_constant", inverse=True))
    assert "0.2" in found.message
    assert all(finding.cause != "units" for finding in data_findings(stated(None), frf))


@pytest.mark.parametrize("seed", range(12))
def test_a_rough_robot_file_accuses_no_units(seed):
    generator = np.random.default_rng(7000 + seed)

    def factor(largest):
        return float(np.exp(np.log(largest) * generator.uniform(-1, 1)))

    def heavier(body, mass):
        return body and replace(body, mass_kg=mass * body.mass_kg, inertia_kgm2=mass * body.inertia_kgm2)

    rough, joints, masses = robot(), [], []
    for joint in rough.joints:
        masses.append(factor(2))
        motor = replace(joint.motor, inertia_kgm2=factor(3) * joint.motor.inertia_kgm2)
        joints.append(replace(joint, link=heavier(joint.link, masses[-1]), motor=motor))
    springs = tuple(
        replace(spring, stiffness=factor(3) * spring.stiffness, outboard=heavier(spring.outboard, masses[spring.joint]))
        for spring in rough.springs
    )
    rough = replace(rough, joints=tuple(joints), springs=springs)
    for frf in (exact(), replace(exact(), mean_output=None, mean_input=None, motion_rms=None)):
        assert all(finding.cause != "units" for finding in data_findings(rough, frf))


def test_what_else_is_wrong_is_judged_as_if_the_scale_were_right():
    turned = misread(exact(), angle=[-SCALES["180/pi"], SCALES["180/pi"]])
    units, *more = data_findings(robot(), turned)
    assert units.scales[0] == Scale("motor_angle", "180/pi")
    assert [finding.cause for finding in more] == ["angle_sign"]


def test_a_scale_is_read_as_it_is_written():
    for scale in (Scale("time", "1000"), Scale("motor_angle", "180/pi", inverse=True, joints=("a", "b-2"))):
        assert read_scale(str(scale)) == scale


def test_a_refusal_names_the_scale_whose_doing_it_is():
    refusal = DataError("no lines are left", where="response")
    findings = data_findings(robot(), misread(exact(), torque=1e3))
    named = blamed(refusal, findings)
    assert CAUSES["units"] in named.what
    assert named.what.endswith("no lines are left")
    assert blamed(refusal, ()) is refusal
