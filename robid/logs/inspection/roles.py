"""What each signal of a log is: by its unit, its name, or how it follows from the others; and how sure that is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, permutations
from typing import Literal, TypeAlias

import numpy as np

from robid.logs.inspection.contents import Column
from robid.logs.inspection.names import DRIVING, MOVING, Hint, is_desired, read_names
from robid.logs.inspection.quality import Quality, Wrap, find_wrap, unwrapped
from robid.logs.inspection.relations import Likeness, Relation, Spectrum, compare, relate, spectrum_of
from robid.logs.inspection.sampling import is_ramp
from robid.logs.inspection.vocabulary import Role
from robid.logs.mapping import unsigned_range
from robid.logs.streams import signed
from robid.signals.quantities import UNITS

Evidence: TypeAlias = Literal["unit", "name", "short", "file", "relation", ""]

_DERIVED = 0.97  # correlation from which a signal is another one's derivative
_NAMED = 0.8  # the same where names say so already: measured speeds are filtered
_LATE = 10.0  # samples by which a measured speed comes late at most
_FACTORS = {
    1.0: "the same unit",
    30 / np.pi: "as rpm and rad",
    180 / np.pi: "as deg/s and rad",
    np.pi / 180: "as rad/s and deg",
    1 / 6: "as rpm and deg",
}
"""What a factor between an angle's derivative and a speed speaks for."""

_TURNS = [(angle, speed) for angle in ("rad", "deg", "turn") for speed in ("rad/s", "deg/s", "rpm")]
# Units of an angle or a position and of its speed that go together
_TRAVELS = [(way, speed) for way in ("m", "mm", "um") for speed in ("m/s", "mm/s")]
_MEANT = 0.01  # relative distance of a factor from these that its deviation does not have to explain
_TOLD = 0.02  # relative deviation up to which a factor is told
# Relative distance from which a factor is another one than two stated units give, rather than a poor calibration
_APART = 0.2
_MOST = 0.5  # share of a signal's energy at the lines that tell a factor, at least
_DRIVES = 0.5  # correlation with an acceleration from which an unnamed signal is taken for what drives
_FOLLOWS = 0.97  # correlation from which a signal follows another one of its kind
_LEADS = 2.0  # samples by which a command comes first
_COUNT = 0.25  # smallest step of an encoder's counts: some are interpolated
_COUNTS = 100  # fewest of them that a motion passes
_EQUAL = 1e-9
_COMPARED = 40  # signals that are compared with each other at most


@dataclass(frozen=True)
class Signal:
    """What a signal was taken for."""

    column: Column  # The signal, without jumps where it wraps
    hint: Hint
    quality: Quality
    role: Role
    by: Evidence  # What says so
    commanded: bool = False
    reasons: tuple[str, ...] = ()  # What else speaks for it
    twin: str = ""  # Another signal with the same samples; empty where there is none
    implied: str = ""  # Its unit, where none is stated but the factor to another signal's derivative tells it
    implied_by: str = ""  # What tells that
    wrap: Wrap | None = None  # How it wraps, None where it does not; its samples are then without that
    doubt: str = ""  # What contradicts its unit

    @property
    def states_unit(self) -> bool:
        """Whether the log states a unit, whether a mapping knows it or not."""
        return bool(self.hint.unit or self.column.unit)

    @property
    def name(self) -> str:
        """Its name in the log, and which log where there are several."""
        return self.column.key

    @property
    def is_sure(self) -> bool:
        """Whether the log itself says what it is."""
        return self.by in ("unit", "name")


class Comparison:
    """Spectra of the signals of a log, and how they follow from each other."""

    def __init__(self, step_s: float, *, is_known: bool = True) -> None:
        self.step_s = step_s
        self.is_known = is_known
        self._spectra: dict[str, Spectrum] = {}

    def spectrum(self, signal: Signal) -> Spectrum:
        """Returns the spectrum of a signal, NaN replaced by its mean."""
        if signal.name not in self._spectra:
            values = signal.column.values
            filled = np.where(np.isfinite(values), values, np.nanmean(values))
            self._spectra[signal.name] = spectrum_of(np.asarray(filled), self.step_s)
        return self._spectra[signal.name]

    def like(self, first: Signal, second: Signal, order: int) -> Likeness:
        """How a signal follows from another one's derivative."""
        return compare(self.spectrum(first), self.spectrum(second), order, self.step_s)

    def factor(self, first: Signal, second: Signal, order: int) -> Relation | None:
        """How much of another signal's derivative a signal is; None where the data do not tell."""
        if order and not self.is_known:
            return None  # no time, no derivative
        found = relate(self.spectrum(first), self.spectrum(second), order, self.step_s)
        return found if found is not None and found.relative_std < _TOLD and found.carried > _MOST else None


