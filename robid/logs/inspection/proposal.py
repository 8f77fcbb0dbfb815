"""What to propose as a log's mapping: which signals drive, which were measured, how they repeat; and what to check."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from robid.arrays import IntArray
from robid.logs.inspection.names import DRIVING, MOVING, Role
from robid.logs.inspection.relations import response_at
from robid.logs.inspection.repetition import Shared
from robid.logs.inspection.roles import Comparison, Signal, derivatives
from robid.logs.lines import format_lines
from robid.signals.quantities import UNITS

_LISTED = 40
"""Lines that are listed one by one."""

_DENSE = 0.9
"""Share of a band's lines from which all of them are meant."""

_SENSED = 0.3
"""Correlation from which a sign is told from the data."""

_COUNT = 0.25
"""Resolution from which an angle without a unit is in counts."""

_PLACEHOLDER_COUNTS = 4096

_ARBITRARY = 0.02
"""Share of the band up to Nyquist from which a signal that does not repeat is more than a trajectory."""

_SEGMENTS = 20
"""Segments into which a signal that does not repeat is cut."""

_UNIT: dict[Role, str] = {
    **{"torque": "N m", "current": "A", "force": "N", "voltage": "N m", "angle": "rad", "position": "rad"},
    **{"speed": "rad/s", "acceleration": "rad/s^2"},
}


@dataclass(frozen=True)
class Entry:
    """A channel of the proposed mapping.

    Attributes:
        signal: The signal.
        name: Name of the channel.
        settings: What else is said of it, by key.
        checks: What the user has to check.
    """

    signal: Signal
    name: str
    settings: dict[str, str | float | int | bool]
    checks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Excitation:
    """What was played, as settings, with what to check."""

    settings: dict[str, str | float | int | list[int]]
    checks: tuple[str, ...] = ()


@dataclass(frozen=True)
class Proposal:
    """A mapping that is proposed.

    Attributes:
        inputs: What drives.
        outputs: What was measured.
        references: What was commanded besides.
        excitation: What was played; None for one shot.
        periods: Periods to use, None where there are none.
        drop_periods: Periods to drop before.
        take_last: Whether periods are counted from the end.
        resample: Clock to resample to; empty for none.
        one_shot: Whether the log is a record without a response.
        checks: What to check beyond single channels.
    """

    inputs: tuple[Entry, ...]
    outputs: tuple[Entry, ...]
    references: tuple[Entry, ...]
    excitation: Excitation | None
    periods: int | None = None
    drop_periods: int = 0
    take_last: bool = False
    resample: str = ""
    one_shot: bool = False
    checks: tuple[str, ...] = field(default=())


@dataclass(frozen=True)
class Chosen:
    """The signals of a mapping.

    Attributes:
        inputs: What drives, a signal for each joint.
        outputs: What was measured, the joints of the inputs first.
        references: What was commanded besides.
    """

    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    references: tuple[Signal, ...]

    @property
    def by_torque(self) -> bool:
        """Whether motors are driven, rather than a controller commanded."""
        return bool(self.inputs) and self.inputs[0].role in DRIVING


def choose(signals: Sequence[Signal]) -> Chosen:
    """Chooses the signals of a mapping: measured torques or currents, else commands, and what moves."""
    usable = [
        one for one in signals if not (one.twin or one.quality.is_dead or one.quality.is_still or one.quality.missing)
    ]
    drives = [one for one in usable if one.role in DRIVING]
    commands = [one for one in usable if one.role in MOVING and one.commanded]
    motions = [one for one in usable if one.role in MOVING and not one.commanded]
    inputs = _one_kind(drives) or _one_kind(commands)
    outputs: list[Signal] = []
    for joint in dict.fromkeys(one.hint.joint for one in motions):
        own = [one for one in motions if one.hint.joint == joint]
        angles = [one for one in own if one.role in ("angle", "position")]
        speeds = [one for one in own if one.role == "speed"]
        outputs += angles or speeds or own
    references = [one for one in usable if one.commanded and one.role in (*MOVING, *DRIVING) and one not in inputs]
    return Chosen(tuple(inputs), tuple(outputs), tuple(references))


def _one_kind(signals: list[Signal]) -> list[Signal]:
    """One signal for each joint, all of the kind that most joints have; measured ones before commanded ones."""
    best: list[Signal] = []
    kinds = dict.fromkeys(
        (one.role, one.commanded)
        for one in sorted(signals, key=lambda one: (not one.is_sure, one.commanded, _preference(one.role)))
    )
    for role, commanded in kinds:
        own = {one.hint.joint: one for one in reversed(signals) if (one.role, one.commanded) == (role, commanded)}
        found = [one for one in signals if own.get(one.hint.joint) is one]
        if len(found) > len(best):
            best = found
    return best


def _preference(role: Role) -> int:
    order: tuple[Role, ...] = ("torque", "current", "force", "voltage", "position", "angle", "speed", "acceleration")
    return order.index(role)


