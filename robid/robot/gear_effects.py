"""What transmissions do beside springs and dampers: dampers that grow with the load, and hysteresis."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from robid.arrays import ComplexArray, FloatArray, IntArray

_LEAST_SLIP = 1e-3  # of the first one tabulated: less slip is none
_STEP = 1e-4  # of an amount, relative


@dataclass(frozen=True)
class BristleTable:
    """What a hysteresis does under the motion of a measurement, by the deflection at which it slips.

    To a moving gear it is a spring in series with a damper: it adds `k_b g jw / (jw + w_h)` to its stiffness.

    Attributes:
        stiffness: Stiffness of the bristles while they stick [N m/rad, or N/m].
        log_slip (n_slip,): Logarithms of the deflections at which they slip [rad, or m].
        log_gain (n_slip, n_conf): Logarithms of `g`.
        log_corner (n_slip, n_conf): Logarithms of `w_h` [rad/s].
        swing: Swing of the gear, root mean square over the configurations [rad, or m].
    """

    stiffness: float
    log_slip: FloatArray
    log_gain: FloatArray
    log_corner: FloatArray
    swing: float

    def added(self, torque: float, omega: FloatArray) -> ComplexArray:
        """What bristles that slip at a torque add (n_conf, n_freq), odd in that torque."""
        least = _LEAST_SLIP * np.exp(self.log_slip[0])
        slip = max(abs(torque) / self.stiffness, least)
        gain, corner = np.exp(self._laws(np.log(slip)))[..., None]
        # Below the least slip, which does nothing, the effect fades in proportion.
        share = float(np.clip(torque / self.stiffness / least, -1.0, 1.0))
        return np.asarray(share * self.stiffness * gain * 1j * omega / (1j * omega + corner))

    def slope(self, torque: float, omega: FloatArray) -> ComplexArray:
        """Derivative (n_conf, n_freq) of that by the torque."""
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
    """Effects whose sizes are doubts that a fit estimates, under the motion of a measurement.

    Attributes:
        load (n_conf, n_spring): Mean size of each deflection, swing included [rad, or m].
        damped (n_damped, 2): Doubt and spring of each damper that grows; amounts are shares per deflection.
        slipping (n_slipping, 2): Doubt and spring of each hysteresis; amounts are torques at which bristles slip.
        bristles (n_slipping): What each of them does.
        damped_names (n_damped): Names of the doubts of dampers.
        slipping_names (n_slipping): Names of those of hysteresis.
    """

    load: FloatArray
    damped: IntArray
    slipping: IntArray
    bristles: tuple[BristleTable, ...]
    damped_names: tuple[str, ...] = ()
    slipping_names: tuple[str, ...] = ()

    def growth(self, doubt: FloatArray) -> FloatArray:
        """Dampers (n_conf, n_spring) over those without load, by amounts (n_doubt,) of all doubts.

        Under a normal swing `d (1 + a |x|) dx/dt` is linearised to `d (1 + a E|x|) dx/dt`: deflection and speed do not
        correlate.
        """
        grown = np.ones_like(self.load)
        for row, spring in self.damped.tolist():
            grown[:, spring] += doubt[row] * self.load[:, spring]
        return grown

    def stiffness(self, doubt: FloatArray, omega: FloatArray) -> ComplexArray:
        """What bristles add to the springs (n_conf, n_freq, n_spring) at angular frequencies (n_freq,)."""
        added = np.zeros((len(self.load), omega.size, self.load.shape[1]), complex)
        for (row, spring), bristle in zip(self.slipping.tolist(), self.bristles, strict=True):
            added[..., spring] = bristle.added(float(doubt[row]), omega)
        return added

    def slopes(self, doubt: FloatArray, damping: FloatArray, omega: FloatArray) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_spring, n_doubt) of the springs' dynamic stiffness by all doubts.

        Args:
            doubt (n_doubt,): Amounts.
            damping (n_spring,): Dampers without load.
            omega (n_freq,): Angular frequencies [rad/s].
        """
        found = np.zeros((len(self.load), omega.size, self.load.shape[1], doubt.size), complex)
        for row, spring in self.damped.tolist():
            found[:, :, spring, row] = 1j * omega * damping[spring] * self.load[:, spring, None]
        for (row, spring), bristle in zip(self.slipping.tolist(), self.bristles, strict=True):
            found[:, :, spring, row] = bristle.slope(float(doubt[row]), omega)
        return found
