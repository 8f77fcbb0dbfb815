"""Friction of motors, in this order: what a robot file states, the laws, and one motor's law as it is identified.

`LAWS` holds every law that is simulated or identified. A further one is a subclass of `FrictionLaw` (or an instance of
`Curve`), its name in `LawName` and its row in `LAWS`: the engine, the choice of steps, the compensation of responses
and their silent lines ask the law alone.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, NamedTuple, TypeAlias, TypeVar

import numpy as np
from numpy.typing import DTypeLike

from robid.arrays import FloatArray

LawName: TypeAlias = Literal["lugre", "tanh", "stribeck"]
SIGN_SHARE = 0.1  # Width of a smoothed sign over the Stribeck speed
KINDS = ("level", "shape", "lag", "ripple_sin", "ripple_cos")
"""Coefficients of a law: errors of levels and of speeds and deflections, relative to the robot file's; of the lag, in
samples; of the ripple, relative to its amplitude."""

VALUES = ("coulomb_nm", "static_nm", "stribeck_rad_s", "width", "lag_samples", "ripple_sin", "ripple_cos")
"""Values of a law: the width is a deflection [rad] or, without memory, a speed [rad/s]; ripples are relative."""

_LAG_STD = 0.5
_STRETCH = 128
_AT_ONCE = 1 << 15  # Values of a signal that are worked on at once, as many as stay in a processor's cache
_VANISHED = -80.0  # Exponent of what counts for nothing
_REACH = 5.0  # where a polygon ends, over the Stribeck speed
_FINE = 20001


@dataclass(frozen=True)
class Friction:
    """LuGre motor friction with its Coulomb level as the limit of fast motion; motor side."""

    viscous_nms_rad: float = 0.0  # Viscous coefficient [N m s/rad]
    coulomb_nm: float = 0.0  # Coulomb level [N m]
    static_nm: float = 0.0  # Breakaway level [N m]
    stribeck_rad_s: float = 1.0  # Stribeck speed [rad/s]
    presliding_rad: float = 0.02  # Bristle deflection at the Coulomb level: `sigma_0 = coulomb / presliding` [rad]
    relative_std: float = 0.1

    def scaled(self, level: float, shape: float) -> Friction:
        """Returns it with both levels, and with speed and deflection, times a factor each."""
        return replace(
            self,
            coulomb_nm=self.coulomb_nm * level,
            static_nm=self.static_nm * level,
            stribeck_rad_s=self.stribeck_rad_s * shape,
            presliding_rad=self.presliding_rad * shape,
        )


class Coefficients(NamedTuple):
    """Coefficients of a law, of one motor or of several in the last axis."""

    coulomb: FloatArray  # Coulomb level [N m]
    static: FloatArray  # Breakaway level [N m]
    stribeck: FloatArray  # Stribeck speed [rad/s]
    width: FloatArray  # The law's own width [rad or rad/s]

    def stribeck_curve(self, speed: FloatArray) -> FloatArray:
        """Level over the Coulomb level, `1 + (F_s / F_c - 1) exp(-(v / v_s)^2)`, in the speed's precision."""
        excess = np.divide(self.static, self.coulomb, out=np.ones_like(self.coulomb), where=self.coulomb > 0) - 1
        # In place: the compensation evaluates this over millions of samples.
        curve = np.asarray(speed / self.stribeck)
        curve *= -curve
        # Where nothing is left of it, before numbers become so small that processors take their time.
        np.maximum(curve, _VANISHED, out=curve)
        np.exp(curve, out=curve)
        curve *= excess
        curve += 1
        return curve


class Bristles(NamedTuple):
    """Friction with memory as the engine integrates it: LuGre's coefficients in the engine's order."""

    # Bristle stiffness [N m/rad], bristle damping [N m s/rad], Coulomb and breakaway level [N m], Stribeck speed
    # [rad/s]
    lugre: list[float]


class Ramps(NamedTuple):
    """Friction without memory as the engine evaluates it: `sum_k clip(slope_k v, -level_k, level_k)`."""

    slope: FloatArray  # (n_knot,) Slopes; negative where the curve bends upwards [N m s/rad]
    level: FloatArray  # (n_knot,) Where each ramp ends [N m]