def find_roles(columns: Sequence[Column], qualities: Sequence[Quality], comparison: Comparison) -> list[Signal]:
    """Finds what each signal is, of signals that share their samples, the time left out."""
    found: list[Signal] = []
    for column, quality, hint in zip(columns, qualities, read_names(columns), strict=True):
        one = Signal(column, hint, quality, hint.role, hint.by, commanded=hint.commanded is True)
        if not one.is_sure and is_ramp(column.values):
            one = replace(one, role="other", reasons=("it changes evenly all along, as a clock or a counter",))
        found.append(_without_wraps(one))
    moving = [one for one in found if not (one.quality.is_dead or one.quality.is_still or one.role == "other")]
    signals = {one.name: one for one in moving[:_COMPARED]}
    _find_twins(signals)
    _find_encoders(signals)
    _find_derivatives(signals, comparison)
    _find_drives(signals, comparison)
    _find_commands(signals, comparison)
    return [signals.get(one.name, one) for one in found]


def _without_wraps(signal: Signal) -> Signal:
    """A signal without jumps by a turn or by a counter's range; with a role where these alone say it."""
    if signal.role in ("torque", "current", "force", "voltage", "speed"):
        return _with_signs(signal)
    if signal.role not in ("angle", "position", "") or signal.quality.is_still:
        return signal
    stated = signal.hint.unit or ("?" if signal.states_unit else "")
    wrap = find_wrap(signal.column.values, stated)
    if wrap is None:
        return signal
    column = replace(signal.column, values=unwrapped(signal.column.values, wrap.size))
    signal = replace(signal, column=column, wrap=wrap)
    return signal if signal.role else _taken(signal, "angle", "it starts again as angles do")


def _with_signs(signal: Signal) -> Signal:
    """A signal with the signs that it was logged without."""
    values = signal.column.values
    found = unsigned_range(values)
    if found is None:
        return signal
    column = replace(signal.column, values=signed(values, found[0])[0])
    return replace(signal, column=column, wrap=Wrap(found[0], "counts", found[1]))


def _taken(signal: Signal, role: Role, reason: str) -> Signal:
    """A signal with the role that its relation to others gives it."""
    return replace(signal, role=role, by="relation", reasons=(*signal.reasons, reason))


def same_joint(first: Signal, second: Signal) -> bool:
    """Whether two signals may belong to one joint."""
    joints = {first.hint.joint, second.hint.joint}
    return len(joints) == 1 or "" in joints


def _find_twins(signals: dict[str, Signal]) -> None:
    for first, second in combinations(list(signals), 2):
        x, y = signals[first].column.values, signals[second].column.values
        if not signals[first].twin and len(x) == len(y) and np.all(np.abs(x - y) <= _EQUAL * np.abs(x).max()):
            signals[second] = replace(signals[second], twin=first)


def _find_encoders(signals: dict[str, Signal]) -> None:
    for name, one in signals.items():
        step, span = one.quality.resolution or 0.0, one.quality.highest - one.quality.lowest
        if not one.role and step >= _COUNT and span > _COUNTS * step:
            signals[name] = _taken(one, "angle", f"its steps of {step:g} look like an encoder's counts")


def _find_derivatives(signals: dict[str, Signal], comparison: Comparison) -> None:
    """Tells speeds from angles where one is the other's derivative."""
    for first, second in permutations(list(signals), 2):
        a, b = signals[first], signals[second]
        if a.twin or b.twin or not same_joint(a, b) or a.role in DRIVING or b.role in DRIVING:
            continue
        if (a.is_sure and a.role not in ("angle", "position")) or (a.commanded and not b.commanded):
            continue
        if b.is_sure and b.role != "speed":
            continue
        like = comparison.like(a, b, 1)
        named = a.is_sure and b.is_sure
        if like.correlation < (_NAMED if named else _DERIVED) or abs(like.delay) > _LATE:
            continue
        found = comparison.factor(a, b, 1)
        told = f"{_times(found)}the derivative of `{first}` (correlation {like.correlation:.2f})"
        role, by = (b.role, b.by) if b.is_sure else ("speed", "relation")
        a, b = _with_units(a, replace(b, role=role, by=by, reasons=(*b.reasons, told)), found)
        signals[first], signals[second] = a, b
        if not a.is_sure:
            own: Role = a.role if a.role in ("angle", "position") else "angle"
            signals[first] = _taken(a, own, f"`{second}` is its derivative")


