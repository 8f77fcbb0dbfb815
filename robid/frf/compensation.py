"""Torque nonlinearities along a measured motion, as they add to the torque command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import DTypeLike
from scipy.fft import irfft, rfft

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.spectra import line_amplitudes, mean_without_drift
from robid.robot.friction import KINDS, VALUES, TorqueLaw, friction_torque
from robid.signals.quantities import MOTOR_TORQUE, Channel, UsableChannels, channel_names, describe
from robid.signals.record import Record

_MOTOR_ANGLE = UsableChannels(("angle",), ("motor",))
_NOISE_CUT = 2.5  # times the highest excited line
_SHAPE_STEP = 0.05


@dataclass(frozen=True)
class Motion:
    """The motors' motion in one configuration, mean over the periods."""

    angle: FloatArray  # (n_sample, n_real, n_exp, n_in) Motor angles, offset included [rad]
    # (n_step, n_real, n_exp, n_in) Motor speed on a finer grid, in single precision: bristles take half the time and
    # 1e-7 of the torque [rad/s]
    speed: FloatArray
    step_s: float  # Step of the grid [s]
    sampling_period_s: float  # Sampling period [s]
    lines: IntArray  # (n_freq,) DFT lines at which torques are wanted
    omega: FloatArray  # (n_freq,) Their angular frequency [rad/s]
    hold: ComplexArray  # (n_freq,) Response from torque command to continuous torque: hold and delay


@dataclass(frozen=True)
class Disturbance:
    """Torque of a law as held torque at the controller's output."""

    torque: ComplexArray  # (n_real, n_freq, n_in, n_exp) Torque that opposes the motion [N m]
    # (n_kind, n_real, n_freq, n_in, n_exp) Its derivative with respect to the coefficients in
    # `robid.robot.friction.KINDS` [N m]
    derivative: ComplexArray

    def select(self, chosen: IntArray) -> Disturbance:
        """Returns it at some of the lines, by index."""
        return Disturbance(self.torque[:, chosen], self.derivative[:, :, chosen])


def shows_friction(inputs: Sequence[Channel], outputs: Sequence[Channel]) -> bool:
    """Whether the inputs are motor torques, and the same motors' angles come first among the outputs."""
    first = outputs[: len(inputs)]
    collocated = channel_names(first) == channel_names(inputs)
    return collocated and MOTOR_TORQUE.accepts(inputs) and _MOTOR_ANGLE.accepts(first)


def record_motion(record: Record, lines: IntArray, delay_s: float, oversampling: int = 2) -> Motion:
    """Prepares the evaluation of torque laws.

    Args:
        record: Record of a single configuration; its outputs start with the inputs' motors.
        lines (n_freq,): DFT lines of one period.
        delay_s: Delay from recorded to applied torque, hold excluded [s].
        oversampling: Grid points of the speed per sample.

    Raises:
        DataError: If the inputs are no torques, or the first outputs not their motors' angles.
    """
    _check_motors(record)
    n_in, period_s = len(record.input_names), record.sampling_period_s
    angle = mean_without_drift(record.outputs[0, ..., :n_in]) + record.output_offset[0, :n_in]
    angle = np.ascontiguousarray(np.moveaxis(angle, 2, 0))
    # An arbitrary motion ends elsewhere: a ramp is taken out before its speed is found, and put back.
    rise = (angle[-1] - angle[0]) * record.is_arbitrary
    level = angle - rise * np.linspace(0, 1, len(angle))[:, None, None, None]
    cut_hz = _NOISE_CUT * record.frequency_hz[-1]
    speed = periodic_speed(level, period_s, cut_hz, oversampling, np.float32)
    if record.is_arbitrary:
        speed = speed + (rise / record.period_s).astype(np.float32)
    omega = 2 * np.pi * lines / record.period_s
    # A zero-order hold is sinc(w T / 2 pi) exp(-j w T / 2); numpy's sinc has pi inside.
    half = 0.5 * omega * period_s * (record.input_hold == "zoh")
    return Motion(
        angle=angle,
        speed=speed,
        step_s=period_s / oversampling,
        sampling_period_s=period_s,
        lines=lines,
        omega=omega,
        hold=np.sinc(half / np.pi) * np.exp(-1j * (half + omega * delay_s)),
    )


def _check_motors(record: Record) -> None:
    """Refuses channels along which no friction can be computed."""
    if shows_friction(record.input_channels, record.output_channels):
        return
    what = (
        "D015 friction is subtracted from motor torques along the angles of the same motors, which come first among the"
        f" outputs; here the inputs are {describe(record.input_channels)},"
        f" the outputs {describe(record.output_channels)}"
    )
    raise DataError(what, remedy="use `compensation: none`, or import the motors' angles in the order of the torques")


