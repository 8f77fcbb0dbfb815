"""Friction and ripple torque of a motor from its measured periodic motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray

KINDS = ("level", "shape", "lag", "ripple_sin", "ripple_cos")

_WARM_UP = 0.25
_SHAPE_STEP = 0.05
_LAG_STD = 0.5


@dataclass(frozen=True)
class TorqueLaw:
    """Nominal torque nonlinearities of one motor and how well they are known.

    Attributes:
        coulomb_nm: Coulomb level [N m].
        static_nm: Breakaway level [N m].
        stribeck_rad_s: Stribeck speed [rad/s].
        presliding_rad: Bristle deflection at the Coulomb level [rad].
        relative_std: Standard deviation of the relative error of levels and of speeds and deflections.
        ripple_nm: Amplitude of the torque ripple, its phase unknown [N m].
        ripple_order: Ripple periods per motor turn.
    """

    coulomb_nm: float
    static_nm: float
    stribeck_rad_s: float
    presliding_rad: float
    relative_std: float
    ripple_nm: float
    ripple_order: int

    @property
    def is_zero(self) -> bool:
        """Whether the law gives no torque."""
        return self.coulomb_nm == 0 and self.ripple_nm == 0

    @property
    def coefficient_std(self) -> tuple[float, ...]:
        """Standard deviation of each coefficient in `KINDS`.

        Level and shape are relative to nominal, the lag is in samples, the ripple relative to its amplitude.
        """
        friction = float(self.coulomb_nm > 0)
        ripple = float(np.sqrt(0.5)) * float(self.ripple_nm > 0)
        return (friction * self.relative_std, friction * self.relative_std, friction * _LAG_STD, ripple, ripple)


def torque_regressors(
    angle: FloatArray, sampling_period_s: float, laws: tuple[TorqueLaw, ...], cut_hz: float, oversampling: int = 2
) -> FloatArray:
    """Torque of each coefficient's unit error, along a measured motion.

    Args:
        angle (n_sample, ..., n_motor): One period of the motor angles, offset included [rad].
        sampling_period_s: Sampling period [s].
        laws: One law per motor.
        cut_hz: Content of the angle above is noise.
        oversampling: Grid points per sample.

    Returns:
        (len(KINDS), n_sample * oversampling, ..., n_motor): torque that opposes the motion [N m]. The first is
        the nominal friction itself.
    """
    speed = periodic_speed(angle, sampling_period_s, cut_hz, oversampling)
    step_s = sampling_period_s / oversampling
    shaped = tuple(
        replace(
            law,
            stribeck_rad_s=law.stribeck_rad_s * (1 + _SHAPE_STEP),
            presliding_rad=law.presliding_rad * (1 + _SHAPE_STEP),
        )
        for law in laws
    )
    both = lugre_torque(np.concatenate([speed, speed], axis=-1), step_s, laws + shaped)
    level, changed = both[..., : len(laws)], both[..., len(laws) :]
    order = np.array([law.ripple_order for law in laws])
    amplitude = np.array([law.ripple_nm for law in laws])
    phase = order * np.repeat(angle, oversampling, axis=0)
    ripples = amplitude * np.sin(phase), amplitude * np.cos(phase)
    later = (np.roll(level, 1, axis=0) - level) * oversampling
    return np.stack([level, (changed - level) / _SHAPE_STEP, later, *ripples])


def periodic_speed(angle: FloatArray, sampling_period_s: float, cut_hz: float, oversampling: int) -> FloatArray:
    """Differentiates one period of an angle by its DFT, on a finer grid.

    Args:
        angle (n_sample, ...): One period [rad].
        sampling_period_s: Sampling period [s].
        cut_hz: Content above is dropped: it is noise of the encoder.
        oversampling: Grid points per sample.

    Returns:
        Speed (n_sample * oversampling, ...) [rad/s].
    """
    n_sample = angle.shape[0]
    spectrum = np.fft.rfft(angle, axis=0)
    omega = 2 * np.pi * np.fft.rfftfreq(n_sample, sampling_period_s)
    omega = np.where(omega <= 2 * np.pi * cut_hz, omega, 0.0)
    rate = 1j * omega.reshape(-1, *(1,) * (angle.ndim - 1))
    return np.asarray(np.fft.irfft(rate * spectrum, n_sample * oversampling, axis=0) * oversampling)


def lugre_torque(speed: FloatArray, step_s: float, laws: tuple[TorqueLaw, ...]) -> FloatArray:
    """Integrates the bristle state over one period in the periodic steady state.

    Args:
        speed (n_step, ..., n_motor): One period of the motor speed [rad/s].
        step_s: Grid step [s].
        laws: One law per motor.

    Returns:
        Torque that opposes the motion, of the same shape [N m].

    Source:
        LuGre without bristle damping: `z' = v - |v| z / z_max(v)`, exact for constant speed in a step.
    """
    coulomb, static, stribeck, presliding = (
        np.array([getattr(law, name) for law in laws])
        for name in ("coulomb_nm", "static_nm", "stribeck_rad_s", "presliding_rad")
    )
    ratio = np.divide(static, coulomb, out=np.ones_like(coulomb), where=coulomb > 0)
    mean_speed = 0.5 * (speed + np.roll(speed, -1, axis=0))
    limit = presliding * (1 + (ratio - 1) * np.exp(-((mean_speed / stribeck) ** 2)))
    decay = np.exp(-np.abs(mean_speed) * step_s / limit)
    drive = np.sign(mean_speed) * limit * (1 - decay)
    bristle = np.empty_like(speed)
    state = np.zeros(speed.shape[1:])
    n_step = speed.shape[0]
    for step in range(n_step - int(_WARM_UP * n_step), n_step):
        state = state * decay[step] + drive[step]
    for step in range(n_step):
        bristle[step] = state
        state = state * decay[step] + drive[step]
    return np.asarray(bristle * (coulomb / presliding))