def propose_channels(chosen: Chosen, comparison: Comparison, band: tuple[float, float]) -> Proposal:
    """Proposes channels with names, units and signs; what was played is still to be said.

    Args:
        chosen: The signals.
        comparison: Where they are compared.
        band: Lowest and highest excited frequency [Hz].
    """
    joints = [one.hint.joint for one in chosen.inputs]
    single = len(joints) < 2
    inputs = [_input(one, joint_name(one.hint.joint, single=single)) for one in chosen.inputs]
    outputs: list[Entry] = []
    if single or not chosen.by_torque:
        outputs = _of_one_axis(chosen, comparison, band)
    else:
        for joint in dict.fromkeys(one.hint.joint for one in chosen.outputs):
            own = [one for one in chosen.outputs if one.hint.joint == joint]
            outputs += _sides(own, joint_name(joint, single=False))
    references = [_plain_entry(one, joint_name(one.hint.joint, single=single)) for one in chosen.references]
    return Proposal(tuple(inputs), tuple(outputs), tuple(references), None)


def joint_name(joint: str, *, single: bool) -> str:
    """Returns a name for a channel by what tells its joint from others."""
    if single:
        return "drive"
    return f"joint_{joint}" if joint.isdigit() or not joint else re.sub(r"[^A-Za-z0-9_-]", "_", joint)


def _input(signal: Signal, name: str) -> Entry:
    entry = _plain_entry(signal, name)
    settings, checks = dict(entry.settings), list(entry.checks)
    if signal.role == "current":
        settings |= {"torque_constant_nm_a": 1, "normalised": True}
        checks.append(
            "K_t is not known here: results are ratios to it; state `torque_constant_nm_a` and drop `normalised`"
        )
    if signal.role == "voltage":
        checks.append("a voltage is no torque: put torque or force per volt into `scale`")
    if signal.role in DRIVING and not signal.commanded:
        settings["hold"] = "band_limited"
        checks.append("hold: `zoh` if it is the controller's command rather than measured")
    return Entry(signal, name, settings, tuple(checks))


def _plain_entry(signal: Signal, name: str) -> Entry:
    """A channel with its unit."""
    settings, checks = _unit_of(signal)
    if signal.by in ("relation", "short", "file"):
        by = "by the name of the log" if signal.by == "file" else "by a single letter of its name"
        reason = "; ".join(signal.reasons) or by
        article = "an" if signal.role[0] in "aeiou" else "a"
        checks.insert(0, f"taken for {article} {signal.role}: {reason}")
    return Entry(signal, name, settings, tuple(checks))


def _unit_of(signal: Signal) -> tuple[dict[str, str | float | int | bool], list[str]]:
    unit, quality = signal.hint.unit, signal.quality
    if unit in UNITS:
        return {"unit": unit}, []
    coarse = quality.resolution is not None and quality.resolution >= _COUNT
    if signal.role in ("angle", "position") and (unit == "counts" or coarse):
        told = "" if unit == "counts" else "unit not stated; its size and steps look like counts. "
        check = f"{told}counts_per_turn is a placeholder (or `resolution_m` of a slide)"
        return {"unit": "counts", "counts_per_turn": _PLACEHOLDER_COUNTS}, [check]
    usual = _UNIT[signal.role]
    return {"unit": usual}, [f"unit not stated, {usual} assumed"]


def _of_one_axis(chosen: Chosen, comparison: Comparison, band: tuple[float, float]) -> list[Entry]:
    """Outputs of a single axis: the motor's first, those behind it with their sign against it."""
    if not chosen.outputs or not chosen.by_torque or len(chosen.inputs) != 1:
        names = _distinct([_short(one.name) for one in chosen.outputs])
        return [
            replace_settings(_plain_entry(one, name), side="tool")
            for one, name in zip(chosen.outputs, names, strict=True)
        ]
    low, high = (2 * np.pi * one for one in band)
    middle = float(np.sqrt(low * high))
    ordered = _motor_first(chosen, comparison, (middle, high))
    return _with_signs(ordered, chosen.inputs[0], comparison, (low, middle, high))


def _motor_first(chosen: Chosen, comparison: Comparison, band: tuple[float, float]) -> list[Signal]:
    """Outputs, the one first that moves most at high frequencies unless names say which is the motor's."""
    drive = comparison.spectrum(chosen.inputs[0])

    def rank(one: Signal) -> tuple[int, float]:
        named = {"motor": 0, "": 1, "arm": 2, "tool": 3}[one.hint.side]
        _, size = response_at(drive, drive, comparison.spectrum(one), derivatives(one.role), band)
        return named, -size

    return sorted(chosen.outputs, key=rank)


