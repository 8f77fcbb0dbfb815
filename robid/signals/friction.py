"""Friction and ripple torque of a motor from its measured periodic motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np
from numpy.typing import DTypeLike
from scipy.fft import irfft, rfft

from robid.arrays import FloatArray

KINDS = ("level", "shape", "lag", "ripple_sin", "ripple_cos")
"""Coefficients of a law: errors of levels and of speeds and deflections, relative to the robot file's; of the lag, in
samples; of the ripple, relative to its amplitude."""

VALUES = ("coulomb_nm", "static_nm", "stribeck_rad_s", "width", "lag_samples", "ripple_sin", "ripple_cos")
"""Values of a law: the width is a deflection [rad] or, without memory, a speed [rad/s]; ripples are relative."""

_LAG_STD = 0.5
_STRETCH = 128


@dataclass(frozen=True)
class TorqueLaw:
    """Torque nonlinearities of one motor and how well they are known.

    Attributes:
        coulomb_nm: Coulomb level [N m].
        static_nm: Breakaway level [N m].
        stribeck_rad_s: Stribeck speed [rad/s].
        presliding_rad: Bristle deflection at the Coulomb level [rad]; 0 for a law without memory.
        relative_std: Standard deviation of the relative error of levels and of speeds and deflections.
        ripple_nm: Amplitude of the torque ripple [N m].
        ripple_order: Ripple periods per motor turn.
        smoothing_rad_s: Speed over which a law without memory changes its sign, as tanh [rad/s].
        lag_samples: Known lag of the friction behind the motion [samples].
        ripple_sin: Known part of the ripple that opposes the motion with the sine of its order, over its amplitude.
        ripple_cos: The same with the cosine.
        offset: How far each coefficient in `KINDS` is from the robot file's.
        identified_std: Standard deviations of the values in `VALUES` where they were identified; None otherwise.
        uneven_nms_rad: Half of what viscous friction is larger forward than backward: a torque per size of the speed,
            which no linear model has [N m s/rad].
    """

    coulomb_nm: float
    static_nm: float
    stribeck_rad_s: float
    presliding_rad: float
    relative_std: float
    ripple_nm: float
    ripple_order: int
    smoothing_rad_s: float = 0.0
    lag_samples: float = 0.0
    ripple_sin: float = 0.0
    ripple_cos: float = 0.0
    offset: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)
    identified_std: tuple[float, ...] | None = None
    uneven_nms_rad: float = 0.0

    @property
    def is_zero(self) -> bool:
        """Whether the law gives no torque."""
        return self.coulomb_nm == 0 and self.ripple_nm == 0 and self.uneven_nms_rad == 0

    @property
    def coefficient_std(self) -> tuple[float, ...]:
        """Standard deviation of each coefficient in `KINDS`.

        Of a law from a robot file the lag is unknown to half a sample and the phase of the ripple unknown.
        """
        if self.identified_std is not None and self.coulomb_nm > 0:
            coulomb, _, _, width, *others = self.identified_std
            level, shape = (1 + value for value in self.offset[:2])
            return (level * coulomb / self.coulomb_nm, shape * width / self.width, *others)
        friction = float(self.coulomb_nm > 0)
        ripple = float(np.sqrt(0.5)) * float(self.ripple_nm > 0)
        return (friction * self.relative_std, friction * self.relative_std, friction * _LAG_STD, ripple, ripple)

    @property
    def width(self) -> float:
        """Presliding deflection, or smoothing speed of a law without memory [rad or rad/s]."""
        return self.presliding_rad or self.smoothing_rad_s

    @property
    def values(self) -> tuple[float, ...]:
        """The values in `VALUES`."""
        speeds = (self.stribeck_rad_s, self.width, self.lag_samples)
        return (self.coulomb_nm, self.static_nm, *speeds, self.ripple_sin, self.ripple_cos)

    @property
    def values_std(self) -> tuple[float, ...]:
        """Their standard deviations."""
        if self.identified_std is not None:
            return self.identified_std
        relative = [self.relative_std * value for value in self.values[:4]]
        return (*relative, *self.coefficient_std[2:])


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
    spectrum = rfft(angle, axis=0)
    omega = 2 * np.pi * np.fft.rfftfreq(n_sample, sampling_period_s)
    omega = np.where(omega <= 2 * np.pi * cut_hz, omega, 0.0)
    rate = 1j * omega.reshape(-1, *(1,) * (angle.ndim - 1))
    return np.asarray(irfft(rate * spectrum, n_sample * oversampling, axis=0) * oversampling)


def friction_torque(speed: FloatArray, step_s: float, laws: Sequence[TorqueLaw]) -> FloatArray:
    """Friction along one period of a motion in the periodic steady state; lag and ripple are left out.

    Args:
        speed (n_step, ..., n_motor): One period of the motor speed [rad/s].
        step_s: Grid step [s].
        laws: One law per motor.

    Returns:
        Torque that opposes the motion, of the same shape [N m].

    Source:
        LuGre without bristle damping: `z' = v - |v| z / z_max(v)`, exact for constant speed in a step. Without
        memory, `tanh(v / v_s)` times the Stribeck curve.
    """
    bristle = np.array([law.presliding_rad > 0 for law in laws])
    torque = np.empty_like(speed)
    for chosen, curve in ((bristle, _bristle_torque), (~bristle, _curve_torque)):
        if chosen.all():
            torque = curve(speed, step_s, laws)
        elif chosen.any():
            torque[..., chosen] = curve(speed[..., chosen], step_s, list(compress(laws, chosen)))
    uneven = _values(laws, "uneven_nms_rad", speed.dtype)
    return torque + uneven * np.abs(speed) if uneven.any() else torque


def _bristle_torque(speed: FloatArray, step_s: float, laws: Sequence[TorqueLaw]) -> FloatArray:
    presliding, coulomb = _values(laws, "presliding_rad", speed.dtype), _values(laws, "coulomb_nm", speed.dtype)
    mean_speed = np.roll(speed, -1, axis=0)
    mean_speed += speed
    mean_speed *= 0.5
    limit = _stribeck(mean_speed, laws)
    limit *= presliding
    decay = np.abs(mean_speed)
    decay *= -step_s
    decay /= limit
    np.exp(decay, out=decay)
    drive = np.copysign(limit, mean_speed, out=limit)
    drive *= 1 - decay
    return periodic_recurrence(decay, drive) * (coulomb / presliding)


def _curve_torque(speed: FloatArray, _step_s: float, laws: Sequence[TorqueLaw]) -> FloatArray:
    coulomb, smoothing = _values(laws, "coulomb_nm", speed.dtype), _values(laws, "smoothing_rad_s", speed.dtype)
    level = coulomb * np.tanh(speed / smoothing)
    return np.asarray(level * _stribeck(speed, laws))


def periodic_recurrence(decay: FloatArray, drive: FloatArray) -> FloatArray:
    """Solves `z[k+1] = decay[k] z[k] + drive[k]` for the z that repeats.

    Args:
        decay (n_step, ...): Factors from 0 to 1, not all of them 1.
        drive (n_step, ...): Additions.

    Returns:
        z of the same shape; 0 at the start where the factors' product is 1.
    """
    n_stretch = next(count for count in range(max(1, len(decay) // _STRETCH), 0, -1) if len(decay) % count == 0)
    shape = (n_stretch, len(decay) // n_stretch, *decay.shape[1:])
    factors, additions = decay.reshape(shape), drive.reshape(shape)
    # All stretches at once from rest; then what each hands on to the next.
    gain, total = np.ones((n_stretch, *shape[2:]), decay.dtype), np.zeros((n_stretch, *shape[2:]), decay.dtype)
    for step in range(shape[1]):
        total *= factors[:, step]
        total += additions[:, step]
        gain *= factors[:, step]
    state = np.empty_like(total)
    state[0] = _fixed_point(gain, total)
    for stretch in range(1, n_stretch):
        state[stretch] = gain[stretch - 1] * state[stretch - 1] + total[stretch - 1]
    result = np.empty(shape, decay.dtype)
    for step in range(shape[1]):
        result[:, step] = state
        state *= factors[:, step]
        state += additions[:, step]
    return result.reshape(decay.shape)


def _fixed_point(gain: FloatArray, total: FloatArray) -> FloatArray:
    """Start of the first stretch that comes back after the last; 0 where nothing decays."""
    start, product = np.zeros(gain.shape[1:]), np.ones(gain.shape[1:])
    for one_gain, one_total in zip(gain, total, strict=True):
        start, product = one_gain * start + one_total, product * one_gain
    return np.divide(start, 1 - product, out=np.zeros_like(start), where=product < 1)


def _stribeck(speed: FloatArray, laws: Sequence[TorqueLaw]) -> FloatArray:
    """Level over the Coulomb level."""
    coulomb, static = _values(laws, "coulomb_nm", speed.dtype), _values(laws, "static_nm", speed.dtype)
    excess = np.divide(static, coulomb, out=np.ones_like(coulomb), where=coulomb > 0) - 1
    curve = speed / _values(laws, "stribeck_rad_s", speed.dtype)
    curve *= -curve
    np.exp(curve, out=curve)
    curve *= excess
    curve += 1
    return curve


def _values(laws: Sequence[TorqueLaw], name: str, dtype: DTypeLike) -> FloatArray:
    return np.array([getattr(law, name) for law in laws], dtype)
