"""What the variables of a log are: channels with their units and signs."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal, TypeAlias

import numpy as np

from robid.arrays import option
from robid.signals.quantities import DRIVES, QUANTITIES, UNITS, Channel, QuantityName, SampledName, Side, units_of

UnitName: TypeAlias = Literal[
    "N m",
    "mN m",
    "kN m",
    "A",
    "mA",
    "N",
    "kN",
    "rad",
    "mrad",
    "urad",
    "deg",
    "turn",
    "m",
    "mm",
    "um",
    "rad/s",
    "deg/s",
    "rpm",
    "m/s",
    "mm/s",
    "rad/s^2",
    "deg/s^2",
    "m/s^2",
    "mm/s^2",
    "counts",
    "counts/s",
]
_COMMANDS: dict[str, QuantityName] = {
    **{"N m": "torque", "A": "current", "N": "force", "rad": "position_command", "m": "position_command"},
    **{"rad/s": "speed_reference", "m/s": "speed_reference", "rad/s^2": "acceleration", "m/s^2": "acceleration"},
}
_MEASURED: dict[str, QuantityName] = {**_COMMANDS, "rad": "angle", "m": "position", "rad/s": "speed", "m/s": "speed"}
_COUNTS = ("counts", "counts/s")
_UNIT = {"description": "Unit in the log; `counts` and `counts/s` need `counts_per_turn` or `resolution_m`."}


@dataclass(frozen=True)
class LogChannel:
    """A variable of a log, and how its numbers are to be read."""

    name: str = field(
        metadata={
            "description": "Name of the channel: the joint's for its motor, `<joint>.arm` for its arm side.",
            "pattern": r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}(\.[A-Za-z0-9_-]+)?$",
        }
    )
    variable: str = field(
        metadata={
            "description": "Name of the variable in the log, or a weighted sum of some, as `q2 + q3` or `0.5*a "
            "- 2*b`. Unit, scale and sign are those of the sum, `unwrap` and `time` those of "
            "each variable."
        }
    )
    unit: UnitName = field(default="rad", metadata=_UNIT)
    sign: Literal[1, -1] = option(1, "Sign that turns the log's direction into the joint's.")
    scale: float = option(1.0, "Factor from the log's numbers to the unit, as for raw numbers.", gt=0)
    quantity: QuantityName | None = option(None, "Quantity of the channel; from its unit when not given.")
    side: Side | None = option(None, "Side that it belongs to; `arm` for `<joint>.arm`, else `motor` when not given.")
    counts_per_turn: float | None = option(None, "Counts of one turn, of a rotation in counts.", gt=0)
    resolution_m: float | None = option(None, "Length of one count, of a translation in counts [m].", gt=0)
    unwrap: bool | float | None = option(
        None,
        "Whether jumps by a turn are removed, as from 180 to -180 degrees; done for a tool's angles when not "
        "given. A number is the range after which the log's numbers start again, as 65536 for a counter of 16 "
        "bits; of torques, currents and speeds, which do not go on, its upper half is then negative.",
    )
    file: str | None = option(None, "Its log, written as `file` above, where a recording has several.")
    time: str | None = option(
        None, "Variable of its own time stamps, in the unit of `time`, where channels have clocks of their own."
    )

    @property
    def column(self) -> str:
        """Name of its column among those of all logs of a recording."""
        return self.variable if self.file is None else f"{self.variable} of {self.file}"

    @property
    def si_unit(self) -> str:
        """SI unit of what the log holds."""
        if self.unit not in _COUNTS:
            return UNITS[self.unit].si
        length = "m" if self.counts_per_turn is None else "rad"
        return length + self.unit.removeprefix("counts")

    @property
    def factor(self) -> float:
        """Factor from the log's numbers to the channel's unit."""
        if self.unit not in _COUNTS:
            return self.sign * self.scale * UNITS[self.unit].factor
        size = 2 * np.pi / self.counts_per_turn if self.counts_per_turn else self.resolution_m or 1.0
        return float(self.sign * self.scale * size)

    @property
    def channel(self) -> Channel:
        """What the record holds of it."""
        side: Side = self.side or ("arm" if self.name.endswith(".arm") else "motor")
        return Channel(self.name, self.quantity or self._usual[self.si_unit], self.si_unit, side)

    @property
    def unwraps(self) -> bool:
        """Whether jumps are taken out."""
        return (self.si_unit == "rad" and self.side == "tool") if self.unwrap is None else bool(self.unwrap)

    @property
    def goes_on(self) -> bool:
        """Whether numbers that begin again go on, as those of angles and positions do; else they are signed ones."""
        return self.si_unit in ("rad", "m")

    def wrap(self, span: float) -> float:
        """By how much the log's numbers jump where they begin again: a turn, or their range.

        A turn is one of what `scale` makes of them, as counts; of what they are before where they span more than that
        and no more than this, as a joint's angle that a gear ratio turns into its motor's.

        Args:
            span: Range of the numbers.
        """
        if not (self.unwrap is None or isinstance(self.unwrap, bool)):
            return float(self.unwrap)
        turn = 2 * np.pi / abs(self.factor)
        own = turn * self.scale
        return own if self.scale > 1 and turn < span <= own * (1 + 1e-3) else turn

    @property
    def _usual(self) -> dict[str, QuantityName]:
        return _MEASURED

    def problems(self) -> list[str]:
        """Finds what contradicts itself: unit, sign, size of a count, quantity."""
        if self.unit not in UNITS and self.unit not in _COUNTS:
            return [f"S361 unknown unit `{self.unit}` (known: {', '.join([*UNITS, *_COUNTS])})"]
        found = [] if self.sign in (-1, 1) else [f"S387 sign {self.sign} is neither 1 nor -1"]
        sizes = [name for name in ("counts_per_turn", "resolution_m") if getattr(self, name) is not None]
        if self.unit in _COUNTS and len(sizes) != 1:
            found.append(
                "S362 counts need either `counts_per_turn` or `resolution_m`: the encoder's data sheet or the drive's"
                " parameters tell it"
            )
        elif self.unit not in _COUNTS and sizes:
            found.append(f"S363 `{sizes[0]}` belongs to `unit: counts`, not to {self.unit}")
        if self.quantity is not None and self.si_unit not in QUANTITIES[self.quantity].units:
            known = " or ".join(units_of(self.quantity))
            found.append(f"S364 {self.unit} is no unit of a {self.quantity.replace('_', ' ')}: use {known}")
        if self.unwrap is True and self.si_unit != "rad":
            told = f"only angles jump by a turn: `unwrap: true` does not belong to {self.unit}"
            found.append(f"S365 {told}; where its numbers begin again after a range, state that, as `unwrap: 65536`")
        elif not isinstance(self.unwrap, bool) and self.unwrap is not None and not 0 < self.unwrap < np.inf:
            found.append(f"S366 the range {self.unwrap:g} of `unwrap` is not above 0")
        return found


@dataclass(frozen=True)
class InputChannel(LogChannel):
    """What drives the robot: a motor torque, the current that stands for it, a force, or a command."""

    unit: UnitName = field(default="N m", metadata=_UNIT)
    torque_constant_nm_a: float | None = option(
        None, "Torque constant K_t of a current; 1 with `normalised` [N m/A].", gt=0
    )
    torque_constant_relative_std: float = option(0.0, "Relative standard deviation of the torque constant.", ge=0)
    normalised: bool = option(False, "The current replaces the torque, and every result is a ratio to K_t.")
    hold: Literal["zoh", "band_limited"] = option(
        "zoh",
        "Course between samples: `zoh`, a command constant "
        "over a sample, or `band_limited`, measured like the "
        "outputs.",
    )

    @property
    def is_current(self) -> bool:
        """Whether the log holds a current."""
        return self.si_unit == "A"

    @property
    def factor(self) -> float:
        """Factor from the log's numbers to the channel's unit."""
        return super().factor * (self.torque_constant_nm_a or 1.0)

    @property
    def channel(self) -> Channel:
        """What the record holds of it: the torque, where a torque constant is known."""
        found = super().channel
        known = self.is_current and not self.normalised
        return Channel(found.name, "torque", "N m", found.side) if known else found

    @property
    def _usual(self) -> dict[str, QuantityName]:
        return _COMMANDS

    def problems(self) -> list[str]:
        """Finds what contradicts itself, of the torque constant too."""
        found = super().problems()
        if found:
            return found
        if not self.is_current and (self.torque_constant_nm_a is not None or self.normalised):
            found.append(
                f"S368 {self.unit} takes neither `torque_constant_nm_a` nor `normalised`: a torque constant needs a "
                "current"
            )
        elif self.is_current and self.normalised and self.torque_constant_nm_a not in (None, 1):
            found.append("S369 `normalised` needs a torque constant of 1")
        elif self.is_current and not self.normalised and self.torque_constant_nm_a is None:
            found.append("S370 a current needs `torque_constant_nm_a` (1 with `normalised: true` where it is unknown)")
        return found


def input_problems(inputs: tuple[InputChannel, ...]) -> list[str]:
    """Finds what contradicts itself among the inputs of one log, each of which is sound for itself."""
    found: list[str] = []
    if any(channel.problems() for channel in inputs):
        return found
    if len({channel.normalised for channel in inputs if channel.is_current or channel.si_unit == "N m"}) > 1:
        found.append("S371 either all torques are normalised currents, or none")
    if len({channel.hold for channel in inputs}) > 1:
        found.append("S372 all must have the same `hold`")
    kinds = {channel.name: channel.channel for channel in inputs}
    mixed = {one.quantity for one in kinds.values()}
    if len(mixed) > 1 and not mixed <= DRIVES and any(channel.quantity is None for channel in inputs):
        told = ", ".join(f"{name} is in {one.unit} ({one.title})" for name, one in kinds.items())
        found.append(
            f"S373 they mix quantities: {told}; correct the unit, or state the `quantity` of every input if it is "
            "meant so"
        )
    return found


@dataclass(frozen=True)
class OutputChannel(LogChannel):
    """What was measured: an angle, a position, a speed or an acceleration."""

    zero: float = option(0.0, "The log's number when all joints are in their zero positions, in its own unit.")
    sampled: SampledName = option(
        "instants",
        "Kind of its samples. `instants`: values at their instants. `difference`: of a speed, the difference "
        "of a position from the sample before. `central_difference`: the same across both neighbours. "
        "`filtered`: values filtered against aliasing, so that they contain nothing above half the sampling "
        "rate.",
    )

    @property
    def channel(self) -> Channel:
        """What the record holds of it."""
        return replace(super().channel, sampled=self.sampled)

    def problems(self) -> list[str]:
        """Finds what contradicts itself, of its samples too."""
        found = super().problems()
        if not found and "difference" in self.sampled and self.channel.quantity != "speed":
            title = self.channel.title
            told = f"this is {'an' if title[0] in 'aeiou' else 'a'} {title}: leave it out"
            found.append(f"S374 `sampled: {self.sampled}` belongs to a speed; {told}")
        return found


@dataclass(frozen=True)
class ReferenceChannel(LogChannel):
    """What a motor was told to do; it is matched to the excitation, which says where its periods begin."""

    unit: UnitName = field(default="rad/s", metadata=_UNIT)

    @property
    def _usual(self) -> dict[str, QuantityName]:
        return _COMMANDS
