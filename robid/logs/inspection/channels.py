"""Which signals of a log to import, with names, units and signs; and what the user has to check about them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from robid.arrays import FloatArray
from robid.logs.inspection.names import DRIVING, MOVING, of_turning
from robid.logs.inspection.relations import response_at, sense_of_inertia, sense_of_loss
from robid.logs.inspection.roles import Comparison, Signal, derivatives
from robid.logs.inspection.sides import SIDES, find_sides
from robid.logs.inspection.vocabulary import CONVERTED, ESTIMATED, Role, tokens
from robid.signals.quantities import UNITS

_SENSED = 0.3  # mean cosine from which a sign is told from the data
_COUNT = 0.25  # resolution from which an angle without a unit is in counts
_SLOW = 0.1  # share of the sampling rate up to which delays leave the signs as they are
_COUNTS_OPEN = (
    "add `counts_per_turn` (`resolution_m` for a slide): nothing in the log tells it; the encoder's data sheet or the"
    " drive's parameters do"
)

_UNIT: dict[Role, str] = {
    **{"torque": "N m", "current": "A", "force": "N", "voltage": "N m", "angle": "rad", "position": "rad"},
    **{"speed": "rad/s", "acceleration": "rad/s^2"},
}
_PREFERRED: tuple[Role, ...] = ("torque", "current", "force", "voltage", "position", "angle", "speed", "acceleration")
_BY = {"file": "by the name of the log", "short": "by a single letter of its name"}

Settings: TypeAlias = dict[str, str | float | int | bool]


@dataclass(frozen=True)
class Entry:
    """A channel of the proposed mapping: its signal, name, settings by key, and what the user has to check.

    One that is open is proposed as a comment, as a person has to say what it is.
    """

    signal: Signal
    name: str
    settings: Settings
    checks: tuple[str, ...] = ()
    is_open: bool = False

    def in_unit(self, *units: str) -> FloatArray | None:
        """Returns its values (n_sample,) in one of some SI units; None where it has another one."""
        unit, scale = UNITS.get(str(self.settings.get("unit"))), self.settings.get("scale", 1.0)
        if unit is None or unit.si not in units or not isinstance(scale, int | float):
            return None
        return np.asarray(unit.factor * scale * self.signal.column.values)


@dataclass(frozen=True)
class Chosen:
    """The signals of a mapping: what drives, one for each joint, what was measured, and what was commanded besides."""

    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    references: tuple[Signal, ...]

    @property
    def by_torque(self) -> bool:
        """Whether motors are driven, rather than a controller commanded."""
        return bool(self.inputs) and self.inputs[0].role in DRIVING

    @property
    def is_single(self) -> bool:
        """Whether a single joint is driven."""
        return len(self.inputs) < 2


def choose(signals: Sequence[Signal]) -> Chosen:
    """Chooses the signals of a mapping: measured torques or currents, else commands, and what moves."""
    moving = [one for one in signals if not (one.twin or one.quality.is_dead or one.quality.is_still)]
    usable = [one for one in moving if one.role in (*DRIVING, *MOVING)]
    drives = [one for one in usable if one.role in DRIVING]
    commands = [one for one in usable if one.role in MOVING and one.commanded]
    motions = [one for one in usable if one.role in MOVING and not one.commanded]
    inputs = _one_kind(drives) or _one_kind(commands)
    outputs: list[Signal] = []
    for joint in dict.fromkeys(one.hint.joint for one in motions):
        own = [one for one in motions if one.hint.joint == joint]
        angles = [one for one in own if one.role in ("angle", "position")]
        outputs += angles or [one for one in own if one.role == "speed"] or own
    if len(inputs) == 1 and any(one.hint.joint == inputs[0].hint.joint for one in outputs):
        outputs = [one for one in outputs if one.hint.joint in ("", inputs[0].hint.joint)]
    references = [one for one in usable if one.commanded and one not in inputs]
    return Chosen(tuple(inputs), tuple(outputs), tuple(references))


def _one_kind(signals: list[Signal]) -> list[Signal]:
    """One signal for each joint, all of the kind that most joints have; measured ones before commanded ones.

    Forces of joints that slide are of one kind with torques.
    """
    best: list[Signal] = []
    ordered = sorted(signals, key=lambda one: (not one.is_sure, one.commanded, _PREFERRED.index(one.role)))
    for role, commanded in dict.fromkeys((of_turning(one.role), one.commanded) for one in ordered):
        own: dict[str, Signal] = {}
        for one in sorted(signals, key=_behind):
            if (of_turning(one.role), one.commanded) == (role, commanded):
                own.setdefault(one.hint.joint, one)
        if len(own) > len(best):
            best = [one for one in signals if own.get(one.hint.joint) is one]
    return best


def _behind(signal: Signal) -> tuple[bool, int, int]:
    """What of a joint comes first: what no observer estimates, nearest to the motor, a torque before a force."""
    return _is_estimated(signal), SIDES[signal.hint.side], _PREFERRED.index(signal.role)


def _is_estimated(signal: Signal) -> bool:
    return not ESTIMATED.isdisjoint(tokens(signal.column.name))


def propose_inputs(chosen: Chosen, comparison: Comparison, band: tuple[float, float]) -> tuple[Entry, ...]:
    """Proposes the channels that drive; `band` are the lowest and the highest excited frequency [Hz]."""
    found = [_input(one, joint_name(one.hint.joint, single=chosen.is_single)) for one in chosen.inputs]
    if chosen.by_torque or len(found) != 1:
        return tuple(found)
    return (_with_command_sign(found[0], chosen.outputs, comparison, band),)


def propose_outputs(chosen: Chosen, comparison: Comparison, band: tuple[float, float]) -> tuple[Entry, ...]:
    """Proposes the channels that were measured: those of each axis by the side, the others as they are."""
    if not chosen.by_torque:
        short = [_short(one.column.name) for one in chosen.outputs]
        names = [one if short.count(one) == 1 else f"{one}_{index}" for index, one in enumerate(short, start=1)]
        pairs = zip(chosen.outputs, names, strict=True)
        return tuple(_with(_plain_entry(one, name), side="tool") for one, name in pairs)
    if chosen.is_single:
        name = joint_name(chosen.inputs[0].hint.joint, single=True)
        return tuple(_of_axis(name, chosen.inputs[0], chosen.outputs, comparison, band))
    drives = {one.hint.joint: one for one in chosen.inputs}
    entries: list[Entry] = []
    for joint in dict.fromkeys(one.hint.joint for one in chosen.outputs):
        own = tuple(one for one in chosen.outputs if one.hint.joint == joint)
        name = joint_name(joint, single=False)
        if joint in drives:
            entries += _of_axis(name, drives[joint], own, comparison, band)
            continue
        ordered = sorted(own, key=lambda one: SIDES[one.hint.side])
        own_names = [name, f"{name}.arm", *(f"{name}.{_short(one.column.name)}" for one in ordered[2:])]
        entries += [_plain_entry(one, own_name) for one, own_name in zip(ordered, own_names, strict=False)]
    return tuple(entries)


def propose_references(chosen: Chosen) -> tuple[Entry, ...]:
    """Proposes the commands beside what drives."""
    return tuple(_plain_entry(one, joint_name(one.hint.joint, single=chosen.is_single)) for one in chosen.references)


def joint_name(joint: str, *, single: bool) -> str:
    """Returns a name for a channel by what tells its joint from others."""
    if joint and not joint.isdigit():
        return re.sub(r"[^A-Za-z0-9_-]", "_", joint)
    return "drive" if single else f"joint_{joint}"


def _input(signal: Signal, name: str) -> Entry:
    entry = _plain_entry(signal, name)
    settings, checks = dict(entry.settings), list(entry.checks)
    if signal.role == "current":
        settings |= {"torque_constant_nm_a": 1, "normalised": True}
        checks.append("results are ratios to K_t; where it is known, state `torque_constant_nm_a`, not `normalised`")
    if signal.role in DRIVING and not signal.commanded:
        settings["hold"] = "band_limited"
        checks.append("hold: `zoh` if it is the controller's command rather than measured")
    return Entry(signal, name, settings, tuple(checks))


def _plain_entry(signal: Signal, name: str) -> Entry:
    settings, checks = _unit_of(signal)
    if not signal.is_sure:
        reason = "; ".join(signal.reasons) or _BY.get(signal.by, "")
        article = "an" if signal.role[0] in "aeiou" else "a"
        checks.insert(0, f"taken for {article} {signal.role}: {reason}")
    checks += [signal.doubt] if signal.doubt else []
    if signal.quality.missing:
        checks.append(f"values missing: {signal.quality.missing}; the import says what fills them or cuts them out")
    return Entry(signal, name, settings, tuple(checks))


def _unit_of(signal: Signal) -> tuple[Settings, list[str]]:
    """Unit, scale and unwrapping of a channel, with what to check; what nobody stated is left out, or stops the run."""
    settings, checks = _size_of(signal)
    if signal.hint.by_letter and "unit" in settings and not signal.column.name.rstrip().endswith(("]", ")")):
        checks.append("unit by the last letter of the name")
    if signal.wrap is not None:
        along = signal.role in ("angle", "position")
        turn = signal.wrap.unit != "counts" and settings["unit"] != "counts"
        settings["unwrap"] = True if turn else signal.wrap.size
        told = f"starts again after {signal.wrap.size:.6g}, which `unwrap` takes out"
        checks.append(f"it {told}" if along else "its signs are lost, which `unwrap` puts back")
    return settings, checks


def _size_of(signal: Signal) -> tuple[Settings, list[str]]:
    unit, quality, along = signal.hint.unit, signal.quality, signal.role in ("angle", "position")
    if unit in UNITS:
        return {"unit": unit}, []
    if unit in CONVERTED:
        known, factor = CONVERTED[unit]
        return {"unit": known, "scale": factor}, [f"from {signal.hint.stated}"]
    turn = "" if signal.wrap is None or signal.states_unit else signal.wrap.unit
    if turn not in ("", "counts") and signal.wrap is not None:
        return {"unit": turn}, [f"unit by the range of {signal.wrap.size:.6g} after which it starts again"]
    coarse = not signal.states_unit and quality.resolution is not None and quality.resolution >= _COUNT
    if unit.startswith("counts") or (along and (turn == "counts" or coarse)):
        guess = [] if unit else ["unit not stated, its steps look like counts"]
        return {"unit": unit or "counts"}, [*guess, _COUNTS_OPEN]
    if signal.implied:
        return {"unit": signal.implied}, [signal.implied_by]
    usual = _UNIT[signal.role]
    stated = signal.hint.stated or signal.column.unit or ("V" if signal.role == "voltage" else "")
    if stated:
        told = f"state as `unit` and `scale` what one `{stated}` stands for: nothing in the log tells it"
        return {"unit": stated}, [told]
    return {"unit": usual}, [f"unit not stated, {usual} assumed"]


def _of_axis(
    name: str, drive: Signal, own: tuple[Signal, ...], comparison: Comparison, band: tuple[float, float]
) -> list[Entry]:
    """Outputs of an axis: the motor's, its sign by its acceleration, then those behind it, their signs by the motor."""
    if not own:
        return []
    low, high = 2 * np.pi * band[0], 2 * np.pi * min(band[1], max(_SLOW / comparison.step_s, 2 * band[0]))
    middle = float(np.sqrt(low * high))
    torque = comparison.spectrum(drive)
    places = find_sides(drive, own, comparison)
    entries: list[Entry] = []
    turned, motor = 1, places[0].signal
    for place in places:
        one = place.signal
        motion = comparison.spectrum(one)
        part = "" if place.side == "motor" else ".arm" if place.side == "arm" else f".{_short(one.column.name)}"
        entry = _plain_entry(one, f"{name}{part}")
        entry = replace(entry, is_open=place.is_open, checks=(*entry.checks, *place.told))
        if one is motor:
            # Behind the resonance a load goes against the torque: only lines below it tell its sign.
            parts = [(low, middle)] if place.side == "arm" else [(low, middle), (middle, high), (low, high)]
            senses = [sense_of_inertia(torque, motion, derivatives(one.role), part) for part in parts]
            sense, by = max(senses, key=abs), "acceleration"
            if place.side == "motor" and one.role != "acceleration":
                # What other joints do to this one may go against its acceleration, but feeds it no work in the end.
                loss = sense_of_loss(torque, motion, derivatives(one.role) - 1)
                sense, by = (loss, "speed") if abs(loss) > max(abs(sense), _SENSED) else (sense, by)
            entries.append(_signed(entry, sense, f"how its {by} goes with `{drive.name}`"))
            turned = -1 if entries[0].settings.get("sign") == -1 else 1
            continue
        order = derivatives(one.role) - derivatives(motor.role)
        sense, _ = response_at(torque, comparison.spectrum(motor), motion, order, (low, middle))
        entries.append(_signed(entry, turned * sense, f"how it goes with `{motor.name}` at low frequencies"))
    return entries


