"""All that is found in a log, and the mapping that is proposed for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.logs.bridging import longest_bridged
from robid.logs.inspection.channels import Chosen, choose, propose_inputs, propose_outputs, propose_references
from robid.logs.inspection.contents import Column, Contents, Numbered, join_contents, part_numbered, read_contents
from robid.logs.inspection.excitation import (
    Proposal,
    Shared,
    carrying_lines,
    cut_periods,
    energy_band,
    is_broad,
    is_resolved,
    measure_period,
    moves_far,
    propose_band,
    propose_lines,
    share_period,
    shorten,
    unsettled,
)
from robid.logs.inspection.instants import in_order, newest_last, on_common_instants, taken_evenly, time_going_on
from robid.logs.inspection.names import DRIVING, MOVING, read_names
from robid.logs.inspection.quality import judge
from robid.logs.inspection.roles import Comparison, Signal, find_roles
from robid.logs.inspection.sampling import Sampling, find_sampling
from robid.logs.pace import JITTER, longest_piece, roundest
from robid.logs.parts import limits_of
from robid.logs.period import Repetition
from robid.signals.log_options import TIME_UNITS, Dialect, LogFormat

_MEASURED = 24  # signals whose period is measured at most
_UNKNOWN_STEP_S = 1e-3
_NEAR = 0.03  # relative distance from the usual step of an uneven clock within which its even steps are chosen
_LAST = 1e-3  # steps that a time may lack of a whole number of them
_ROUND = 1e-9
_FEWEST = 100  # even samples from which a part of an uneven clock is worth looking at
_SCATTERED = 0.5  # share of the log in its longest part without a gap below which its gaps are those of an uneven clock
_REST = 0.25  # share of a period beyond whole ones from which the periods are counted from the end


@dataclass(frozen=True)
class Findings:
    """What is in a log."""

    contents: Contents
    sampling: Sampling
    signals: tuple[Signal, ...]  # The signals that share their samples with the mapping's, and what each is
    others: tuple[Column, ...]  # Signals of other lengths or topics
    periods: Mapping[str, Repetition]  # How signals repeat, by name
    shared: Shared | None  # The period that the inputs have, None where nothing repeats
    lines: IntArray  # Lines of it that carry energy
    proposal: Proposal
    n_sample: int
    # The recordings of which they are the first one; None where the log is a single one
    numbered: Numbered | None = None
    # From where to where its signals were brought from an uneven clock to even steps, zeros for all of it; None where
    # they are as they were recorded [s]
    evened_s: tuple[float, float] | None = None

    @property
    def is_evened(self) -> bool:
        """Whether its signals were brought from an uneven clock to even steps."""
        return self.evened_s is not None

    @property
    def step_s(self) -> float:
        """The sampling period, a guess where nothing tells it [s]."""
        return self.sampling.step_s or _UNKNOWN_STEP_S

    @property
    def duration_s(self) -> float:
        """How long the log lasts, gaps included [s]."""
        return (self.n_sample + (0 if self.is_evened else self.sampling.missing)) * self.step_s

    @property
    def unbroken(self) -> slice:
        """The longest part without a gap."""
        return slice(*self.sampling.longest) if self.has_gaps else slice(0, self.n_sample)

    @property
    def has_gaps(self) -> bool:
        """Whether samples are missing that its other samples cannot make good."""
        return bool(self.sampling.gaps) and not self.is_evened


def inspect_log(
    files: Sequence[Path],
    format_: LogFormat | None = None,
    dialect: Dialect | None = None,
    sampling_period_s: float | None = None,
    tell: Callable[[str], None] = lambda _: None,
) -> Findings:
    """Finds what is in a log, of one file or several; what is not stated of it is told from it, what is done by `tell`.

    Raises:
        DataError: If it cannot be read, or holds no signals.
    """
    tell("reading")
    contents = join_contents([read_contents(file, format_, dialect) for file in files])
    contents = in_order(time_going_on(newest_last(contents)))
    numbered, single = part_numbered(contents.columns)
    if numbered is not None:
        told = f"{numbered.told}: the first one is looked at."
        contents = replace(contents, columns=tuple(single), notes=(*contents.notes, told))
    contents = on_common_instants(contents)
    group = _main_group(contents.columns)
    sampling = find_sampling(group, contents.scalars, sampling_period_s)
    if sampling.variable and sampling.jitter > JITTER:
        contents = taken_evenly(contents, group, sampling.variable, sampling.unit)
        group = _main_group(contents.columns)
        sampling = find_sampling(group, contents.scalars, sampling_period_s)
    found = _findings(contents, group, sampling, numbered, tell)
    step_s = _whole_step(found)
    if step_s is not None:  # nothing else decides the steps that an uneven clock is brought to
        found = _findings(contents, group, replace(sampling, step_s=step_s), numbered, tell)
    return found


def _findings(
    contents: Contents,
    group: Sequence[Column],
    sampling: Sampling,
    numbered: Numbered | None,
    tell: Callable[[str], None],
) -> Findings:
    """Finds what the signals of one length are, how they repeat, and what to propose."""
    others = tuple(one for one in contents.columns if all(one is not member for member in group))
    columns = [one for one in group if one.name != sampling.variable and one.key not in sampling.others]
    judged = [judge(one.values) for one in columns]
    part_s, columns = _evened(columns, next((one for one in group if one.name == sampling.variable), None), sampling)
    tell("comparing signals")
    comparison = Comparison(sampling.step_s or _UNKNOWN_STEP_S, is_known=sampling.step_s is not None)
    signals = find_roles(columns, judged, comparison)
    chosen = choose(signals)
    tell("measuring periods")
    found = Findings(
        contents,
        sampling,
        tuple(signals),
        others,
        {},
        None,
        np.zeros(0, int),
        Proposal((), (), (), None),
        len(columns[0].values) if columns else len(group[0].values),
        numbered,
        evened_s=part_s,
    )
    found = _with_periods(found, chosen)
    return replace(found, proposal=_propose(found, chosen, comparison))


def _whole_step(found: Findings) -> float | None:
    """Even steps for an uneven clock of which a period has a whole number, as round as can be; None for those it has.

    [s]
    """
    if found.evened_s is None or found.shared is None or found.sampling.step_s is None:
        return None
    known, step_s = found.shared, found.sampling.step_s
    reach = max(3 * known.std_samples, 1e-6 * known.samples)
    period_s = roundest((known.samples - reach) * step_s, (known.samples + reach) * step_s)
    counts = range(int(np.ceil((1 - _NEAR) * known.samples)), int((1 + _NEAR) * known.samples) + 1)

    def rank(count: int) -> tuple[int, float]:
        step = period_s / count
        digits = next((one for one in range(1, 9) if abs(float(f"{step:.{one}g}") / step - 1) < _ROUND), 9)
        return digits, abs(count - known.samples)

    best = period_s / min(counts, key=rank) if len(counts) else step_s
    return None if abs(best / step_s - 1) < _ROUND else best


def _evened(
    columns: list[Column], clock: Column | None, sampling: Sampling
) -> tuple[tuple[float, float] | None, list[Column]]:
    """Signals at even steps of an uneven clock, by straight lines: what is found in them is coarser than the import.

    Returns:
        From where to where the clock can be made good, None where it is even or cannot be read; and the signals there.
    """
    if clock is None or sampling.step_s is None or sampling.backward:
        return None, columns
    if sampling.jitter <= JITTER and not sampling.gaps:
        return None, columns
    time_s = (clock.values - clock.values[0]) * TIME_UNITS[sampling.unit]
    moving = [one for one, hint in zip(columns, read_names(columns), strict=True) if hint.role in (*DRIVING, *MOVING)]
    followed = [_filled(one.values) for one in moving]
    bridged_s = longest_bridged(time_s, followed, sampling.step_s) if sampling.gaps else np.inf
    begin, end = longest_piece(np.flatnonzero(np.diff(time_s) > bridged_s), len(time_s))
    whole = sampling.longest[1] - sampling.longest[0]
    if sampling.jitter <= JITTER and end - begin <= whole and whole >= _SCATTERED * len(clock.values):
        return None, columns  # nothing is gained over its longest part without a gap
    steps = (time_s[end - 1] - time_s[begin]) / sampling.step_s
    even = time_s[begin] + sampling.step_s * np.arange(int(steps + _LAST) + 1)
    if len(even) < _FEWEST:
        return None, columns
    made = [replace(one, values=np.asarray(np.interp(even, time_s, one.values))) for one in columns]
    return (0.0, 0.0) if end - begin == len(time_s) else limits_of(time_s, begin, max(end - 1, begin + 1)), made


def _main_group(columns: Sequence[Column]) -> list[Column]:
    """The signals of one length and topic that are most likely the recording."""
    groups: dict[tuple[int, str], list[Column]] = {}
    for one in columns:
        groups.setdefault((len(one.values), one.group), []).append(one)

    def worth(members: list[Column]) -> tuple[int, int]:
        roles = [hint.role for hint in read_names(members)]
        driven = any(role in DRIVING for role in roles) + any(role in MOVING for role in roles)
        return driven, len(members) * len(members[0].values)

    return max(groups.values(), key=worth)


def _with_periods(found: Findings, chosen: Chosen) -> Findings:
    commands = [one for one in chosen.references if one.role in (*MOVING, *DRIVING)]
    leading = [one.name for one in (*commands, *chosen.inputs)]
    looked = list(dict.fromkeys([*leading, *(one.name for one in chosen.outputs)]))
    further = [one for one in found.signals if not (one.twin or one.quality.is_still or one.quality.missing)]
    looked += [one.name for one in further if one.role != "other" and one.name not in looked]
    by_name = {one.name: one for one in found.signals}
    part = found.unbroken
    periods = {name: measure_period(_filled(by_name[name].column.values[part])) for name in looked[:_MEASURED]}
    count = part.stop - part.start
    shared = share_period(periods, [name for name in leading if name in periods], count)
    if shared is None:  # commands of what turns on do not repeat where their torques do
        shared = share_period(periods, [one.name for one in chosen.inputs if one.name in periods], count)
    if shared is None or shared.held < 2 or not chosen.inputs:
        return replace(found, periods=periods)
    blocks = {
        one.name: cut_periods(_filled(one.column.values[part]), shared.whole, last=from_end(shared))
        for one in (*chosen.inputs, *chosen.outputs)
    }
    settling = {name: unsettled(block) for name, block in blocks.items()}
    transient = tuple(name for name, count in settling.items() if count)
    lines = carrying_lines([blocks[one.name] for one in chosen.inputs])
    if len(lines) == 0:
        return replace(found, periods=periods)
    shared, lines = shorten(replace(shared, transient=transient, settling=max(settling.values())), lines)
    return replace(found, periods=periods, shared=shared, lines=lines)


def from_end(shared: Shared) -> bool:
    """Returns whether the log begins within a period, so that periods are counted from its end."""
    return shared.held - int(shared.held) > _REST


def _propose(found: Findings, chosen: Chosen, comparison: Comparison) -> Proposal:
    band = _band(found, chosen)
    made = Proposal(
        propose_inputs(chosen, comparison, band),
        propose_outputs(chosen, comparison, band),
        propose_references(chosen),
        None,
        resample="time" if found.is_evened or (found.sampling.variable and found.sampling.jitter > JITTER) else "",
    )
    made = replace(made, is_motion=found.numbered is None and _is_motion(found, chosen, made))
    if found.evened_s is not None and found.evened_s[1]:
        made = replace(made, part_s=found.evened_s)
    repeats = found.shared is not None and len(found.lines)
    if found.has_gaps and found.sampling.step_s and (made.resample or not repeats):
        made = replace(made, part_s=found.sampling.longest_s)
    if found.shared is None or not len(found.lines):
        count, part = len(chosen.inputs), found.unbroken
        duration_s = (part.stop - part.start) * found.step_s
        told_apart = count == 1 or (count > 1 and chosen.by_torque)
        broad = told_apart and not made.is_motion and is_broad(band, found.step_s, duration_s)
        if broad:  # half of the energy of the slowest input is below this frequency [Hz]
            halves = [energy_band(_filled(one.column.values), found.step_s, 0.0)[0] for one in chosen.inputs]
            if is_resolved(band, min(halves), duration_s, count):
                return replace(made, excitation=propose_band(band, duration_s, count))
        return replace(made, one_shot=True)
    shared = found.shared
    drop, count, last = _place(found, shared, cut=made.part_s is not None)
    repetition = Repetition(shared.samples, shared.std_samples, reachable=True)
    drifts = repetition.drifts(count, shared.whole, found.lines)
    return replace(
        made,
        excitation=propose_lines(shared, found.lines, found.step_s),
        periods=count,
        drop_periods=drop,
        take_last=last,
        resample="period" if drifts and not made.resample else made.resample,
    )


def _is_motion(found: Findings, chosen: Chosen, made: Proposal) -> bool:
    """Whether several motors move far and slowly."""
    if len(chosen.inputs) < 2 or not chosen.by_torque:
        return False
    motions = [values for one in made.outputs if (values := one.in_unit("rad", "m")) is not None]
    motions, torques = (
        [_filled(values)[found.unbroken] for values in every]
        for every in (motions, [one.column.values for one in chosen.inputs])
    )
    return moves_far(motions, torques, found.step_s)


def _place(found: Findings, shared: Shared, *, cut: bool) -> tuple[int, int, bool]:
    """Periods to drop and to use, and whether they are counted from the end: those without a gap.

    Where the log is cut to its longest part without a gap, they are counted in that.
    """
    part, whole = found.unbroken, shared.whole
    drop, count, last = 0, int(shared.held), from_end(shared)
    if found.has_gaps and not cut:
        drop = -(-part.start // whole)
        inside = part.stop // whole - drop
        last = part.stop == found.n_sample and count > inside
        drop, count = (0, count) if last else (drop, max(inside, 1))
    settles = 0 if last or part.start else min(shared.settling, max(count - 2, 0))
    return drop + settles, count - settles, last


def _band(found: Findings, chosen: Chosen) -> tuple[float, float]:
    """Lowest and highest frequency that carries energy of the inputs [Hz]."""
    if found.shared is not None and len(found.lines):
        period_s = found.shared.whole * found.step_s
        return float(found.lines[0] / period_s), float(found.lines[-1] / period_s)
    bands = [energy_band(_filled(one.column.values), found.step_s) for one in chosen.inputs]
    nyquist = 0.4 / found.step_s
    low = min((one[0] for one in bands), default=1 / found.duration_s)
    return low, min(max((one[1] for one in bands), default=nyquist), nyquist)


def _filled(values: FloatArray) -> FloatArray:
    return np.asarray(np.where(np.isfinite(values), values, np.nanmean(values)))
