"""Imports logs into records and refuses what cannot be trusted; joins the records of experiments and shots."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np

from robid.arrays import FloatArray, IntArray, check_shape, part_of
from robid.errors import DataError
from robid.logs.clocks import Log, on_one_clock
from robid.logs.columns import check_lengths, check_motion, check_values, read_columns
from robid.logs.mapping import Columns, LogMapping, Stated, check_mapping, check_shot, check_wraps, still_note
from robid.logs.parts import chosen_part, followed_across, part_notes, whole_piece, without_missing
from robid.logs.period import check_found, find_lines, found_note
from robid.logs.period_checks import OtherPeriodError
from robid.logs.placing import PlayedExcitation, check_band, match_periods, place_periods, strongest_channel
from robid.logs.resample import resample_to_period, resample_to_time
from robid.logs.timing import check_segment, check_steps, clock_problems, even_stamps, read_clock
from robid.signals.log_channels import LogChannel
from robid.signals.pose import POSE, displacement, rotation_from_zyx
from robid.signals.quantities import INJECTED, motor_channels
from robid.signals.record import Record


def channel_values(channels: Sequence[LogChannel], columns: Columns, used: slice) -> FloatArray:
    """Returns samples (n_sample, n_channel) in the channels' units."""
    return np.stack([channel.factor * columns[channel.column][used].astype(float) for channel in channels], axis=-1)


def _seen_from_home(
    mapping: LogMapping, key: Literal["inputs", "outputs"], values: FloatArray
) -> tuple[FloatArray, tuple[str, ...]]:
    """Signals whose pose is a displacement from home where it was absolute, and what to say about it."""
    if mapping.pose is None or key not in mapping.pose.absolute:
        return values, ()
    names = [channel.name for channel in getattr(mapping, key)]
    at = [names.index(name) for name in POSE]
    home = values[0, at] if mapping.pose.stated is None else mapping.pose.stated
    turned = values.copy()
    rotations = rotation_from_zyx(values[:, at[3:]])
    turned[:, at] = displacement(home[:3], rotation_from_zyx(home[3:]), values[:, at[:3]], rotations)
    shown = ", ".join(f"{value:.4g}" for value in (*home[:3], *np.rad2deg(home[3:])))
    told = f"The {key} are displacements in the tool frame of the home pose {shown} (X Y Z in m, A B C in deg)."
    return turned, (told,)


