"""Exactly solvable robots and exact responses of them, shared by the tests of the science layers."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from robid.frf.frf import Frf
from robid.robot.description import Inertial, Joint, Motor, Robot, Sensor, Spring, StiffnessLaw
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.nuisance import NuisanceStd
from robid.robot.response import nominal_parameters, response
from robid.signals.quantities import motor_channels

SOFTENING = StiffnessLaw(0, "compliance", np.array([1.0, 0.9]))
NO_PAYLOAD = Inertial(0.0, np.zeros(3), np.zeros((3, 3)))


def two_mass_robot(
    motor_inertia=4.780e-3, load_inertia=4.752e-3, stiffness=546.4, damping=0.01, ratio=1.0, viscous=0.0, rotor_std=0.05
):
    """A motor, a spring and a load, free of gravity; the defaults are those of the motor bench."""
    link = Inertial(1.0, np.zeros(3), load_inertia * np.eye(3))
    motor = Motor(motor_inertia, ratio, 300.0, 10.0, inertia_relative_std=rotor_std)
    motor = replace(motor, friction=replace(motor.friction, viscous_nms_rad=viscous))
    joint = Joint("drive", np.zeros(3), np.eye(3), link, -np.pi, np.pi, motor)
    spring = Spring("coupling", 0, "transmission", np.array([0.0, 0.0, 1.0]), stiffness, damping)
    return Robot("two masses", np.zeros(3), (joint,), (spring,), NO_PAYLOAD)


def two_joint_robot(rotor="spong"):
    """Two vertical links with soft gears, one bearing spring and one split link, under gravity."""
    turn = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    first = Inertial(20.0, np.array([0.35, 0.02, 0.15]), np.diag([0.2, 1.4, 1.5]))
    second = Inertial(12.0, np.array([0.25, -0.03, 0.12]), np.diag([0.1, 0.5, 0.55]))
    outboard = Inertial(5.0, np.array([0.45, -0.01, 0.11]), np.diag([0.03, 0.08, 0.09]))
    motors = (Motor(8e-4, 120.0, 400.0, 20.0), Motor(4e-4, 100.0, 400.0, 15.0))
    joints = (
        Joint("shoulder", np.array([0.0, 0.0, 0.4]), turn, first, -2.0, 2.0, motors[0]),
        Joint("elbow", np.array([0.7, 0.0, 0.25]), np.eye(3), second, -2.5, 2.5, motors[1]),
    )
    z, x = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    springs = (
        Spring("gear_1", 0, "transmission", z, 2.0e4, 30.0),
        Spring("gear_2", 1, "transmission", z, 6.0e3, 8.0),
        Spring("bearing_1", 0, "bearing", x, 3.0e4, 30.0),
        Spring("forearm", 1, "split", z, 8.0e3, 6.0, 0.0, np.array([0.3, 0.0, 0.0]), outboard),
    )
    payload = Inertial(4.0, np.array([0.6, 0.0, 0.15]), 0.02 * np.eye(3))
    return Robot("two joints", np.array([0.0, 0.0, -9.81]), joints, springs, payload, rotor)


def stocky(robot):
    """A robot whose links' inertias lie far from those that could not be, so that they may be off."""

    def rounder(body):
        return replace(body, inertia_kgm2=body.inertia_kgm2 + 0.5 * np.eye(3))

    return replace(robot, joints=tuple(replace(joint, link=rounder(joint.link)) for joint in robot.joints))


def certain(robot):
    """The robot with a file that is taken for granted."""
    nothing = NuisanceStd(**{each.name: 0.0 for each in fields(NuisanceStd)})
    joints = tuple(replace(joint, nuisance_std=nothing) for joint in robot.joints)
    return replace(robot, joints=joints, nuisance_std=nothing)


def linear_axis(rotor_kgm2=2e-3, mass_kg=80.0, stiffness=5e6, damping=3e3, ratio=-628.0, viscous=0.004, upright=False):
    """A motor, a screw and a carriage that slides along the world's x, or upwards."""
    along_x = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    motor = Motor(rotor_kgm2, ratio, 600.0, 60.0)
    motor = replace(motor, friction=replace(motor.friction, viscous_nms_rad=viscous))
    carriage = Inertial(mass_kg, np.array([0.05, 0.1, 0.02]), np.diag([2.0, 3.0, 4.0]))
    turn = np.eye(3) if upright else along_x
    joint = Joint("rail", np.array([0.0, 0.0, 0.3]), turn, carriage, 0.0, 2.0, motor, type="prismatic")
    spring = Spring("gear_rail", 0, "transmission", np.array([0.0, 0.0, 1.0]), stiffness, damping)
    return Robot("linear axis", np.array([0.0, 0.0, -9.81]), (joint,), (spring,), NO_PAYLOAD)


