"""A two-mass closed loop in the periodic steady state, with a static nonlinearity and noise that are known."""

import numpy as np

from robid.signals.quantities import motor_channels
from robid.signals.record import Record
from robid.signals.waveforms import multisine

PERIOD_S, N_SAMPLE = 2.0, 512
LEFT_OUT = np.array([9, 21, 33, 47])
EXCITED = np.setdiff1d(np.arange(3, 62, 2), LEFT_OUT)
ALL = np.arange(1, 200)
OMEGA = 2 * np.pi * ALL / PERIOD_S
SPEED_GAIN = 90.0 * np.eye(2)


def linear_response():
    """Two coupled masses with a well damped resonance."""
    s = 1j * OMEGA[:, None, None]
    mode = s**2 / (s**2 + 60.0 * s + 90.0**2)
    return np.array([[3.0, 1.0], [1.0, 2.0]]) + mode * np.array([[1.0, -2.0], [-2.0, 4.0]])


def wave_of(spectrum):
    """Time signal (..., n_sample, n) of complex amplitudes (..., n_line, n) at all lines."""
    whole = np.zeros((*spectrum.shape[:-2], N_SAMPLE // 2 + 1, spectrum.shape[-1]), complex)
    whole[..., ALL, :] = spectrum
    return np.fft.irfft(whole, N_SAMPLE, axis=-2, norm="forward")


def loop_record(*, cubic=0.0, quadratic=0.0, noise=0.0, realizations=4, periods=2, seed=0):
    """Speed loop around the masses; torque of a static nonlinearity in the speed opposes the motion."""
    generator = np.random.default_rng(seed)
    response, rate = linear_response(), 1 / (1j * OMEGA[:, None])
    closed = np.linalg.inv(np.eye(2) + response @ SPEED_GAIN * rate[..., None]) @ response
    phases = generator.uniform(0, 2 * np.pi, (realizations, 2, EXCITED.size))
    drive = np.zeros((realizations, 2, ALL.size, 2), complex)
    drive[:, :, EXCITED - 1] = multisine(np.ones((2, EXCITED.size)), phases)
    errors = noise * generator.standard_normal((realizations, 2, periods, N_SAMPLE, 2))
    wrong_speed = np.fft.rfft(errors, axis=-2, norm="forward")[..., ALL, :] / rate
    command = drive[:, :, None] - wrong_speed @ SPEED_GAIN.T
    opposing = np.zeros_like(command)
    for _ in range(12):
        acceleration = np.einsum("kij,repkj->repki", closed, command - opposing)
        speed = wave_of(acceleration * rate)
        opposing = np.fft.rfft(cubic * speed**3 + quadratic * speed**2, axis=-2, norm="forward")[..., ALL, :]
    position = wave_of(acceleration * rate**2) + errors
    torque = wave_of(command - acceleration * rate @ SPEED_GAIN.T)
    names = ("first", "second")
    record = Record(
        sampling_period_s=PERIOD_S / N_SAMPLE,
        configurations=np.zeros((1, 2)),
        inputs=torque[None],
        outputs=position[None],
        reference=None,
        excited_lines=EXCITED,
        detection_lines=LEFT_OUT,
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(names, "angle"),
        output_offset=np.zeros((1, 2)),
    )
    motion = np.einsum("kij,rekj->reki", closed, drive) * rate
    return record, motion