def sample_channels(mapping: LogMapping, columns: Columns, used: slice, periods: int) -> Record:
    """Returns the record of some samples of a log, without what was played."""
    inputs, told = _seen_from_home(mapping, "inputs", channel_values(mapping.inputs, columns, used))
    outputs, further = _seen_from_home(mapping, "outputs", channel_values(mapping.outputs, columns, used))
    return Record(
        sampling_period_s=mapping.sampling_period_s,
        inputs=inputs.reshape(1, 1, 1, periods, -1, inputs.shape[-1]),
        outputs=(outputs - outputs[0]).reshape(1, 1, 1, periods, -1, outputs.shape[-1]),
        output_offset=outputs[:1] - [channel.factor * channel.zero for channel in mapping.outputs],
        input_channels=tuple(channel.channel for channel in mapping.inputs),
        output_channels=tuple(channel.channel for channel in mapping.outputs),
        input_hold=mapping.inputs[0].hold,
        input_relative_std=np.array([channel.torque_constant_relative_std for channel in mapping.inputs]),
        notes=(*told, *further),
    )


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
    listed: bool = False,
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
        listed: Whether they were listed one by one.

    Raises:
        SettingsError: If the mapping contradicts itself or names an unknown unit.
        DataError: If the log is missing, unreadable or not what was said; every problem at once.
    """
    check_shape("configurations", configurations, "n_conf n_joint", n_conf=1)
    check_mapping(mapping, samples_per_period, excited_lines, "" if played is None else played.kind)
    step_s, dropped = mapping.sampling_period_s, mapping.drop_periods
    stated = Stated(step_s, samples_per_period, periods, dropped, excited_lines, find, listed, mapping.differs)
    log, problems, notes = _read(mapping, stated)
    problems += check_band(mapping, log, excited_lines / stated.period_s)
    problems += check_motion(mapping, log.columns) if mapping.takes_turns else []
    if mapping.resample == "period" and not problems:
        log, told = _to_period(mapping, log, stated)
        notes += told
    if played is not None and mapping.references:
        start, found, told = match_periods(mapping, log, played, stated)
    else:
        start, found, told = place_periods(mapping, log, stated)
    used, columns = slice(start, start + periods * samples_per_period), log.columns
    notes += told
    # By a period that is not the log's own the gaps between its periods would be counted wrongly.
    named = not any(isinstance(one, OtherPeriodError) for one in found)
    counted = mapping.take == "first" and not mapping.references
    found += [] if log.clock is None else check_steps(log.clock, used, stated, counted=counted, named=named)
    _raise(mapping.file, problems + found)
    if find:
        excited_lines, line_note = _found_lines(mapping, columns, used, periods, excited_lines)
        notes.append(line_note)
    record = sample_channels(mapping, columns, used, periods)
    return replace(
        record,
        configurations=configurations,
        reference=None if played is None else played.expected[None, None, None],
        reference_channels=()
        if played is None
        else motor_channels((channel.name for channel in mapping.inputs), INJECTED[played.kind]),
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


def _with_logged_references(record: Record, mapping: LogMapping, columns: Columns, used: slice) -> Record:
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
    problems += check_band(mapping, log, np.asarray(lines) / (segment_samples * mapping.sampling_period_s))
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


def _read(mapping: LogMapping, stated: Stated | None = None) -> tuple[Log, list[DataError], list[str]]:
    """Reads the used part of a log, checks its columns and its time, and resamples it to that if asked to."""
    read = read_columns(mapping)
    joined, problems = on_one_clock(mapping, read.streams, read.stamps, None if stated is None else stated.period_s)
    problems = [*read.problems, *problems, *check_lengths(mapping, joined.columns)]
    columns, even = even_stamps(mapping, joined.columns)
    part = chosen_part(mapping, columns)
    notes = [*read.notes, *joined.notes, *even, *part_notes(mapping, columns, part)]
    wraps = check_wraps(mapping, read.streams, part)
    problems += wraps.values()
    followed_s = followed_across(mapping, columns, part)
    whole = whole_piece(mapping, columns, part, stated, followed_s)
    columns, missing = {name: column[part] for name, column in columns.items()}, 0
    if mapping.resample == "time":
        columns, missing = without_missing(mapping, columns, followed_s)
    if missing:
        notes.append(f"{mapping.file.name}: {missing} rows in which values are missing were left out and interpolated.")
    faults = {name: check_values(mapping, {name: one}, part.start or 0, whole) for name, one in columns.items()}
    problems += [fault for found in faults.values() for fault in found]
    # What is wrong with a column would be told once more, or overflow, in all that follows.
    columns = {name: column for name, column in columns.items() if not (faults[name] or name in wraps)}
    clock = None
    if mapping.time is not None and mapping.time.variable in columns:
        stamps = columns[mapping.time.variable]
        if np.all(np.isfinite(stamps)):
            clock, found = read_clock(mapping, stamps)
            first = part.start or 0
            clock = None if clock is None else replace(clock, first=first, whole=whole, followed_s=followed_s)
            problems += found
    if mapping.resample == "time" and clock is not None and not problems:
        period_s = None if stated is None else stated.period_s
        columns, clock, told = resample_to_time(mapping, columns, clock, period_s)
        notes += told
    return replace(joined, columns=columns, clock=clock), problems, notes


def _to_period(mapping: LogMapping, log: Log, stated: Stated) -> tuple[Log, list[str]]:
    """Resamples a log so that the period of its strongest reference or input has its stated number of samples."""
    measured = mapping.references or mapping.inputs
    found = strongest_channel(mapping, log, measured, stated.dropped * stated.samples)
    if found is None:
        return log, []
    columns, notes = resample_to_period(mapping, log.columns, found[1], stated)
    return replace(log, columns=columns, clock=None), notes


def _found_lines(
    mapping: LogMapping, columns: Columns, used: slice, periods: int, candidates: IntArray
) -> tuple[IntArray, str]:
    inputs = channel_values(mapping.inputs, columns, used)
    found = find_lines([values.reshape(periods, -1) for values in inputs.T], candidates)
    _raise(mapping.file, check_found(f"{mapping.file}: inputs", found, candidates))
    return found, found_note(found, len(candidates))


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
        raise DataError("\n".join([f"D090 {len(problems)} problems", *map(str, problems)]), where=str(file))


def join_shots(records: list[Record], n_experiment: int = 1) -> Record:
    """Joins repeated shots, realization by realization, cut to the shortest, which is noted."""
    lengths = {record.inputs.shape[4] for record in records}
    shortest = min(lengths)
    cut = [part_of(record, "sample", slice(shortest)) for record in records]
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