@dataclass(frozen=True)
class FrictionLaw(ABC):
    """How the friction of a motor follows its motion."""

    name: str
    # Widths that are tried where nothing is known of a motor; none for a law that is the limit of another
    widths: tuple[float, ...] = ()
    step_limits: ClassVar[Mapping[str, float]]  # What one step of the integrator may be at most of each of its rates

    @abstractmethod
    def coefficients(self, friction: Friction) -> Coefficients:
        """Returns what the coefficients of a robot file are in this law."""

    @abstractmethod
    def periodic_torque(self, speed: FloatArray, step_s: float, coefficients: Coefficients) -> FloatArray:
        """Returns the torque (n_step, ..., n_motor) against one period of a motion, in its steady state [N m].

        Args:
            speed (n_step, ..., n_motor): Motor speeds [rad/s].
            step_s: Grid step [s].
            coefficients: Of the motors.
        """

    @abstractmethod
    def in_engine(self, friction: Friction) -> Bristles | Ramps:
        """Returns the form in which the engine has the law inside its integrator."""

    @abstractmethod
    def step_needs(
        self, coefficients: Coefficients, inertia: FloatArray, peak_speed: FloatArray, period_s: float
    ) -> dict[str, float]:
        """Returns how many integration steps a sample needs, by reason.

        Args:
            coefficients: Of the motors, not all of them without friction.
            inertia (n_motor,): Of their rotors [kg m^2].
            peak_speed (n_motor,): Highest speed that each is told [rad/s].
            period_s: The sample [s].
        """


