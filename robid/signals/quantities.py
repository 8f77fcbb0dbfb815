"""What a channel is, its quantity, unit and side of the robot; and positions as they are written for people."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from robid.arrays import ComplexArray, FloatArray

QuantityName: TypeAlias = Literal[
    "torque", "current", "force", "speed_reference", "position_command", "angle", "position", "speed", "acceleration"
]
Side: TypeAlias = Literal["motor", "arm", "tool"]
SIDES: tuple[Side, ...] = ("motor", "arm", "tool")
SampledName: TypeAlias = Literal["instants", "difference", "central_difference", "filtered"]
Rate: TypeAlias = Literal[0, 1, 2] | None
"""How many times a motion was differentiated before it was sampled; None where it is filtered so that nothing that the
torque's steps excite above half the sampling rate is seen."""

_DEG = float(np.pi / 180)


@dataclass(frozen=True)
class SignalKind:
    """A kind of signal."""

    units: tuple[str, ...]  # SI units that it may have: of a rotation, then of a translation
    # How many times a motion is differentiated to an acceleration; None for what is no motion
    derivatives: int | None = None


QUANTITIES: dict[QuantityName, SignalKind] = {
    "torque": SignalKind(("N m",)),
    "current": SignalKind(("A",)),
    "force": SignalKind(("N",)),
    "speed_reference": SignalKind(("rad/s", "m/s")),
    "position_command": SignalKind(("rad", "m")),
    "angle": SignalKind(("rad",), 2),
    "position": SignalKind(("m",), 2),
    "speed": SignalKind(("rad/s", "m/s"), 1),
    "acceleration": SignalKind(("rad/s^2", "m/s^2"), 0),
}

INJECTED: dict[str, QuantityName] = {
    "speed_reference": "speed_reference",
    "position_reference": "position_command",
    "torque": "torque",
    "pose_reference": "position_command",
}
"""What an excitation is, by where it is injected."""

DRIVES = frozenset[str]({"torque", "current", "force"})
"""Quantities whose response is that of the mechanics: from them, motions are brought to accelerations."""


@dataclass(frozen=True)
class Unit:
    """A unit that logs have: the SI unit that it stands for and the factor to it."""

    si: str
    factor: float = 1.0


UNITS: dict[str, Unit] = {
    "N m": Unit("N m"),
    "mN m": Unit("N m", 1e-3),
    "kN m": Unit("N m", 1e3),
    "A": Unit("A"),
    "mA": Unit("A", 1e-3),
    "N": Unit("N"),
    "kN": Unit("N", 1e3),
    "rad": Unit("rad"),
    "mrad": Unit("rad", 1e-3),
    "urad": Unit("rad", 1e-6),
    "deg": Unit("rad", _DEG),
    "turn": Unit("rad", float(2 * np.pi)),
    "m": Unit("m"),
    "mm": Unit("m", 1e-3),
    "um": Unit("m", 1e-6),
    "rad/s": Unit("rad/s"),
    "deg/s": Unit("rad/s", _DEG),
    "rpm": Unit("rad/s", float(np.pi / 30)),
    "m/s": Unit("m/s"),
    "mm/s": Unit("m/s", 1e-3),
    "rad/s^2": Unit("rad/s^2"),
    "deg/s^2": Unit("rad/s^2", _DEG),
    "m/s^2": Unit("m/s^2"),
    "mm/s^2": Unit("m/s^2", 1e-3),
}
"""Units by their names, beside counts, whose size a channel states itself."""


@dataclass(frozen=True)
class Channel:
    """One channel of a record, or one input or output of a response."""

    name: str  # Its name; collocated channels carry the name of their joint's motor
    quantity: QuantityName  # What it is, one of `QUANTITIES`
    unit: str  # Its SI unit
    side: Side = "motor"  # The side of the robot that it belongs to: motor, arm or tool
    # Of a motion, what its samples are: its values at their instants; differences of the motion that it is the rate of,
    # from the sample before or across both neighbours; or values behind an anti-aliasing filter
    sampled: SampledName = "instants"

    @property
    def title(self) -> str:
        """The quantity in plain words."""
        return _plain(self.quantity)

    @property
    def acceleration(self) -> Channel:
        """The channel of this motion's acceleration; itself where it is no motion."""
        known = QUANTITIES[self.quantity]
        if known.derivatives is None:
            return self
        unit = QUANTITIES["acceleration"].units[0 if self.unit.startswith("rad") else 1]
        return Channel(self.name, "acceleration", unit, self.side)

    @property
    def rate(self) -> Rate:
        """How many times the motion was differentiated before it was sampled, see `Rate`; 0 for what is no motion.

        A difference of sampled positions is one of positions: what differencing does is known exactly.
        """
        if self.sampled == "filtered":
            return None
        derivatives = QUANTITIES[self.quantity].derivatives
        if derivatives is None or self.sampled != "instants":
            return 0
        return 2 if derivatives == 0 else 1 if derivatives == 1 else 0

    def to_acceleration(self, omega: FloatArray, sampling_period_s: float) -> ComplexArray:
        """Returns what turns its spectrum at angular frequencies [rad/s] into its acceleration's; 1 for no motion.

        A difference of sampled positions is `(1 - z^-1) / T` of them, or `(z - z^-1) / (2 T)` across both neighbours:
        the acceleration is that of the sampled position.
        """
        order = QUANTITIES[self.quantity].derivatives or 0
        turn = omega * sampling_period_s
        if order == 1 and self.sampled == "difference":
            return np.asarray(1j * omega * np.exp(0.5j * turn) / np.sinc(turn / (2 * np.pi)))
        if order == 1 and self.sampled == "central_difference":
            return np.asarray(1j * omega / np.sinc(turn / np.pi))
        return np.asarray({0: np.ones(omega.shape), 1: 1j * omega, 2: -(omega**2)}[order])


