"""Two rigid drives under the real controller, whose sampled motion is known exactly."""

from __future__ import annotations

import numpy as np

from robid.design.excitation.loop import NominalLoop
from robid.design.excitation.options import MultisineOptions
from robid.robot.description import Inertial, Joint, Motor, Robot
from robid.simulate.controller import Cascade, angle_reference
from robid.simulate.options import Controller

STEP = 1e-3
INERTIA = np.array([0.01, 0.02])
OPTIONS = MultisineOptions(period_s=1, low_hz=2, high_hz=40, count=15, rms=(8.0, 12.0), phase_starts=2)


def make_robot(max_speed=100.0, max_torque=60.0):
    body = Inertial(1.0, np.zeros(3), np.eye(3))
    joints = tuple(
        Joint(f"axis_{index + 1}", np.zeros(3), np.eye(3), body, -1.0, 1.0, Motor(inertia, 50.0, max_speed, max_torque))
        for index, inertia in enumerate(INERTIA)
    )
    return Robot("two drives", np.zeros(3), joints, (), body)


def rigid_response(excitation):
    """Exactly sampled response of two rigid drives with one sample of delay, torque to acceleration."""
    omega = 2 * np.pi * excitation.frequency_hz
    z = np.exp(1j * omega * STEP)
    angle = STEP**2 * (z + 1) / (2 * (z - 1) ** 2) / z
    return (-(omega**2) * angle)[None, :, None, None] * np.diag(1 / INERTIA)


def make_loop(excitation, controller=None, static=((0.0, 0.0),), robot=None):
    """The two drives in as many configurations as there are static torques."""
    static = np.asarray(static)
    return NominalLoop(
        robot=robot or make_robot(),
        controller=controller or Controller(),
        configurations=np.arange(2.0 * len(static)).reshape(-1, 2),
        frequency_hz=excitation.frequency_hz,
        response=np.repeat(rigid_response(excitation), len(static), axis=0),
        static_torque=static,
    )


def simulate_rigid(excitation, controller, static, periods):
    """Steps two rigid drives under the real controller; returns the last period's torque, speed and angle."""
    reference = excitation.reference.reshape(-1, *excitation.reference.shape[2:])
    n_row, n_sample, n_motor = reference.shape
    zero = np.zeros((n_row, n_motor))
    target, feed = np.zeros_like(reference), np.zeros_like(reference)
    if excitation.kind == "speed_reference":
        target, feed = angle_reference(reference, STEP), reference
    cascade = Cascade(controller, INERTIA, np.full(n_motor, np.inf), zero, static)
    angle, speed, command = zero, zero, np.broadcast_to(static, zero.shape)
    trace = []
    for index in range(periods * n_sample):
        sample = index % n_sample
        applied, command = command, cascade.command(angle, target[:, sample], feed[:, sample])
        if excitation.kind == "torque":
            command = command + reference[:, sample]
        trace.append((command, speed, angle))
        acceleration = (applied - static) / INERTIA
        angle, speed = angle + STEP * speed + STEP**2 / 2 * acceleration, speed + STEP * acceleration
    return np.array(trace[-n_sample:]).transpose(1, 0, 2, 3)
