"""Imports logs into records and refuses what cannot be trusted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray, IntArray, check_shape
from robid.errors import DataError
from robid.logs.checks import check_mapping, check_shot, still_note
from robid.logs.columns import check_lengths, check_motion, read_columns
from robid.logs.lines import check_found, find_lines, found_note
from robid.logs.mapping import LogMapping
from robid.logs.match import Match, PlayedExcitation, check_size, explain_mismatch, find_periods
from robid.logs.period import measure_repetition
from robid.logs.period_checks import Stated, check_period
from robid.logs.resample import resample_to_period, resample_to_time
from robid.logs.samples import channel_values, sample_channels
from robid.logs.timing import Clock, check_count, check_segment, check_steps, clock_problems, read_clock
from robid.signals.log_channels import LogChannel
from robid.signals.quantities import INJECTED, Channel, motor_channels
from robid.signals.record import Record


def import_log(
    mapping: LogMapping,
    *,
    samples_per_period: int,
    periods: int,
    excited_lines: IntArray,
    configurations: FloatArray,
    detection_lines: IntArray | None = None,
    played: PlayedExcitation | None = None,
    find: bool = False,
) -> Record:
    """Imports one realization of one experiment in one configuration.

    Outputs stay as they were measured, less the first sample that is used; drift is left to the estimate. Where
    references were logged, the periods begin where they match the excitation.

    Args:
        mapping: File, channels, units, sampling period and dropped periods.
        samples_per_period: Samples of one period.
        periods: Periods to import after the dropped ones.
        excited_lines (n_freq,): Lines that were excited.
        configurations (1, n_joint): Arm-side joint angles [rad].
        detection_lines (n_detection,): Lines of the band that were left out on purpose, or None.
        played: What the references are matched to; needed where the mapping has references.
        find: Whether the excited lines are only candidates, of which the data show those that are meant.

    Raises:
        SettingsError: If the mapping contradicts itself or names an unknown unit.
        DataError: If the log is missing, unreadable or not what was said; every problem at once.
    """
    check_shape("configurations", configurations, "n_conf n_joint", n_conf=1)
    check_mapping(mapping, samples_per_period, excited_lines, "" if played is None else played.kind)
    stated = Stated(mapping.sampling_period_s, samples_per_period, periods, mapping.drop_periods, excited_lines, find)
    log, problems, notes = _read(mapping)
    problems += check_motion(mapping, log.columns) if mapping.takes_turns else []
    if mapping.resample == "period" and not problems:
        log, told = _to_period(mapping, log, stated)
        notes += told
    if played is not None and mapping.references:
        start, found, told = _match(mapping, log, played, stated)
    else:
        start, found, told = _place(mapping, log, stated)
    used, columns = slice(start, start + periods * samples_per_period), log.columns
    notes += told
    found += [] if log.clock is None else check_steps(log.clock, used, samples_per_period)
    _raise(mapping.file, problems + found)
    if find:
        excited_lines, line_note = _found_lines(mapping, columns, used, periods, excited_lines)
        notes.append(line_note)
    record = sample_channels(mapping, columns, used, periods)
    return replace(
        record,
        configurations=configurations,
        reference=None if played is None else played.expected[None, None, None],
        reference_channels=() if played is None else _played_channels(mapping, played),
        excited_lines=np.asarray(excited_lines),
        detection_lines=np.zeros(0, int) if detection_lines is None else np.asarray(detection_lines),
        notes=(*_notes(mapping), *record.notes, *notes),
    )


def import_shot(mapping: LogMapping) -> Record:
    """Imports a log that does not repeat, all of its samples, whatever was played.

    The record has no excited lines and no configuration to rest in; the references are those of the log. Channels
    may be constant, as those of a joint that stands still: a note names them.

    Args:
        mapping: File, channels, units and sampling period.

    Raises:
        SettingsError: If the mapping contradicts itself or names an unknown unit.
        DataError: If the log is missing, unreadable or not what was said; every problem at once.
    """
    check_shot(mapping)
    log, problems, notes = _read(mapping)
    problems += [] if log.clock is None else clock_problems(log.clock)
    problems += [] if log.clock is None else check_steps(log.clock, slice(None))
    _raise(mapping.file, problems)
    columns = log.columns
    still = still_note(mapping, columns)
    record = sample_channels(mapping, columns, slice(None), 1)
    record = _with_logged_references(record, mapping, columns, slice(None))
    return replace(record, notes=(*record.notes, *notes, *still))


def _with_logged_references(
    record: Record, mapping: LogMapping, columns: Mapping[str, NDArray[Any]], used: slice
) -> Record:
    """The record with the references of its log, where it has some, and what is to be said of its torque."""
    record = replace(record, notes=(*_notes(mapping), *record.notes))
    if not mapping.references:
        return record
    reference = channel_values(mapping.references, columns, used)[None, None, None]
    channels = tuple(channel.channel for channel in mapping.references)
    return replace(record, reference=reference, reference_channels=channels)


def import_arbitrary(
    mapping: LogMapping, *, segment_samples: int, lines: IntArray, configurations: FloatArray
) -> Record:
    """Imports a log of an arbitrary signal around a configuration: as many segments as it holds, whatever was played.

    Args:
        mapping: File, channels, units and sampling period; references are those of the log.
        segment_samples: Samples of one over the resolution.
        lines (n_freq,): Lines of a segment where a response is wanted.
        configurations (1, n_joint): Arm-side joint angles [rad].

    Raises:
        SettingsError: If the mapping contradicts itself or names an unknown unit.
        DataError: If the log is missing, unreadable, too short or not what was said; every problem at once.
    """
    check_shot(mapping)
    log, problems, notes = _read(mapping)
    problems += check_motion(mapping, log.columns) if mapping.takes_turns else []
    segments = log.n_sample // segment_samples
    problems += [] if segments or not log.n_sample else check_segment(mapping, log.n_sample, segment_samples)
    start = log.n_sample - segments * segment_samples if mapping.take == "last" else 0
    used = slice(start, start + segments * segment_samples)
    problems += [] if log.clock is None else [*clock_problems(log.clock), *check_steps(log.clock, used)]
    _raise(mapping.file, problems)
    record = _with_logged_references(sample_channels(mapping, log.columns, used, 1), mapping, log.columns, used)
    return replace(
        record,
        configurations=configurations,
        excited_lines=np.asarray(lines) * segments,
        segments=segments,
        notes=(*record.notes, *notes),
    )


def join_shots(records: list[Record], n_experiment: int = 1) -> Record:
    """Joins repeated shots, realization by realization, cut to the shortest, which is noted."""
    lengths = {record.inputs.shape[4] for record in records}
    shortest = min(lengths)
    cut = [
        replace(
            record,
            inputs=record.inputs[..., :shortest, :],
            outputs=record.outputs[..., :shortest, :],
            reference=None if record.reference is None else record.reference[..., :shortest, :],
        )
        for record in records
    ]
    joined = join_experiments(cut, n_experiment)
    told = f"The shots have {shortest} to {max(lengths)} samples; all were cut to the shortest."
    return joined if len(lengths) == 1 else replace(joined, notes=(*joined.notes, told))


def join_experiments(records: list[Record], n_experiment: int) -> Record:
    """Joins records of single experiments in one configuration.

    Args:
        records: One record of each experiment, realization by realization.
        n_experiment: Experiments in a realization.

    Returns:
        The record (1, n_real, n_exp, ...), its angles relative to the first experiment's offset.
    """
    first = records[0]
    if len(records) == 1:
        return first

    def joined(parts: list[FloatArray]) -> FloatArray:
        return np.stack(parts).reshape(1, -1, n_experiment, *parts[0].shape[3:])

    offset = first.output_offset
    return replace(
        first,
        inputs=joined([record.inputs for record in records]),
        outputs=joined([record.outputs + (record.output_offset - offset) for record in records]),
        reference=None
        if first.reference is None
        else joined([r.reference for r in records if r.reference is not None]),
        notes=tuple(dict.fromkeys(note for record in records for note in record.notes)),
    )


@dataclass(frozen=True)
class _Log:
    """The columns of a log, and its own time where it has one that can be read."""

    columns: dict[str, NDArray[Any]]
    clock: Clock | None

    @property
    def n_sample(self) -> int:
        """Samples of the shortest column."""
        return min((len(column) for column in self.columns.values()), default=0)


def _read(mapping: LogMapping) -> tuple[_Log, list[DataError], list[str]]:
    """Reads a log, checks each column for itself, their lengths and the time, and resamples it to that if asked to."""
    columns, problems = read_columns(mapping)
    problems += check_lengths(mapping, columns)
    clock = None
    if mapping.time is not None and mapping.time.variable in columns:
        stamps = columns[mapping.time.variable]
        if np.all(np.isfinite(stamps)):
            clock, found = read_clock(mapping, stamps)
            problems += found
    notes: list[str] = []
    if mapping.resample == "time" and clock is not None and not problems:
        columns, clock, notes = resample_to_time(mapping, columns, clock)
    return _Log(columns, clock), problems, notes


def _strongest(
    mapping: LogMapping, log: _Log, channels: Sequence[LogChannel], start: int
) -> tuple[str, FloatArray] | None:
    """The channel that moves most from a sample on: where it comes from, and its samples."""
    usable = [channel for channel in channels if channel.column in log.columns]
    signals = [channel.factor * log.columns[channel.column][start:].astype(float) for channel in usable]
    finite = [(np.ptp(values), index) for index, values in enumerate(signals) if len(values) > 2]
    finite = [(size, index) for size, index in finite if np.isfinite(size) and size > 0]
    if not finite:
        return None
    strongest = max(finite)[1]
    return mapping.place(usable[strongest].column), signals[strongest]


def _to_period(mapping: LogMapping, log: _Log, stated: Stated) -> tuple[_Log, list[str]]:
    """Resamples a log so that the period of its strongest reference or input has its stated number of samples."""
    measured = mapping.references or mapping.inputs
    found = _strongest(mapping, log, measured, stated.dropped * stated.samples)
    if found is None:
        return log, []
    columns, notes = resample_to_period(mapping, log.columns, found[1], stated, found[0])
    return _Log(columns, None), notes


def _place(mapping: LogMapping, log: _Log, stated: Stated) -> tuple[int, list[DataError], list[str]]:
    """First sample that is used where the log has no references; checks the period on the input that moves most."""
    start = stated.dropped * stated.samples
    problems = check_count(mapping, log.n_sample, stated.samples, stated.periods) if log.n_sample else []
    if mapping.take == "last":
        start = max(log.n_sample - stated.periods * stated.samples, 0)
    strongest = _strongest(mapping, log, mapping.inputs, 0 if problems else start)
    if strongest is None:
        return start, problems, []
    found, notes = check_period(*strongest, stated, log.clock)
    # A wrong period is why a log holds too few of it.
    return start, found or problems, notes


def _found_lines(
    mapping: LogMapping, columns: Mapping[str, NDArray[Any]], used: slice, periods: int, candidates: IntArray
) -> tuple[IntArray, str]:
    """The excited lines that the inputs show, and what to say about them."""
    inputs = channel_values(mapping.inputs, columns, used)
    found = find_lines([values.reshape(periods, -1) for values in inputs.T], candidates)
    _raise(mapping.file, check_found(f"{mapping.file}: inputs", found, candidates))
    return found, found_note(found, len(candidates))


def _match(
    mapping: LogMapping, log: _Log, played: PlayedExcitation, stated: Stated
) -> tuple[int, list[DataError], list[str]]:
    """First sample that is used, where the logged references show which periods were played."""
    names = tuple(channel.name for channel in mapping.references)
    where = f"{mapping.file}: references"
    found = [log.columns.get(channel.column) for channel in mapping.references]
    kept = [column for column in found if column is not None and np.all(np.isfinite(column))]
    if len(kept) < len(names) or len({len(column) for column in kept}) > 1:
        return 0, [], []
    logged = np.stack(kept, axis=-1).astype(float) * [channel.factor for channel in mapping.references]
    n_sample = len(played.expected)
    wanted = stated.dropped + stated.periods
    if len(logged) < wanted * n_sample:
        return 0, check_count(mapping, len(logged), n_sample, stated.periods), []
    match = find_periods(logged, played.expected)
    if match.count < wanted:
        return 0, _unmatched(mapping, logged, played, stated, log.clock), []
    stop = match.start + match.count * n_sample
    steady = logged[match.start : stop, int(np.argmax(np.ptp(logged, axis=0)))]
    problems, notes = check_period(where, steady, stated, log.clock)
    sizes, size_notes = _sizes(mapping, match, played)
    problems += sizes
    first = match.count - stated.periods if mapping.take == "last" else stated.dropped
    return match.start + first * n_sample, problems, [*notes, *size_notes]


def _sizes(mapping: LogMapping, match: Match, played: PlayedExcitation) -> tuple[list[DataError], list[str]]:
    """Says which logged references differ in size from the excitation, as a wrong unit or scale makes them."""
    names = tuple(channel.name for channel in mapping.references)
    sizes, notes = check_size(match.gain, names, np.sqrt(np.mean(played.expected**2, axis=0)))
    if not sizes:
        return [], notes
    what = f"The references differ in size from the excitation: {'; '.join(sizes)}."
    remedy = "Correct their unit or scale, or set excitation.rms to what was played and design again."
    return [DataError(what, where=f"{mapping.file}: references", remedy=remedy)], notes


def _unmatched(
    mapping: LogMapping, logged: FloatArray, played: PlayedExcitation, stated: Stated, clock: Clock | None
) -> list[DataError]:
    """Says why a log does not hold the periods that are needed."""
    names = tuple(channel.name for channel in mapping.references)
    where, n_sample = f"{mapping.file}: references", len(played.expected)
    match = find_periods(logged, played.expected)
    if match.count == 0:
        what, remedy = explain_mismatch(logged, played, names)
        return [DataError(what, where=where, remedy=remedy)]
    steady = logged[match.start :, int(np.argmax(np.ptp(logged, axis=0)))]
    # Where samples were lost on the way nothing repeats, and the count says more.
    if measure_repetition(steady, n_sample, stated.lines).samples is not None:
        problems, _ = check_period(where, steady, stated, clock)
        if problems:
            return problems
    stop = match.start + match.count * n_sample
    what = (
        f"The excitation is there from sample {match.start} to {stop}, {match.count} whole periods, fewer than the"
        f" {stated.dropped + stated.periods} that were said ({stated.dropped} dropped and {stated.periods} used)."
    )
    fewer = match.count - stated.dropped
    shorter = f"set periods to {fewer}" if fewer > 0 else "record longer"
    remedy = f"Look for lost samples after sample {stop}, or {shorter}."
    # A wrong size would only come up once the count is right.
    return [DataError(what, where=where, remedy=remedy), *_sizes(mapping, match, played)[0]]


def _played_channels(mapping: LogMapping, played: PlayedExcitation) -> tuple[Channel, ...]:
    """What the columns of the matched excitation are, in the order of the inputs."""
    return motor_channels((channel.name for channel in mapping.inputs), INJECTED[played.kind])


def _notes(mapping: LogMapping) -> list[str]:
    """What the reader of the record has to know about its torque."""
    notes = []
    for channel in mapping.inputs:
        if channel.normalised:
            notes.append(
                f"The torque constant K_t of {channel.name} is unknown: the torque is a current in A, and only ratios"
                " to K_t are identified (stiffness/K_t, damping/K_t, inertia/K_t)."
            )
        elif channel.torque_constant_relative_std:
            notes.append(
                f"The torque constant of {channel.name} is known to {100 * channel.torque_constant_relative_std:.3g} %"
                " (1 sigma): this error is common to all stiffnesses, dampings and inertias."
            )
    return notes


def _raise(file: Path, problems: list[DataError]) -> None:
    """Raises one problem as it is, several as one error; does nothing when there are none."""
    if len(problems) == 1:
        raise problems[0]
    if problems:
        raise DataError("\n".join([f"{len(problems)} problems", *map(str, problems)]), where=str(file))