@dataclass(frozen=True)
class UsableChannels:
    """What a family can use as inputs or outputs of responses or records: these quantities, at these sides."""

    quantities: tuple[QuantityName, ...]
    sides: tuple[Side, ...] = SIDES

    def accepts(self, channels: Iterable[Channel]) -> bool:
        """Whether all channels are of these quantities and sides."""
        return all(channel.quantity in self.quantities and channel.side in self.sides for channel in channels)

    def __str__(self) -> str:
        names = " or ".join(_plain(quantity) for quantity in self.quantities)
        return names if self.sides == SIDES else f"{' or '.join(self.sides)} {names}"


MOTOR_TORQUE = UsableChannels(("torque", "current"), ("motor",))
ACCELERATION = UsableChannels(("acceleration",))


def motor_channels(names: Iterable[str], quantity: QuantityName) -> tuple[Channel, ...]:
    """Returns one motor's channel for each name, in the quantity's unit of a rotation."""
    return tuple(Channel(name, quantity, QUANTITIES[quantity].units[0]) for name in names)


def channel_names(channels: Iterable[Channel]) -> tuple[str, ...]:
    """Returns the names of some channels."""
    return tuple(channel.name for channel in channels)


def describe(channels: Sequence[Channel]) -> str:
    """Says what some channels are, each kind with its names: `motor torque (turn, lift)`."""
    kinds: dict[str, list[str]] = {}
    for channel in channels:
        kinds.setdefault(f"{channel.side} {_plain(channel.quantity)}", []).append(channel.name)
    return ", ".join(f"{kind} ({', '.join(names)})" for kind, names in kinds.items()) or "nothing"


def units_of(quantity: QuantityName, *, rotation: bool = False) -> tuple[str, ...]:
    """Returns the names of the units that a quantity may have in a log, or those of a rotation alone."""
    known = QUANTITIES[quantity].units
    return tuple(name for name, unit in UNITS.items() if unit.si in (known[:1] if rotation else known))


def units_text(channels: Iterable[Channel]) -> str:
    """Returns the units of some channels, each once."""
    return "; ".join(dict.fromkeys(channel.unit for channel in channels)) or "1"


def joint_unit(joint_units: tuple[str, ...] | None) -> str:
    """Returns the unit of joint positions, all of which are angles where none are given."""
    return "rad" if joint_units is None else "rad; m"


def response_unit(output: str, inputs: str) -> str:
    """Returns the unit of a response, as in `rad/(s^2 N m)`."""
    above, _, below = output.partition("/")
    if below:
        return f"{above}/({below} {inputs})" if "/" not in inputs else f"{above}/({below}) / ({inputs})"
    return f"{output}/{inputs}" if inputs.isalnum() else f"{output}/({inputs})"


def _plain(quantity: str) -> str:
    return quantity.replace("_", " ")


RADIANS = "rad"
METRES = "m"


def readable(positions: FloatArray, units: Sequence[str] | None) -> FloatArray:
    """Returns positions (..., n_joint) in degrees, or in metres where joints slide.

    Args:
        positions (..., n_joint): Positions [rad, or m].
        units: Unit of each joint's position, `RADIANS` or `METRES`; None where all are angles.
    """
    if units is None:
        return np.asarray(np.rad2deg(positions))
    return np.asarray(positions * np.where([unit == METRES for unit in units], 1.0, np.rad2deg(1.0)))


def readable_units(units: Sequence[str] | None, n_joint: int) -> tuple[str, ...]:
    """Returns the unit of each of these: `deg` or `m`."""
    return ("deg",) * n_joint if units is None else tuple("m" if unit == METRES else "deg" for unit in units)


def shown(positions: FloatArray, units: Sequence[str] | None) -> str:
    """Writes the positions (n_joint,) of one configuration; without any joint it is where the robot was."""
    if not len(positions):
        return "home"
    values = readable(positions, units)
    if units is None:
        return f"{np.array2string(values, precision=1)} deg"
    pairs = zip(values.tolist(), readable_units(units, len(values)), strict=True)
    return ", ".join(f"{value:.3f} m" if unit == "m" else f"{value:.1f} deg" for value, unit in pairs)
