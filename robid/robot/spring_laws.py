"""Springs that are no constants: stiffness over a joint's position, dampers over the load, hysteresis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.robot.description import Spring, StiffnessLaw

_LEAST_SLIP = 1e-3  # of the first one tabulated: less slip is none
_STEP = 1e-4  # of an amount, relative


@dataclass(frozen=True)
class BristleTable:
    """What a hysteresis does under the motion of a measurement, by the deflection at which it slips.

    To a moving gear it is a spring in series with a damper: it adds `k_b g jw / (jw + w_h)` to its stiffness.
    """

    stiffness: float  # Stiffness of the bristles while they stick [N m/rad, or N/m]
    log_slip: FloatArray  # (n_slip,) Logarithms of the deflections at which they slip [rad, or m]
    log_gain: FloatArray  # (n_slip, n_conf) Logarithms of `g`
    log_corner: FloatArray  # (n_slip, n_conf) Logarithms of `w_h` [rad/s]
    swing: float  # Swing of the gear, root mean square over the configurations [rad, or m]
    known: float = 0.0  # Torque at which they are known to slip, which amounts add to [N m, or N]

    def added(self, torque: float, omega: FloatArray) -> ComplexArray:
        """What bristles that slip at a torque add (n_conf, n_freq), odd in that torque."""
        least = _LEAST_SLIP * np.exp(self.log_slip[0])
        slip = max(abs(torque) / self.stiffness, least)
        # Maxwell element: stiffness g k_b above its corner frequency w_h, damper below.
        gain, corner = np.exp(self._laws(np.log(slip)))[..., None]
        # Below the least slip, which does nothing, the effect fades in proportion.
        share = float(np.clip(torque / self.stiffness / least, -1.0, 1.0))
        return np.asarray(share * self.stiffness * gain * 1j * omega / (1j * omega + corner))

    def slope(self, torque: float, omega: FloatArray) -> ComplexArray:
        """Derivative (n_conf, n_freq) of that by the torque."""
        # No closed form: the table's laws are splines in the logarithm of the slip.
        step = _STEP * max(abs(torque), _LEAST_SLIP * np.exp(self.log_slip[0]) * self.stiffness)
        return np.asarray((self.added(torque + step, omega) - self.added(torque - step, omega)) / (2 * step))

    def _laws(self, log_slip: float) -> FloatArray:
        """Logarithms (2, n_conf) of gain and corner; power laws beyond the table."""
        inside = float(np.clip(log_slip, self.log_slip[0], self.log_slip[-1]))
        beyond = log_slip - inside
        return np.asarray(self._spline(inside) + (beyond * self._spline(inside, 1) if beyond else 0.0))

    @cached_property
    def _spline(self) -> CubicSpline:
        return CubicSpline(self.log_slip, np.stack([self.log_gain, self.log_corner], axis=1))


@dataclass(frozen=True)
class GearEffects:
    """Effects whose sizes are nuisance parameters of a fit, under the motion of a measurement."""

    load: FloatArray  # (n_conf, n_spring) Mean size of each deflection, swing included [rad, or m]
    damped: IntArray  # (n_damped, 2) Nuisance and spring of each damper that grows; amounts are shares per deflection
    slipping: (
        IntArray  # (n_slipping, 2) Nuisance and spring of each hysteresis; amounts add to the known torque of slip
    )
    bristles: tuple[BristleTable, ...]  # (n_slipping) What each of them does
    damped_names: tuple[str, ...] = ()  # (n_damped) Names of those of dampers
    slipping_names: tuple[str, ...] = ()  # (n_slipping) Names of those of hysteresis

    def growth(self, amounts: FloatArray) -> FloatArray:
        """Dampers (n_conf, n_spring) over those without load, by amounts (n_nuisance,) of all nuisance parameters.

        Under a normal swing `d (1 + a |x|) dx/dt` is linearised to `d (1 + a E|x|) dx/dt`: deflection and speed do not
        correlate.
        """
        grown = np.ones_like(self.load)
        for row, spring in self.damped.tolist():
            grown[:, spring] += amounts[row] * self.load[:, spring]
        return grown

    def stiffness(self, amounts: FloatArray, omega: FloatArray) -> ComplexArray:
        """What bristles add to the springs (n_conf, n_freq, n_spring) at angular frequencies (n_freq,)."""
        added = np.zeros((len(self.load), omega.size, self.load.shape[1]), complex)
        for (row, spring), bristle in zip(self.slipping.tolist(), self.bristles, strict=True):
            added[..., spring] = bristle.added(bristle.known + float(amounts[row]), omega)
        return added

    def slopes(self, amounts: FloatArray, damping: FloatArray, omega: FloatArray) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_spring, n_nuisance) of the springs' dynamic stiffness by all nuisances.

        Args:
            amounts (n_nuisance,): Amounts.
            damping (n_spring,): Dampers without load.
            omega (n_freq,): Angular frequencies [rad/s].
        """
        found = np.zeros((len(self.load), omega.size, self.load.shape[1], amounts.size), complex)
        for row, spring in self.damped.tolist():
            # d(j w d (1 + a l)) / da = j w d l.
            found[:, :, spring, row] = 1j * omega * damping[spring] * self.load[:, spring, None]
        for (row, spring), bristle in zip(self.slipping.tolist(), self.bristles, strict=True):
            found[:, :, spring, row] = bristle.slope(bristle.known + float(amounts[row]), omega)
        return found


@dataclass(frozen=True)
class Factor:
    """What a law multiplies a spring's torque by, and its derivatives by the joint's position."""

    value: FloatArray  # (...,) The factor
    slope: FloatArray  # (...,) Its first derivative [1/rad, or 1/m]
    curvature: FloatArray  # (...,) Its second derivative [1/rad^2, or 1/m^2]