def _times(found: Relation | None) -> str:
    """A factor between a derivative and a speed, with the units that it speaks for; empty where none is told."""
    if found is None:
        return ""
    reach = max(3 * found.relative_std, _MEANT)
    meant = [text for size, text in _FACTORS.items() if abs(abs(found.factor) / size - 1) < reach]
    return f"{found.factor:#.4g} times{f' ({meant[0]})' if meant else ''} "


def _with_units(angle: Signal, speed: Signal, found: Relation | None) -> tuple[Signal, Signal]:
    """An angle and its speed with the units that the factor between the two tells, where the log states none."""
    if found is None:
        return angle, speed
    reach = max(3 * found.relative_std, _MEANT)

    def fits(unit: str, other: str, width: float) -> bool:
        return abs(UNITS[unit].factor / abs(found.factor) / UNITS[other].factor - 1) < width

    angles, speeds = ([one.hint.unit] if one.hint.unit in UNITS else [] for one in (angle, speed))
    length = any(one.hint.unit in UNITS and UNITS[one.hint.unit].si.startswith("m") for one in (angle, speed))
    known = _TRAVELS if length else _TURNS
    pairs = [
        (one, other)
        for one, other in known
        if one in (angles or {one}) and other in (speeds or {other}) and fits(one, other, reach)
    ]
    if angles and speeds:
        if pairs or fits(angles[0], speeds[0], max(reach, _APART)):
            return angle, speed
        size = UNITS[angles[0]].factor / abs(found.factor) / UNITS[speeds[0]].factor
        told = f"units disagree: in them it is {size:.4g} times less than the derivative of `{angle.name}`"
        doubt = f"by its unit and that of `{speed.name}`, the one is {size:.4g} times less than the other's derivative"
        return replace(angle, doubt=f"{doubt}: one of them is wrong"), replace(speed, reasons=(*speed.reasons, told))
    if len(pairs) != 1:
        return angle, speed
    by = f"unit by the factor {found.factor:.4g} of its derivative to `{speed.name}`"
    if not angle.states_unit:
        angle = replace(angle, implied=pairs[0][0], implied_by=by)
    if not speed.states_unit:
        by = f"unit by the factor {found.factor:.4g} to the derivative of `{angle.name}`"
        speed = replace(speed, implied=pairs[0][1], implied_by=by)
    return angle, speed


def _find_drives(signals: dict[str, Signal], comparison: Comparison) -> None:
    """Takes an unnamed signal that goes with an acceleration for what drives, where nothing else says what does."""
    if any(one.role in DRIVING and one.is_sure for one in signals.values()):
        return
    motions = [one for one in signals.values() if one.role in MOVING and not one.commanded]
    for name, one in list(signals.items()):
        if one.is_sure or one.by == "relation" or one.twin or one.role in ("angle", "position"):
            continue
        rated = [
            (same_joint(m, one), comparison.like(m, one, derivatives(m.role)).correlation, m.name)
            for m in motions
            if m.name != name
        ]
        _, best, motion = max((one for one in rated if one[1] > _DRIVES), default=(False, 0.0, ""))
        if best > _DRIVES:
            told = f"goes with the acceleration of `{motion}` (correlation {best:.2f})"
            signals[name] = _taken(one, one.role if one.role in DRIVING else "torque", told)


def derivatives(role: Role) -> int:
    """Returns how many derivatives lead from a motion to its acceleration."""
    return {"speed": 1, "acceleration": 0}.get(role, 2)


def _find_commands(signals: dict[str, Signal], comparison: Comparison) -> None:
    """Tells commands, which come first, from what was measured of the same kind."""
    driven = any(one.role in DRIVING and one.is_sure for one in signals.values())
    for first, second in combinations(list(signals), 2):
        a, b = signals[first], signals[second]
        if a.twin or b.twin or a.role != b.role or a.role not in MOVING or not same_joint(a, b):
            continue
        like = comparison.like(a, b, 0)
        if like.correlation < _FOLLOWS:
            continue
        if is_desired(a.name, b.name) or is_desired(b.name, a.name):
            desired = a if is_desired(a.name, b.name) else b
            signals[desired.name] = replace(desired, commanded=True)
            continue
        lead, follow, delay = (a, b, like.delay) if like.delay > 0 else (b, a, -like.delay)
        told = f"`{follow.name}` follows it after {delay:.2g} samples"
        # Where a torque is known, angles that follow each other are a motor's and its load's.
        if lead.commanded or (delay > _LEADS and not driven and not any(one.hint.commanded for one in (a, b))):
            signals[lead.name] = replace(lead, commanded=True, reasons=(*lead.reasons, told))