def ball_screw(shafts=2, over=SOFTENING, viscous=2e-3):
    """A motor, lumps of a screw whose last section and nut soften along it, and a slide across gravity."""
    robot = linear_axis(rotor_kgm2=1e-3, mass_kg=51.0, stiffness=3e7, damping=2e3, ratio=125.7, viscous=viscous)
    z = np.array([0.0, 0.0, 1.0])
    twists = tuple(
        Spring(f"twist_{number}", 0, "shaft", z, 1.5e3 * number, 0.05, inertia_kgm2=2e-4 * number)
        for number in range(1, shafts + 1)
    )
    if twists:
        twists = (*twists[:-1], replace(twists[-1], stiffness_over=over))
    joint = replace(robot.joints[0], lower=-0.4, upper=0.4)
    nut = replace(robot.springs[0], name="nut", stiffness_over=over)
    return replace(robot, name="ball screw", joints=(joint,), springs=(nut, *twists))


def varying_arm(rotor="spong"):
    """Two joints under gravity: gear and bearing of the shoulder depend on the elbow, the forearm on the shoulder."""
    robot = two_joint_robot(rotor)
    table = StiffnessLaw(1, "table", np.array([1.3, 1.0, 0.6]), np.array([-2.5, 0.2, 2.5]))
    laws = {
        "gear_1": table,
        "bearing_1": StiffnessLaw(1, "stiffness", np.array([1.0, 0.2, -0.05])),
        "forearm": StiffnessLaw(0, "compliance", np.array([1.0, 0.3, 0.1])),
    }
    springs = tuple(replace(spring, stiffness_over=laws.get(spring.name)) for spring in robot.springs)
    return replace(robot, springs=springs)


def arm_on_rail():
    """The two joints on a carriage that slides on an elastic screw and pitches about the world's y."""
    rail, arm = linear_axis(), two_joint_robot()
    along_x = rail.joints[0].rotation
    shoulder, elbow = arm.joints
    shoulder = replace(shoulder, position_m=along_x.T @ shoulder.position_m, rotation=along_x.T @ shoulder.rotation)
    pitch = Spring("pitch", 0, "bearing", np.array([1.0, 0.0, 0.0]), 4e6, 4e3)
    springs = (*rail.springs, *(replace(spring, joint=spring.joint + 1) for spring in arm.springs), pitch)
    return replace(arm, name="arm on a rail", joints=(rail.joints[0], shoulder, elbow), springs=springs)


def with_arm_friction(robot, *arm_viscous):
    """The robot with viscous friction between its arms and what carries them."""
    joints = tuple(replace(joint, arm_viscous=each) for joint, each in zip(robot.joints, arm_viscous, strict=True))
    return replace(robot, joints=joints)


def without_spring(robot, name):
    """The robot without one of its springs; without its transmission a joint is rigid."""
    return replace(robot, springs=tuple(spring for spring in robot.springs if spring.name != name))


def springs_everywhere():
    """Two joints with a flexible base and payload, two hinges each, and coupled motors."""
    robot = two_joint_robot()
    lean, turn = np.array([0.6, 0.8, 0.0]), np.array([0.0, 0.0, 1.0])
    springs = (
        Spring("rock", 0, "base", lean, 4e4, 40.0, 0.0, np.array([0.1, 0.0, -0.2])),
        Spring("yaw", 0, "base", turn, 5e4, 40.0, 0.0, np.array([0.0, 0.1, 0.1])),
        Spring("sway", 1, "payload", lean, 2e3, 3.0, 0.0, np.array([0.55, 0.0, 0.1])),
        Spring("twist", 1, "payload", turn, 1e3, 2.0, 0.0, np.array([0.55, 0.0, 0.1])),
    )
    elbow = replace(robot.joints[1], couplings={"shoulder": 0.002})
    base = Inertial(30.0, np.array([0.0, 0.05, 0.1]), np.diag([0.8, 0.9, 1.0]))
    return replace(robot, springs=(*robot.springs, *springs), joints=(robot.joints[0], elbow), base=base)


