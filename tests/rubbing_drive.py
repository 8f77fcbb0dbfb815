"""Repeated measurements of two inertias whose motor has dry friction, simulated all at once."""

import numpy as np
from scipy.linalg import expm

from robid.signals.quantities import motor_channels
from robid.signals.record import Record

STEP_S, SUBSTEPS, N_SAMPLE = 4e-4, 4, 2500
LINES = np.arange(11, 251)
SMOOTH_RAD_S = 0.5


def measure(robot, repetitions, realizations, *, periods=2, dry_nm=0.1, rms_nm=1.0, noise_rad=2e-6, seed=0):
    """Records of one drive under multisines of random phases, each of some realizations.

    The torque is held for a sample; the friction `dry_nm tanh(v / SMOOTH_RAD_S)` acts within it.
    """
    generator = np.random.default_rng(seed)
    phase = generator.uniform(0, 2 * np.pi, (repetitions * realizations, LINES.size))
    spectrum = np.zeros((len(phase), N_SAMPLE // 2 + 1), complex)
    spectrum[:, LINES] = 0.5 * rms_nm * np.sqrt(2 / LINES.size) * np.exp(1j * phase)
    torque = np.fft.irfft(spectrum, N_SAMPLE, norm="forward")
    angle = _play(robot, torque, periods, dry_nm)
    angle = angle + noise_rad * generator.standard_normal(angle.shape)
    shape = (repetitions, realizations, 1, periods, N_SAMPLE, 1)
    inputs = np.broadcast_to(torque[:, None], (len(torque), periods, N_SAMPLE)).reshape(shape)
    return [_record(robot, *pair) for pair in zip(inputs, angle.reshape(shape), strict=True)]


def _play(robot, torque, periods, dry_nm):
    """Motor angles (n, periods, n_sample) after one period of transient, by the exact matrix exponential."""
    joint, spring = robot.joints[0], robot.springs[0]
    motor, load = joint.motor.inertia_kgm2, joint.link.inertia_kgm2[2, 2]
    k, d, own, arm = spring.stiffness, spring.damping, joint.motor.friction.viscous_nms_rad, joint.arm_viscous
    slope = np.array([
        [0, 0, 1, 0], [0, 0, 0, 1],
        [-k / motor, k / motor, -(d + own) / motor, d / motor], [k / load, -k / load, d / load, -(d + arm) / load],
    ])  # fmt: skip
    drive = np.array([0, 0, 1 / motor, 0])[:, None]
    whole = expm(np.block([[slope, drive], [np.zeros((1, 5))]]) * STEP_S / SUBSTEPS)
    ahead, push = whole[:4, :4], whole[:4, 4:]
    state = np.zeros((4, len(torque)))
    angle = np.empty((len(torque), (periods + 1) * N_SAMPLE))
    for sample in range(angle.shape[1]):
        angle[:, sample] = state[0]
        for _ in range(SUBSTEPS):
            state = ahead @ state + push * (torque[:, sample % N_SAMPLE] - dry_nm * np.tanh(state[2] / SMOOTH_RAD_S))
    return angle.reshape(len(torque), periods + 1, N_SAMPLE)[:, 1:]


def _record(robot, inputs, outputs):
    names = tuple(joint.name for joint in robot.joints)
    return Record(
        sampling_period_s=STEP_S,
        inputs=inputs[None],
        outputs=outputs[None],
        output_offset=np.zeros((1, 1)),
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(names, "angle"),
        configurations=np.zeros((1, 1)),
        excited_lines=LINES,
    )