class LawFactor:
    """Evaluates one law again and again.

    A table is interpolated by monotone cubics, which never overshoot (Fritsch and Carlson 1980), and held beyond its
    ends.

    Args:
        law: The law.
    """

    def __init__(self, law: StiffnessLaw) -> None:
        self._form = law.form
        if law.form == "table":
            table = PchipInterpolator(law.positions, law.values)
            self._pieces, self._table = np.asarray(table.c), law.positions
        else:
            slope = _derived(law.values)
            self._parts = law.values, slope, _derived(slope)

    def value(self, position: FloatArray) -> FloatArray:
        """Returns the factor (...,) at some positions (...,) [rad, or m]."""
        return self.rise(position)[0]

    def rise(self, position: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Returns the factor and its slope (...,) at some positions (...,) [rad, or m]."""
        if self._form == "table":
            return self._tabulated(position)[:2]
        value, slope = _sum(self._parts[0], position), _sum(self._parts[1], position)
        if self._form == "stiffness":
            return value, slope
        factor = 1 / value
        return factor, -slope * factor * factor

    def whole(self, position: FloatArray) -> Factor:
        """Returns the factor with its derivatives at some positions (...,) [rad, or m]."""
        if self._form == "table":
            return Factor(*self._tabulated(position))
        curvature = _sum(self._parts[2], position)
        factor, slope = self.rise(position)
        if self._form == "compliance":
            # (1/c)'' = 2 c'^2 / c^3 - c'' / c^2, with f = 1/c and f' = -c' / c^2.
            curvature = 2 * slope * slope / factor - curvature * factor * factor
        return Factor(factor, slope, curvature)

    def _tabulated(self, position: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        inside = np.clip(position, self._table[0], self._table[-1])
        # The piece of the cubic that each position is in; beyond the ends the value is held and slopes are zero.
        piece = np.clip(np.searchsorted(self._table, inside, side="right") - 1, 0, self._table.size - 2)
        x, (a, b, c, d) = inside - self._table[piece], self._pieces[:, piece]
        within = inside == position
        value = ((a * x + b) * x + c) * x + d
        return value, within * ((3 * a * x + 2 * b) * x + c), within * (6 * a * x + 2 * b)


def _derived(coefficients: FloatArray) -> FloatArray:
    """Coefficients of a polynomial's derivative, constant first."""
    return coefficients[1:] * np.arange(1, coefficients.size) if coefficients.size > 1 else np.zeros(1)


def _sum(coefficients: FloatArray, position: FloatArray) -> FloatArray:
    """Value of a polynomial, constant first, by Horner's rule."""
    if coefficients.size == 1:
        return np.full(np.shape(position), coefficients[0])
    value = coefficients[-1] * position + coefficients[-2]
    for coefficient in coefficients[-3::-1] if coefficients.size > 2 else ():
        value = value * position + coefficient
    return np.asarray(value)


class VaryingSprings:
    """The springs of a robot whose stiffness depends on a joint's position.

    Such a spring holds the energy `f(p) U(d)`, with `U` that of the spring alone: its torque is `f U'`, and the
    joint feels `f' U` besides.

    Args:
        springs: All springs of the robot.
        arm (n_joint,): Index of each joint's arm position among the coordinates.
    """

    def __init__(self, springs: Sequence[Spring], arm: IntArray) -> None:
        laws = [(index, spring.stiffness_over) for index, spring in enumerate(springs)]
        pairs = [(index, law) for index, law in laws if law is not None]
        self.count = len(springs)
        self.indices = np.array([index for index, _ in pairs], int)
        self.scheduled = np.array([arm[law.joint] for _, law in pairs], int)
        self.laws = [LawFactor(law) for _, law in pairs]

    def __bool__(self) -> bool:
        return bool(self.laws)

    def factors(self, position: FloatArray) -> FloatArray:
        """Returns the factor (..., n_spring) of every spring where coordinates (..., n_dof) are."""
        found = np.ones((*position.shape[:-1], self.count))
        for index, place, law in zip(self.indices, self.scheduled, self.laws, strict=True):
            found[..., index] = law.value(position[..., place])
        return found

    def load(self, position: FloatArray, energy: FloatArray) -> FloatArray:
        """What coordinates (n_dof,) feel besides the springs' torques: the gradient `f' U` [N m, or N].

        Args:
            position (n_dof,): Coordinates [rad, or m].
            energy (n_spring,): Energy `U` of each spring without its factor [J].
        """
        found = np.zeros_like(position)
        for index, place, law in zip(self.indices, self.scheduled, self.laws, strict=True):
            found[place] += law.whole(position[place]).slope * energy[index]
        return found

    def gradient(
        self, position: FloatArray, energy: FloatArray, torque: FloatArray, deflection: FloatArray
    ) -> FloatArray:
        """Hessian (n_dof, n_dof) of the energies less the springs' own: `f'' U`, and `f' U'` with the deflection.

        Args:
            position (n_dof,): Coordinates [rad, or m].
            energy (n_spring,): Energy `U` of each spring without its factor [J].
            torque (n_spring,): Its derivative `U'` [N m, or N].
            deflection (n_spring, n_dof): Deflection per coordinate.
        """
        found = np.zeros((position.size, position.size))
        for index, place, law in zip(self.indices, self.scheduled, self.laws, strict=True):
            factor = law.whole(position[place])
            # d^2 (f U) / dp dq = f' U' dd/dq; the diagonal in p takes f'' U, and both orders of p and q count.
            across = factor.slope * torque[index] * deflection[index]
            found[place, place] += factor.curvature * energy[index]
            found[place] += across
            found[:, place] += across
        return found
