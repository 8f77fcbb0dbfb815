"""Counterbalances, and what they do to an arm: harmonics of its angle, springs and gas cylinders between two points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError


@dataclass(frozen=True)
class HarmonicBalance:
    """A counterbalance whose torque on the arm is `sum_k sine_k sin(k q) + cosine_k cos(k q)` of the joint's angle."""

    sine_nm: FloatArray  # (n_harmonic,) Sine coefficients, the first one of the angle itself [N m]
    cosine_nm: FloatArray  # (n_harmonic,) Cosine coefficients [N m]


@dataclass(frozen=True)
class _BetweenPoints:
    """What pulls two points towards each other, one on the link and one on what carries the joint."""

    carrier_point_m: FloatArray  # (3,) Its end on what carries the joint, in the joint frame at zero position [m]
    link_point_m: FloatArray  # (3,) Its end on the link, in the joint frame [m]
    free_length_m: float  # Length from which its stretch counts [m]


@dataclass(frozen=True)
class SpringBalance(_BetweenPoints):
    """A counterbalance by a spring between two points."""

    stiffness_n_m: float  # Stiffness [N/m]
    preload_n: float = 0.0  # Pull at the free length; negative where it pushes [N]

    def pull(self, length: FloatArray) -> FloatArray:
        """Returns the force (...,) with which it pulls at some lengths (...,) [N]."""
        return np.asarray(self.stiffness_n_m * (length - self.free_length_m) + self.preload_n)

    def rate(self, length: FloatArray) -> FloatArray:
        """Returns the derivative (...,) of the force by the length (...,) [N/m]."""
        return np.full_like(length, self.stiffness_n_m)


@dataclass(frozen=True)
class GasBalance(_BetweenPoints):
    """A counterbalance by the gas in a cylinder between two points, whose piston squeezes it as it is drawn out.

    Stretched by `x` it pulls with `p_0 A (V_0 / (V_0 - A x))^n`. An exponent of 1 is gas that stays as warm as it is,
    of 1.4 nitrogen that is moved too fast to give off heat. With a negative area the gas drives the piston out, and
    expands as the points move apart.
    """

    area_m2: float  # Area of the piston on which the gas presses; negative where it pushes the points apart [m^2]
    rest_pressure_pa: float  # Pressure at the free length, over that of the surroundings [Pa]
    rest_volume_m3: float  # Volume of the gas at the free length [m^3]
    exponent: float  # Polytropic exponent

    def volume(self, length: FloatArray) -> FloatArray:
        """Returns the volume of the gas (...,) at some lengths (...,) [m^3]."""
        return np.asarray(self.rest_volume_m3 - self.area_m2 * (length - self.free_length_m))

    def per_pressure(self, length: FloatArray) -> FloatArray:
        """Returns the force (...,) at some lengths (...,) for each unit of the rest pressure [m^2].

        Raises:
            DataError: If the gas would have no volume.
        """
        volume = self.volume(length)
        if not volume.min(initial=np.inf) > 0:
            raise DataError(
                "D410 the motion draws a counterbalance's gas cylinder out until its gas has no volume left",
                where="counterbalance",
                remedy="correct its points, `free_length_m`, `area_m2` or `rest_volume_m3`, or the zero of its joint",
            )
        # p V^n stays what it is.
        return np.asarray(self.area_m2 * (self.rest_volume_m3 / volume) ** self.exponent)

    def pull(self, length: FloatArray) -> FloatArray:
        """Returns the force (...,) with which it pulls at some lengths (...,) [N]."""
        return np.asarray(self.rest_pressure_pa * self.per_pressure(length))

    def rate(self, length: FloatArray) -> FloatArray:
        """Returns the derivative (...,) of the force by the length (...,) [N/m]."""
        return np.asarray(self.exponent * self.area_m2 * self.pull(length) / self.volume(length))


PointBalance: TypeAlias = SpringBalance | GasBalance
Counterbalance: TypeAlias = HarmonicBalance | SpringBalance | GasBalance


def balance_torque(balance: Counterbalance, position: FloatArray, *, slides: bool) -> FloatArray:
    """Returns the torque on the arm (...,) at positions of the joint (...,) [N m, or N].

    Args:
        balance: The counterbalance.
        position (...,): Positions [rad, or m].
        slides: Whether the joint slides along its axis instead of turning about it.
    """
    if isinstance(balance, HarmonicBalance):
        angle, _ = _harmonics(balance, position)
        return np.asarray(np.sin(angle) @ balance.sine_nm + np.cos(angle) @ balance.cosine_nm)
    length, lever, _ = stretch(balance, position, slides=slides)
    # Virtual work: what pulls two points together does -F dl.
    return np.asarray(-balance.pull(length) * lever)


def balance_slope(balance: Counterbalance, position: FloatArray, *, slides: bool) -> FloatArray:
    """Returns that torque's derivative (...,) by the position (...,) [N m/rad, or N/m]; arguments as above."""
    if isinstance(balance, HarmonicBalance):
        angle, orders = _harmonics(balance, position)
        return np.asarray(np.cos(angle) @ (orders * balance.sine_nm) - np.sin(angle) @ (orders * balance.cosine_nm))
    length, lever, bend = stretch(balance, position, slides=slides)
    # d(F l')/dq = F' l'^2 + F l''.
    return np.asarray(-balance.rate(length) * lever**2 - balance.pull(length) * bend)


def _harmonics(balance: HarmonicBalance, position: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Multiples (..., n_harmonic) of the angle, the first one of gravity on the balanced link, and their orders."""
    orders = np.arange(1.0, len(balance.sine_nm) + 1)
    return np.asarray(position)[..., None] * orders, orders


def stretch(balance: PointBalance, position: FloatArray, *, slides: bool) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Returns the distance of the points, and its first two derivatives by the joint's position.

    Args:
        balance: What lies between the points.
        position (...,): Positions [rad, or m].
        slides: Whether the joint slides along its axis instead of turning about it.

    Returns:
        Length (...,) [m], lever arm (...,) [m/rad, or 1] and its derivative (...,) [m/rad^2, or 1/m].
    """
    x, y, z = balance.link_point_m
    none = np.zeros_like(position, float)
    if slides:
        moved = np.stack([x + none, y + none, z + position])
        speed, turn = np.stack([none, none, none + 1]), np.zeros_like(moved)
    else:
        cosine, sine = np.cos(position), np.sin(position)
        moved = np.stack([cosine * x - sine * y, sine * x + cosine * y, z + none])
        speed, turn = np.stack([-moved[1], moved[0], none]), np.stack([-moved[0], -moved[1], none])
    apart = np.moveaxis(np.moveaxis(moved, 0, -1) - balance.carrier_point_m, -1, 0)
    length = np.sqrt((apart**2).sum(axis=0))
    # l = |r|: l' = r.r' / l, l'' = (r'.r' + r.r'' - l'^2) / l.
    lever = (apart * speed).sum(axis=0) / length
    bend = ((speed**2).sum(axis=0) + (apart * turn).sum(axis=0) - lever**2) / length
    return np.asarray(length), np.asarray(lever), np.asarray(bend)