def friction_spectrum(motion: Motion, laws: Sequence[TorqueLaw]) -> ComplexArray:
    """Friction (n_real, n_freq, n_in, n_exp) of the laws, lag included, ripple not [N m]."""
    torque = friction_torque(motion.speed, motion.step_s, laws)
    # A lag of the friction behind the motion turns its spectrum.
    lag_s = motion.sampling_period_s * np.array([law.lag_samples for law in laws])
    later = np.exp(-1j * np.outer(motion.omega, lag_s))
    return np.asarray(_held(motion, torque) * later[:, :, None])


def ripple_spectra(motion: Motion, laws: Sequence[TorqueLaw]) -> ComplexArray:
    """Ripple of unit coefficients (2, n_real, n_freq, n_in, n_exp): its sine and its cosine [N m]."""
    amplitude = np.array([law.ripple_nm for law in laws])
    if not amplitude.any():
        n_real, n_exp, n_in = motion.angle.shape[1:]
        return np.zeros((2, n_real, len(motion.lines), n_in, n_exp), complex)
    phase = motion.angle * np.array([law.ripple_order for law in laws])
    # Whole turns are taken off before single precision, which has 1e-7 of the phase's size.
    turns = np.round(phase.mean(axis=0) / (2 * np.pi))
    phase = (phase - 2 * np.pi * turns).astype(np.float32)
    return np.stack([_held(motion, amplitude.astype(np.float32) * wave(phase)) for wave in (np.sin, np.cos)])


def disturbance(motion: Motion, laws: Sequence[TorqueLaw]) -> Disturbance:
    """Torque of the laws along a motion, and what each coefficient changes."""
    level = friction_spectrum(motion, laws)
    # Level and lag enter in closed form; the shape only as a difference over a step of 5 %.
    changed = friction_spectrum(motion, [law.shaped(1 + _SHAPE_STEP) for law in laws])
    ripple = ripple_spectra(motion, laws)
    known = np.array([[law.ripple_sin for law in laws], [law.ripple_cos for law in laws]])
    lag = -1j * (motion.omega * motion.sampling_period_s)[:, None, None] * level
    # Coefficients are relative to the robot file's: a law at 1 + offset of it has its derivative over that.
    stated = 1 + np.array([law.offset[:2] for law in laws]).T[:, :, None]
    derivative = np.stack([level / stated[0], (changed - level) / (_SHAPE_STEP * stated[1]), lag, *ripple])
    return Disturbance(level + np.einsum("wi,wrfie->rfie", known, ripple), derivative)


def no_disturbance(record: Record, lines: IntArray) -> Disturbance:
    """A disturbance of zero without coefficients, at some DFT lines."""
    n_real, n_exp = record.inputs.shape[1:3]
    torque = np.zeros((n_real, len(lines), len(record.input_names), n_exp), complex)
    return Disturbance(torque, torque[None][:0])


def coefficient_names(record: Record) -> tuple[str, ...]:
    """Names of the coefficients, each kind's motors in turn."""
    return tuple(f"{name}.{kind}" for kind in KINDS for name in record.input_names)


def law_table(record: Record, laws: Sequence[TorqueLaw]) -> tuple[tuple[str, ...], FloatArray, FloatArray]:
    """Names, values and standard deviations of the laws' values, motor by motor."""
    names = tuple(f"{name}.{value}" for name in record.input_names for value in VALUES)
    return names, np.ravel([law.values for law in laws]), np.ravel([law.values_std for law in laws])


def periodic_speed(
    angle: FloatArray, sampling_period_s: float, cut_hz: float, oversampling: int, dtype: DTypeLike = np.float64
) -> FloatArray:
    """Differentiates one period of an angle by its DFT: speed (n_sample * oversampling, ...) on a finer grid [rad/s].

    Args:
        angle (n_sample, ...): One period [rad].
        sampling_period_s: Sampling period [s].
        cut_hz: Content above is dropped: it is noise of the encoder.
        oversampling: Grid points per sample.
        dtype: Precision of the speed.
    """
    n_sample = angle.shape[0]
    omega = 2 * np.pi * np.fft.rfftfreq(n_sample, sampling_period_s)
    omega = omega[omega <= 2 * np.pi * cut_hz]
    rate = (1j * oversampling * omega).reshape(-1, *(1,) * (angle.ndim - 1))
    spectrum = (rate * rfft(angle, axis=0)[: len(omega)]).astype(np.result_type(dtype, np.complex64))
    # The longer inverse transform pads with zeros: the trigonometric interpolant between the samples.
    return np.asarray(irfft(spectrum, n_sample * oversampling, axis=0))


def _held(motion: Motion, torque: FloatArray) -> ComplexArray:
    """Spectrum (n_real, n_freq, n_in, n_exp) of a torque (n_step, n_real, n_exp, n_in), over the hold."""
    # A held command of this spectrum over the hold gives the continuous torque at these lines.
    flat = line_amplitudes(torque.reshape(len(torque), -1), motion.lines) / motion.hold[:, None]
    return np.asarray(flat.reshape(-1, *torque.shape[1:]).transpose(1, 0, 3, 2))