def _with_signs(
    ordered: list[Signal], drive: Signal, comparison: Comparison, band: tuple[float, float, float]
) -> list[Entry]:
    """Channels of one axis: the motor's sign by its acceleration against the torque, the others' by the motor."""
    low, middle, high = band
    torque, motor = comparison.spectrum(drive), ordered[0]
    entries: list[Entry] = []
    for place, one in enumerate(ordered):
        name = "drive" if not place else "drive.arm" if place == 1 else f"drive.{_short(one.name)}"
        entry, motion = _plain_entry(one, name), comparison.spectrum(one)
        checks = list(entry.checks)
        if not place:
            sense, _ = response_at(torque, torque, motion, derivatives(one.role), (middle, high))
            told = f"its acceleration at high frequencies against `{drive.name}`"
        else:
            order = derivatives(one.role) - derivatives(motor.role)
            sense, _ = response_at(torque, comparison.spectrum(motor), motion, order, (low, middle))
            sense *= -1 if entries[0].settings.get("sign") == -1 else 1
            told = f"how it goes with `{motor.name}` at low frequencies"
            if not one.hint.side:
                checks.append(f"taken for the load's side: it moves less than `{motor.name}` at high frequencies")
        sure = abs(sense) > _SENSED
        checks.append(f"sign by {told} (mean cosine {sense:+.2f})" if sure else "the data do not tell its sign")
        sign = {"sign": -1} if sure and sense < 0 else {}
        entries.append(Entry(one, name, {**entry.settings, **sign}, tuple(checks)))
    return entries


def _sides(own: list[Signal], joint: str) -> list[Entry]:
    """Outputs of one joint of several: the motor's, then the arm's."""
    rank = {"motor": 0, "": 1, "arm": 2, "tool": 3}
    ordered = sorted(own, key=lambda one: rank[one.hint.side])
    names = [joint, f"{joint}.arm", *(f"{joint}.{_short(one.name)}" for one in ordered[2:])]
    entries = [_plain_entry(one, name) for one, name in zip(ordered, names, strict=False)]
    note = "angles count on the motor side: a joint angle needs the gear ratio as `scale`; sign not told"
    return [Entry(one.signal, one.name, one.settings, (*one.checks, note)) for one in entries[:1]] + entries[1:]


def replace_settings(entry: Entry, **settings: str) -> Entry:
    """Returns a channel with further settings."""
    return Entry(entry.signal, entry.name, {**entry.settings, **settings}, entry.checks)


def _short(name: str) -> str:
    """A name for a channel from its variable's."""
    last = re.sub(r"\.(Data|data|Value)$", "", name).rpartition("/")[2]
    return re.sub(r"[^A-Za-z0-9]+", "_", last).strip("_")[:60] or "signal"


def _distinct(names: list[str]) -> list[str]:
    return [name if names.count(name) == 1 else f"{name}_{index + 1}" for index, name in enumerate(names)]


def propose_lines(shared: Shared, lines: IntArray, step_s: float) -> Excitation:
    """Proposes period, band and lines of a signal that repeats."""
    period_s, dense = float(f"{shared.whole * step_s:.9g}"), _dense_part(lines)
    low, high = int(dense[0]), int(dense[-1])
    settings: dict[str, str | float | int | list[int]] = {"period_s": period_s}
    settings |= {"low_hz": float(f"{low / period_s:.6g}"), "high_hz": float(f"{high / period_s:.6g}")}
    grids = {"odd": np.arange(low, high + 1, 2) if low % 2 else None, "full": np.arange(low, high + 1)}
    for grid, meant in grids.items():
        if meant is not None and len(np.intersect1d(meant, lines)) >= _DENSE * max(len(meant), len(lines)):
            return Excitation({**settings, "lines": "all", "grid": grid}, _held(shared, lines))
    settings |= {"low_hz": float(f"{lines[0] / period_s:.6g}"), "high_hz": float(f"{lines[-1] / period_s:.6g}")}
    settings["grid"] = "full"
    if len(lines) <= _LISTED:
        return Excitation({**settings, "lines": lines.tolist()}, _held(shared, lines))
    return Excitation({**settings, "lines": "found"}, _held(shared, lines))


def _dense_part(lines: IntArray) -> IntArray:
    """The lines without single ones far off the others, as distortion has them."""
    kept = lines
    while len(kept) > _DENSE * len(lines):
        steps = np.diff(kept)
        if len(steps) < 2 or kept[-1] - kept[0] <= len(steps) / _DENSE * np.median(steps):
            return kept
        kept = kept[1:] if steps[0] > steps[-1] else kept[:-1]
    return lines


def _held(shared: Shared, lines: IntArray) -> tuple[str, ...]:
    return (f"lines with energy: {format_lines(lines)}; the period was measured to {shared.samples:.6g} samples",)


def propose_band(band: tuple[float, float], duration_s: float) -> Excitation:
    """Proposes band and resolution of a signal that does not repeat."""
    low, high = (float(f"{one:.3g}") for one in band)
    resolution = float(f"{max(_SEGMENTS / duration_s, (high - low) / 400):.2g}")
    low = max(low, resolution)
    settings: dict[str, str | float | int | list[int]] = {"signal": "arbitrary"}
    settings |= {"low_hz": low, "high_hz": high, "resolution_hz": resolution}
    return Excitation(settings, ("nothing repeats; band by where the inputs have their energy",))


def is_broad(band: tuple[float, float], step_s: float, duration_s: float) -> bool:
    """Whether a signal's band is wide enough for a frequency response."""
    high = band[1]
    return high > _ARBITRARY * 0.5 / step_s and (high - band[0]) * duration_s > 4 * _SEGMENTS