def sensed_everywhere():
    """Springs everywhere, a tracker on the payload and an accelerometer on the second link."""
    lean = np.array([0.48, 0.6, 0.64])
    sensors = (
        Sensor("tip", "tracker", None, np.array([0.7, 0.1, 0.2]), lean),
        Sensor("felt", "accelerometer", 1, np.array([0.4, 0.05, 0.1]), lean),
    )
    return replace(springs_everywhere(), sensors=sensors)


def exact_frf(
    robot,
    configurations,
    frequency_hz,
    *,
    delay_s=0.0,
    sampling_period_s=1e-3,
    output_names=None,
    torque_hold="zoh",
    relative_noise=0.0,
    declared_noise=None,
    seed=0,
):
    """The robot's own response as an estimate with independent circular noise of a known covariance.

    `relative_noise` is the residual's standard deviation over the median magnitude of the response;
    `declared_noise` is what the covariance says, where it differs.
    """
    configurations = np.atleast_2d(configurations)
    names = tuple(joint.name for joint in robot.joints)
    outputs = output_names or names
    model = build_model(robot, balanced=True)
    linear = linearize(model, solve_statics(model, configurations), outputs)
    held_s = sampling_period_s if torque_hold == "zoh" else None
    exact = response(linear, nominal_parameters(robot, linear, delay_s), frequency_hz, held_s).sampled
    n_conf, n_freq, n_out, n_in = exact.shape
    level = relative_noise * np.median(np.abs(exact), axis=(0, 1, 3))
    generator = np.random.default_rng(seed)
    noise = generator.standard_normal((2, *exact.shape)) / np.sqrt(2)
    noisy = exact + level[:, None] * (noise[0] + 1j * noise[1])
    declared = relative_noise if declared_noise is None else declared_noise
    covariance = None
    if declared > 0:
        stated = declared * np.median(np.abs(exact), axis=(0, 1, 3))
        covariance = np.broadcast_to(np.diag(stated.astype(complex) ** 2), (n_conf, n_freq, n_out, n_out))
    return Frf(
        frequency_hz=frequency_hz,
        lines=np.arange(1, n_freq + 1),
        configurations=configurations,
        response=noisy,
        input_factor=np.broadcast_to(np.eye(n_in, dtype=complex), (n_conf, n_freq, n_in, n_in)),
        element_scale=np.ones((n_conf, n_out, n_in)),
        total_covariance=covariance,
        noise_covariance=None,
        total_degrees_of_freedom=1e6 if declared > 0 else 0.0,
        noise_degrees_of_freedom=0.0,
        sensitivity=np.zeros((n_conf, 0, n_freq, n_out, n_in), complex),
        coefficient_names=(),
        coefficient_relative_std=np.zeros(0),
        removed_torque_rms=np.zeros((n_conf, n_in)),
        sampling_period_s=sampling_period_s,
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(outputs, "acceleration"),
        input_hold=torque_hold,
    )


def with_spring_factors(robot, stiffness=1.0, damping=1.0):
    """The robot with all its springs and dampers multiplied, by one factor or one each."""
    factors = np.broadcast_to(stiffness, len(robot.springs)), np.broadcast_to(damping, len(robot.springs))
    springs = tuple(
        replace(spring, stiffness=spring.stiffness * k, damping=spring.damping * d)
        for spring, k, d in zip(robot.springs, *factors, strict=True)
    )
    return replace(robot, springs=springs)


def friction_frf(robot, configurations, frequency_hz, scales, *, declared=1e-6):
    """Response of a torque from which compensation left out `scales` of two friction torques that follow the inputs."""
    frf = exact_frf(robot, configurations, frequency_hz, delay_s=1e-3, declared_noise=declared)
    generator = np.random.default_rng(2)
    shape = (len(configurations), 2, len(frequency_hz), 2, 2)
    share = 0.5 * (generator.standard_normal(shape) + 1j * generator.standard_normal(shape))
    recorded = np.linalg.inv(np.eye(2) + np.einsum("s,csfij->cfij", np.array(scales), share))
    return replace(
        frf,
        response=frf.response @ recorded,
        sensitivity=(frf.response @ recorded)[:, None] @ share @ recorded[:, None],
        coefficient_names=("shoulder.level", "elbow.level"),
        coefficient_relative_std=np.array([0.1, 0.1]),
    )