def _signed(entry: Entry, sense: float, by: str) -> Entry:
    if abs(sense) < _SENSED:
        return replace(entry, checks=(*entry.checks, "the data do not tell its sign"))
    told = replace(entry, checks=(*entry.checks, f"sign by {by} ({sense:+.2f} of 1)"))
    return _with(told, sign=-1) if sense < 0 else told


def _with_command_sign(
    entry: Entry, outputs: tuple[Signal, ...], comparison: Comparison, band: tuple[float, float]
) -> Entry:
    """A command with its sign against what follows it best."""
    best, follower = 0.0, ""
    command = comparison.spectrum(entry.signal)
    for one in outputs:
        order = derivatives(one.role) - derivatives(entry.signal.role)
        part = 2 * np.pi * band[0], 2 * np.pi * float(np.sqrt(band[0] * band[1]))
        sense, _ = response_at(command, command, comparison.spectrum(one), order, part)
        if abs(sense) > abs(best):
            best, follower = sense, one.name
    return _signed(entry, best, f"how `{follower}` follows it at low frequencies")


def _with(entry: Entry, **settings: str | int) -> Entry:
    return replace(entry, settings={**entry.settings, **settings})


def _short(name: str) -> str:
    last = re.sub(r"\.(Data|data|Value)$", "", name).rpartition("/")[2]
    return re.sub(r"[^A-Za-z0-9]+", "_", last).strip("_")[:60] or "signal"
