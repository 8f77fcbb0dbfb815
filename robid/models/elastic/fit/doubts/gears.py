"""Doubts of gears: hysteresis, and stiffness that depends on the load."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.elastic.fit.doubts.column import DoubtColumn
from robid.models.elastic.fit.doubts.gear_kinds import HYSTERESIS
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Robot

if TYPE_CHECKING:
    from robid.models.elastic.fit.doubts.scene import Scene

_PERCENT = 100.0
_MEAN_SIZE = np.sqrt(2 / np.pi)  # of a normal variable, over its deviation
NO_LOAD_RAD = 1e-9
"""Difference of deflections below which loads are alike [rad]."""
_SLIPS = {"early": 0.5, "late": 2.0, "never": 1e3}  # over the swing: early ones mostly lose, late ones stiffen


@dataclass(frozen=True)
class Hysteresis:
    """A bristle beside a gear, amounts in percent of loss factor where it loses most.

    A bristle that slips at a deflection `h` obeys `dz/dt = dx/dt - |dx/dt| z / h`. Under a normal motion whose speed
    has the deviation `v` it does as a spring in series with a damper: its torque goes with `g jw / (jw + w_h)` times
    the deflection, with the corner `w_h = sqrt(2 / pi) v / h` and a gain `g` below one. It stiffens what moves little
    or fast, and loses most at the corner, half as much. It does most harm where it slips at about the swing, the
    deflection's root mean square over the configurations, as predicted from the measured torques.

    Attributes:
        spring: Index of the gear.
        slip: Where it slips, over the swing.

    Source:
        Dahl (1968); statistical linearisation as in Roberts and Spanos (1990), ch. 8; docs/methods, sec. 1.
    """

    spring: int
    slip: float

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        return np.asarray(self.share(scene)[:, :, None, None] * scene.stiffness_slopes[..., self.spring])

    def share(self, scene: Scene) -> ComplexArray:
        """What an amount of one adds to the gear's stiffness (n_conf, n_freq), over it."""
        omega = 2 * np.pi * scene.problem.frf.frequency_hz
        return 2 / _PERCENT * bristle_share(omega, scene.swing[:, :, self.spring], self.slip)


def bristle_share(omega: FloatArray, swing: FloatArray, relative_slip: float) -> ComplexArray:
    """What bristles add to a spring, over their stiffness times their mean gain, as `Hysteresis` says.

    Args:
        omega (n_freq,): Angular frequencies [rad/s].
        swing (n_conf, n_freq): Mean square deflection at each line; where all are zero, motion is taken to be alike.
        relative_slip: Deflection at which they slip over the root mean square one.

    Returns:
        Shares (n_conf, n_freq).
    """
    if not swing.any():
        return np.broadcast_to(1j * omega / (1j * omega + np.exp(np.log(omega).mean()) / relative_slip), swing.shape)
    slip = relative_slip * np.sqrt(swing.sum(axis=1).mean())
    power = omega**2 * swing
    speed = np.sqrt(power.sum(axis=1, keepdims=True))
    corner = _MEAN_SIZE * speed / slip
    pulled = (power * corner / (omega**2 + corner**2)).sum(axis=1, keepdims=True)
    gain = 1 / (1 + _MEAN_SIZE * pulled / (np.maximum(speed, np.finfo(float).tiny) * slip))
    return np.asarray(gain / gain.mean() * 1j * omega / (1j * omega + corner))


@dataclass(frozen=True)
class LoadStiffness:
    """A gear that is stiffer by some percent at the largest of its loads than at their mean.

    Attributes:
        spring: Index of the gear.
    """

    spring: int

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount; zero where loads are alike."""
        return np.asarray(self.share(scene)[:, :, None, None] * scene.stiffness_slopes[..., self.spring])

    def share(self, scene: Scene) -> ComplexArray:
        """What an amount of one adds to the gear's stiffness (n_conf, 1), over it."""
        load = np.abs(scene.problem.model.rest.deflection[:, self.spring])
        spread = load - load.mean()
        most = np.abs(spread).max()
        share = spread / most if most > NO_LOAD_RAD else np.zeros_like(spread)
        return np.asarray(share[:, None] / _PERCENT, complex)


def gear_doubts(robot: Robot, options: ElasticOptions) -> Iterator[DoubtColumn]:
    """Yields the doubts of the transmissions."""
    for index, spring in enumerate(robot.springs):
        doubts = robot.joints[spring.joint].doubts
        if spring.place != "transmission":
            continue
        if doubts.loss_factor > 0:
            yield from _hysteresis(spring.name, index, _PERCENT * doubts.loss_factor)
        cubic = f"{spring.name}.cubic"
        if doubts.load_stiffness > 0 and not options.estimates("cubic", cubic):
            std, names = (
                _PERCENT * doubts.load_stiffness,
                (
                    f"{spring.name}.load_stiffness",
                    f"stiffness of {spring.name} by its load",
                ),
            )
            yield DoubtColumn(*names, "gear_nonlinearity", "%", std, 0.0, LoadStiffness(index), -_PERCENT, _PERCENT)


def bristle_names(name: str) -> tuple[str, ...]:
    """Names of the bristles that a hysteresis of some name stands for once a fit estimates it; none for other names."""
    gear, _, kind = name.rpartition(".")
    return tuple(f"{gear}.hysteresis_{when}" for when in _SLIPS) if kind == HYSTERESIS else ()


def slipping_name(doubt: DoubtColumn) -> str | None:
    """Name of what frees a hysteresis that a doubt stands for; None of other doubts, and of bristles that stick."""
    if not isinstance(doubt.direction, Hysteresis) or doubt.direction.slip == _SLIPS["never"]:
        return None
    return f"{doubt.name.rpartition('.')[0]}.{HYSTERESIS}"


def _hysteresis(gear: str, index: int, std: float) -> Iterator[DoubtColumn]:
    """Yields bristles that slip before and after the swing, what lies between being a mixture, and such as never do.

    Those stiffen a spring without any loss, alike in all places: nothing tells them from the spring.
    """
    for when, slip in _SLIPS.items():
        names = f"{gear}.hysteresis_{when}", f"hysteresis of {gear} that slips {when}"
        differing = 0.0 if when == "never" else std
        yield DoubtColumn(*names, "gear_nonlinearity", "%", std, differing, Hysteresis(index, slip), 0.0, _PERCENT)