@dataclass(frozen=True)
class LuGre(FrictionLaw):
    """LuGre without bristle damping; its width is the deflection at the Coulomb level [rad]."""

    step_limits: ClassVar[Mapping[str, float]] = {"bristle_rate": 2.0, "bristle_frequency": 0.1}

    def coefficients(self, friction: Friction) -> Coefficients:
        """Returns the coefficients as they are stated."""
        return _numbers(friction.coulomb_nm, friction.static_nm, friction.stribeck_rad_s, friction.presliding_rad)

    def periodic_torque(self, speed: FloatArray, step_s: float, coefficients: Coefficients) -> FloatArray:
        """Integrates `z' = v - |v| z / z_max(v)`, exactly for the mean speed of each step."""
        following = np.concatenate([speed[1:], speed[:1]])
        decay, drive = np.empty_like(speed), np.empty_like(speed)
        rows = max(1, _AT_ONCE // max(1, speed[0].size))
        for some in (slice(first, first + rows) for first in range(0, len(speed), rows)):
            decay[some], drive[some] = self._step(0.5 * (speed[some] + following[some]), step_s, coefficients)
        # sigma_0 = F_c / width: at constant speed the torque is then the Stribeck curve's level.
        return periodic_recurrence(decay, drive) * (coefficients.coulomb / coefficients.width)

    def _step(self, speed: FloatArray, step_s: float, coefficients: Coefficients) -> tuple[FloatArray, FloatArray]:
        """What a step of constant speed makes of a deflection z: `decay z + drive`.

        Over it z decays to sign(v) z_max by exp(-|v| h / z_max), z_max the deflection at which the bristle slips; that
        is a linear recurrence in z, whose periodic solution needs no transient.
        """
        limit = coefficients.stribeck_curve(speed)
        limit *= coefficients.width
        decay = np.abs(speed)
        decay *= -step_s
        decay /= limit
        np.exp(decay, out=decay)
        drive = np.copysign(limit, speed, out=limit)
        drive *= 1 - decay
        return decay, drive

    def in_engine(self, friction: Friction) -> Bristles:
        """Returns the engine's own LuGre."""
        stiffness = friction.coulomb_nm / friction.presliding_rad
        return Bristles([stiffness, 0.0, friction.coulomb_nm, friction.static_nm, friction.stribeck_rad_s])

    def step_needs(
        self, coefficients: Coefficients, inertia: FloatArray, peak_speed: FloatArray, period_s: float
    ) -> dict[str, float]:
        """Counts the bristles' rate, and their resonance with the rotors that resting bristles hold.

        The engine advances bristles apart from RK4 by the rate `|v| / presliding`, which may be 2 per step (motors stay
        below what they are told), and their torque comes half a step late. Resting bristles are springs `sigma_0` on
        the rotors, whose damping that takes `w_b h / 4` of critical, `w_b^2 = sigma_0 / J`: 2.5 % at the limit.
        """
        coulomb, width = coefficients.coulomb, coefficients.width
        rate = np.where(coulomb > 0, peak_speed / width, 0.0).max() * period_s
        resonance = np.sqrt(coulomb / width / inertia).max() * period_s
        return {
            "the bristles' rate": float(rate) / self.step_limits["bristle_rate"],
            "the bristles' resonance with the rotors": float(resonance) / self.step_limits["bristle_frequency"],
        }


@dataclass(frozen=True)
class Curve(FrictionLaw):
    """A law without memory: `tanh(v / width)` times the Stribeck curve; its width is a speed [rad/s]."""

    sign_share: float = SIGN_SHARE  # Width over the Stribeck speed of a robot file
    breaks_away: bool = True  # Whether the breakaway level is above the Coulomb level
    knots: int = 24  # Ramps of its polygon in the engine
    step_limits: ClassVar[Mapping[str, float]] = {"sign_rate": 1.0}

    def coefficients(self, friction: Friction) -> Coefficients:
        """Returns the stated levels and speed, and the share of that speed over which the sign changes."""
        static = friction.static_nm if self.breaks_away else friction.coulomb_nm
        return _numbers(friction.coulomb_nm, static, friction.stribeck_rad_s, self.sign_share * friction.stribeck_rad_s)

    def curve(self, friction: Friction, speed: FloatArray) -> FloatArray:
        """Returns the torque of a robot file's coefficients at some speeds of any shape [N m]."""
        relative, static = speed / friction.stribeck_rad_s, float(self.coefficients(friction).static)
        level = friction.coulomb_nm + (static - friction.coulomb_nm) * np.exp(-(relative**2))
        return np.asarray(level * np.tanh(relative / self.sign_share))

    def periodic_torque(self, speed: FloatArray, _step_s: float, coefficients: Coefficients) -> FloatArray:
        """Evaluates the curve."""
        level = coefficients.coulomb * np.tanh(speed / coefficients.width)
        return np.asarray(level * coefficients.stribeck_curve(speed))

    def in_engine(self, friction: Friction) -> Ramps:
        """Returns a polygon whose knots lie as densely as the root of the curvature asks.

        It is within 0.3 % of the breakaway level of the curve.
        """
        speed = friction.stribeck_rad_s * np.linspace(0.0, _REACH, _FINE) ** 2 / _REACH
        curve = self.curve(friction, speed)
        # The grid is finest at rest, where this second difference rounds: another form of the same curve moves knots.
        # A chord over a knot spacing d misses the curve by f'' d^2 / 8: alike everywhere if d ~ 1 / sqrt(f'').
        bend = np.sqrt(np.abs(np.gradient(np.gradient(curve, speed), speed)))
        share = np.concatenate([[0.0], np.cumsum(0.5 * (bend[1:] + bend[:-1]) * np.diff(speed))])
        knots = np.interp(np.linspace(0.0, share[-1], self.knots + 1), share, speed)
        values = self.curve(friction, knots)
        values[-1] = friction.coulomb_nm
        # Each ramp ends at its own knot, so that its slope is what the polygon's slope loses there.
        slope = np.append(np.diff(values) / np.diff(knots), 0.0)
        change = slope[:-1] - slope[1:]
        return Ramps(change, np.abs(change) * knots[1:])

    def step_needs(
        self, coefficients: Coefficients, inertia: FloatArray, _peak_speed: FloatArray, period_s: float
    ) -> dict[str, float]:
        """Counts the rate of the steepest slope, at rest, over the rotors' inertias."""
        slope = coefficients.static / coefficients.width
        rate = float((slope / inertia).max()) * period_s
        return {"the friction's jump at reversals": rate / self.step_limits["sign_rate"]}


LUGRE = LuGre("lugre", widths=(0.005, 0.02, 0.08, 0.3))
LAWS: dict[str, FrictionLaw] = {
    law.name: law
    for law in (
        LUGRE,
        Curve("tanh", sign_share=1.0, breaks_away=False, knots=16),
        Curve("stribeck", widths=(0.1, 0.4, 1.6, 6.4)),
    )
}


class Coordinate(NamedTuple):
    """A number in which the identification of a law moves."""

    name: str
    prior_std: float  # Standard deviation about its start of what is believed beforehand
    largest_step: float  # What one iteration moves it at most


COORDINATES = (
    Coordinate("Coulomb level [N m]", np.inf, np.inf),
    Coordinate("excess of breakaway over the Coulomb level", 0.5, 0.5),
    Coordinate("logarithm of the Stribeck speed", 1.0, 0.5),
    Coordinate("logarithm of the width", 2.0, 0.7),
    Coordinate("lag [samples]", 1.0, 1.0),
    Coordinate("ripple's sine over its amplitude", 3.0, np.inf),
    Coordinate("ripple's cosine over its amplitude", 3.0, np.inf),
)
LEVEL, EXCESS, STRIBECK, WIDTH, LAG, SINE, COSINE = range(len(COORDINATES))


@dataclass(frozen=True)
class TorqueLaw:
    """Torque nonlinearities of one motor and how well they are known."""

    coulomb_nm: float  # Coulomb level [N m]
    static_nm: float  # Breakaway level [N m]
    stribeck_rad_s: float  # Stribeck speed [rad/s]
    width: float  # Width of the law, such as LuGre's deflection [rad] or the speed of a smoothed sign [rad/s]
    relative_std: float  # Standard deviation of the relative error of levels and of speeds and deflections
    ripple_nm: float  # Amplitude of the torque ripple [N m]
    ripple_order: int
    law: FrictionLaw = field(default=LUGRE)
    lag_samples: float = 0.0  # Known lag of the friction behind the motion [samples]
    # Known part of the ripple that opposes the motion with the sine of its order, over its amplitude
    ripple_sin: float = 0.0
    ripple_cos: float = 0.0
    offset: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0, 0.0)  # How far each of `KINDS` is from the robot file's
    # Standard deviations of the values in `VALUES` where they were identified; None otherwise
    identified_std: tuple[float, ...] | None = None
    # Half of what viscous friction is larger forward than backward: a torque per size of the speed, which no linear
    # model has [N m s/rad]
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
        # sin and cos of a phase that is uniform over the turn have the variance 1/2.
        ripple = float(np.sqrt(0.5)) * float(self.ripple_nm > 0)
        return (friction * self.relative_std, friction * self.relative_std, friction * _LAG_STD, ripple, ripple)

    @property
    def values(self) -> tuple[float, ...]:
        """The values in `VALUES`."""
        return tuple(float(getattr(self, name)) for name in VALUES)

    @property
    def values_std(self) -> tuple[float, ...]:
        """Their standard deviations."""
        if self.identified_std is not None:
            return self.identified_std
        relative = [self.relative_std * value for value in self.values[:4]]
        return (*relative, *self.coefficient_std[2:])

    @property
    def coordinates(self) -> FloatArray:
        """Where a law with friction is, in `COORDINATES`."""
        coulomb, static, stribeck, width, *others = self.values
        return np.array([coulomb, static / coulomb - 1, np.log(stribeck), np.log(width), *others])

    def at(self, coordinates: FloatArray) -> TorqueLaw:
        """Returns a law of the same kind at other coordinates."""
        coulomb, excess, stribeck, width, *others = coordinates.tolist()
        values = (coulomb, coulomb * (1 + excess), float(np.exp(stribeck)), float(np.exp(width)), *others)
        return replace(self, **dict(zip(VALUES, values, strict=True)))

    def deviating(self, std: FloatArray) -> TorqueLaw:
        """Returns the law with standard deviations of its coordinates (7,), to first order those of its values."""
        excess = self.static_nm / self.coulomb_nm - 1
        # Both terms of d(F_c (1 + excess)), taken as independent; of a logarithm, d exp(x) = exp(x) dx.
        static = np.hypot(std[LEVEL] * (1 + excess), self.coulomb_nm * std[EXCESS])
        shape = (std[STRIBECK] * self.stribeck_rad_s, std[WIDTH] * self.width)
        found = (std[LEVEL], static, *shape, std[LAG], *(std[SINE:] * (self.ripple_nm > 0)))
        return replace(self, identified_std=tuple(float(value) for value in found))

    def shaped(self, factor: float) -> TorqueLaw:
        """Returns the law with its speed and its width times a factor."""
        return replace(self, stribeck_rad_s=self.stribeck_rad_s * factor, width=self.width * factor)

    def silenced(self) -> TorqueLaw:
        """Returns the law without friction and ripple."""
        return replace(self, coulomb_nm=0.0, static_nm=0.0, ripple_nm=0.0)


_Levels = TypeVar("_Levels", Friction, TorqueLaw)


def with_level(law: _Levels, coulomb_nm: float) -> _Levels:
    """Returns friction of another Coulomb level; breakaway keeps its ratio to it and is never below."""
    ratio = max(law.static_nm / law.coulomb_nm, 1.0) if law.coulomb_nm > 0 else 1.0
    return replace(law, coulomb_nm=coulomb_nm, static_nm=ratio * coulomb_nm)


def friction_torque(speed: FloatArray, step_s: float, laws: Sequence[TorqueLaw]) -> FloatArray:
    """Friction against one period of a motion in the periodic steady state, of its shape; no lag, no ripple [N m].

    Args:
        speed (n_step, ..., n_motor): One period of the motor speed [rad/s].
        step_s: Grid step [s].
        laws: One law per motor.
    """
    kinds = {one.law.name: one.law for one in laws}
    # Coefficients of every signal, so that no inner loop ends at the motors.
    signals = speed.reshape(len(speed), -1)
    each = np.tile(np.arange(len(laws)), signals.shape[1] // len(laws))
    stacked = [_stacked(laws, value, speed.dtype)[each] for value in VALUES[:4]]
    torque = np.empty_like(signals)
    # Motors of one law at once: a loop over motors would be slower than the mathematics.
    for name, law in kinds.items():
        chosen = np.array([one.law.name == name for one in laws])[each]
        if len(kinds) == 1:
            torque = law.periodic_torque(signals, step_s, Coefficients(*stacked))
        else:
            some = Coefficients(*(value[chosen] for value in stacked))
            torque[:, chosen] = law.periodic_torque(signals[:, chosen], step_s, some)
    uneven = _stacked(laws, "uneven_nms_rad", speed.dtype)[each]
    return (torque + uneven * np.abs(signals) if uneven.any() else torque).reshape(speed.shape)


def stacked_coefficients(law: FrictionLaw, frictions: Sequence[Friction]) -> Coefficients:
    """Returns the coefficients of several motors in a law, each (n_motor,)."""
    columns = zip(*(law.coefficients(friction) for friction in frictions), strict=True)
    return Coefficients(*(np.array(column) for column in columns))


def periodic_recurrence(decay: FloatArray, drive: FloatArray) -> FloatArray:
    """Solves `z[k+1] = decay[k] z[k] + drive[k]` for the z that repeats.

    Args:
        decay (n_step, ...): Factors from 0 to 1, not all of them 1.
        drive (n_step, ...): Additions.

    Returns:
        z of the same shape; 0 at the start where the factors' product is 1.
    """
    # As many stretches as divide the period evenly: they run side by side in one vectorised loop.
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
    # z_end = product z_start + start after all stretches; z_end = z_start.
    for one_gain, one_total in zip(gain, total, strict=True):
        start, product = one_gain * start + one_total, product * one_gain
    return np.divide(start, 1 - product, out=np.zeros_like(start), where=product < 1)


def _numbers(*values: float) -> Coefficients:
    return Coefficients(*(np.array(value) for value in values))


def _stacked(laws: Sequence[TorqueLaw], name: str, dtype: DTypeLike) -> FloatArray:
    return np.array([getattr(law, name) for law in laws], dtype)
