"""Checks of a log against what was said about it; each returns its problems."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError, SettingsError
from robid.logs.lines import check_lines
from robid.logs.mapping import LogMapping
from robid.logs.period import Repetition, measure_repetition
from robid.signals.log_channels import LogChannel, input_problems
from robid.signals.quantities import INJECTED, units_of

_STILL = "Constant in"

_JITTER = 0.05
"""Largest deviation of a time step from the sampling period, relative, that still counts as regular."""


def check_mapping(mapping: LogMapping, samples_per_period: int, lines: IntArray, kind: str = "") -> None:
    """Checks units, signs, torque constants and lines before the file is read.

    Args:
        mapping: The log mapping.
        samples_per_period: The stated period.
        lines (n_freq,): Lines that were said to be excited.
        kind: Kind of the excitation that references are matched to.

    Raises:
        SettingsError: With every contradiction.
    """
    problems = _channels(mapping)
    known = units_of(INJECTED[kind], rotation=True) if kind else ()
    for channel in mapping.references:
        if kind and channel.unit not in known:
            problems.append(f"{channel.name}: {channel.unit} is no unit of a {kind} (known: {', '.join(known)})")
    names = [channel.name for channel in mapping.inputs]
    if mapping.references and [channel.name for channel in mapping.references] != names:
        problems.append(f"the references must be those of the inputs, in their order: {', '.join(names)}")
    if not len(lines) or lines.min() < 1 or 2 * lines.max() >= samples_per_period:
        problems.append(f"the excited lines are not all within 1 to {(samples_per_period - 1) // 2}, below Nyquist")
    _refuse(mapping, problems)


def check_shot(mapping: LogMapping) -> None:
    """Checks units, signs and torque constants of a log of one shot before the file is read.

    Raises:
        SettingsError: With every contradiction.
    """
    _refuse(mapping, _channels(mapping))


def _refuse(mapping: LogMapping, problems: list[str]) -> None:
    if problems:
        raise SettingsError(
            "; ".join(problems), where=f"log mapping of {mapping.file}", remedy="Correct the acquire section."
        )


def _channels(mapping: LogMapping) -> list[str]:
    """What contradicts itself among the channels, whatever was played."""
    problems = []
    if not mapping.outputs:
        problems.append("there is no output channel")
    if not mapping.inputs:
        problems.append("there is no input channel")
    channels: list[LogChannel] = [*mapping.inputs, *mapping.outputs, *mapping.references]
    problems += [f"{channel.name}: {problem}" for channel in channels for problem in channel.problems()]
    problems += input_problems(mapping.inputs)
    problems += [f"{key}: {problem}" for key, problem in mapping.pose_problems()]
    for group in (mapping.inputs, mapping.outputs, mapping.references):
        names = [channel.name for channel in group]
        problems += [f"{name}: the name occurs twice" for name in dict.fromkeys(names) if names.count(name) > 1]
    return problems


def still_note(mapping: LogMapping, columns: Mapping[str, NDArray[Any]]) -> tuple[str, ...]:
    """Names the channels of one shot that never change: their joints stood still, or they were not connected.

    Raises:
        DataError: If no output changes, so that nothing moved.
    """
    outputs: list[LogChannel] = [*mapping.outputs]
    still = [one for one in (*mapping.inputs, *outputs, *mapping.references) if np.ptp(columns[one.column]) == 0]
    if all(channel in still for channel in outputs):
        raise DataError(
            "No output changes: nothing moved.",
            where=str(mapping.file),
            remedy="Check that the channels were connected and that their variables are the right ones.",
        )
    told = ", ".join(f"`{channel.variable}` ({columns[channel.column][0]:g})" for channel in still)
    return (f"{_STILL} {mapping.file.name}: {told}; right only where these joints stood still.",) if still else ()


def is_still_note(note: str) -> bool:
    """Whether a note of a record names channels that never change."""
    return note.startswith(_STILL)


def check_time(mapping: LogMapping, variable: str, stamps: FloatArray, to_seconds: float) -> list[DataError]:
    """Compares the time stamps with the sampling period: unit, rate, order, gaps, jitter."""
    where = f"{mapping.file}: variable `{variable}`"
    stated = mapping.sampling_period_s
    steps = np.diff(stamps.astype(float)) * to_seconds
    usual = float(np.median(steps))
    backward = np.flatnonzero(steps <= 0)
    if len(backward):
        what = f"Time does not advance after sample {backward[0]} ({len(backward)} such steps)."
        remedy = "Sort the log by time and drop repeated samples, or leave out `time`."
        return [DataError(what, where=f"{where}, sample {backward[0]}", remedy=remedy)]
    exponent = round(np.log10(usual / stated))
    if exponent and exponent % 3 == 0 and abs(usual / stated / 10.0**exponent - 1) < 0.2:
        what = f"The time unit is off by a factor of {10.0**exponent:g}: the steps are {usual:g} s, not {stated:g} s."
        return [DataError(what, where=where, remedy="Correct the unit of `time`.")]
    if abs(usual / stated - 1) > 0.01:
        what = f"The time steps are {usual:.6g} s, but a sampling period of {stated:g} s was stated."
        return [DataError(what, where=where, remedy=f"Set sampling_period_s to {usual:.6g}, or correct the time unit.")]
    gaps = np.flatnonzero(steps > 1.5 * stated)
    problems = []
    if len(gaps):
        missing = round(float(np.sum(steps[gaps] / stated - 1)))
        what = (
            f"{len(gaps)} gap{'s' if len(gaps) > 1 else ''}, about {missing} missing samples; the first after sample"
            f" {gaps[0]}: {steps[gaps[0]]:.6g} s instead of {stated:g} s."
        )
        remedy = "Record again, or cut the log to whole periods without a gap."
        problems.append(DataError(what, where=f"{where}, sample {gaps[0]}", remedy=remedy))
    deviation = np.abs(np.delete(steps, gaps) / stated - 1)
    if deviation.max(initial=0) > _JITTER:
        what = f"The time steps deviate from {stated:g} s by up to {100 * deviation.max():.0f} %."
        remedy = "Resample the log to equal steps, or leave out `time` if only the stamps are coarse."
        problems.append(DataError(what, where=where, remedy=remedy))
    if not problems and abs(float(np.mean(steps)) / stated - 1) > 1e-4:
        what = f"The mean time step is {np.mean(steps):.8g} s, but {stated:g} s was stated."
        problems.append(DataError(what, where=where, remedy=f"Set sampling_period_s to {np.mean(steps):.8g}."))
    return problems


def check_count(mapping: LogMapping, n_sample: int, samples_per_period: int, periods: int) -> list[DataError]:
    """Checks that the log holds the periods that were said."""
    held = n_sample / samples_per_period
    wanted = mapping.drop_periods + periods
    if held >= wanted:
        return []
    fewer = int(held) - mapping.drop_periods
    remedy = f"Set periods to {fewer} at most" if fewer > 0 else "Record longer"
    return [
        DataError(
            f"It holds {held:.4g} periods of {samples_per_period} samples, fewer than the {wanted} that were said"
            f" ({mapping.drop_periods} dropped and {periods} used).",
            where=f"{mapping.file}: {n_sample} samples",
            remedy=f"{remedy}, or correct the period.",
        )
    ]


def check_segment(mapping: LogMapping, n_sample: int, segment_samples: int) -> list[DataError]:
    """Says what a log that is shorter than one segment of its resolution would need."""
    step_s = mapping.sampling_period_s
    # Rounded upwards to four digits, so that what is advised fits.
    least = 1 / (n_sample * step_s)
    scale = 10 ** (3 - int(np.floor(np.log10(least))))
    what = (
        f"It lasts {n_sample * step_s:.4g} s, less than the {segment_samples * step_s:.4g} s that a resolution of"
        f" {1 / (segment_samples * step_s):.4g} Hz needs."
    )
    remedy = f"Set excitation.resolution_hz to {np.ceil(least * scale) / scale:.4g} or more, or record longer."
    return [DataError(what, where=f"{mapping.file}: {n_sample} samples", remedy=remedy)]


def check_period(
    where: str,
    steady: FloatArray,
    sampling_period_s: float,
    samples_per_period: int,
    periods: int,
    lines: IntArray,
    *,
    stated: bool = True,
) -> tuple[list[DataError], list[str]]:
    """Measures the period of an excited channel and compares it with what was said; then the excited lines.

    Args:
        where: File and variable.
        steady (n_sample,): The channel without its dropped periods.
        sampling_period_s: Sampling period [s].
        samples_per_period: The stated period.
        periods: Periods that are used.
        lines (n_freq,): Lines that were said to be excited.
        stated: Whether they were; else they are those among which they will be looked for.

    Returns:
        Problems and notes.
    """
    found = measure_repetition(steady, samples_per_period, lines)
    notes = [] if found.reachable else ["The log holds one period: its length could not be checked by repetition."]
    if found.samples is None and found.reachable:
        what = f"It does not repeat with a period of {samples_per_period} samples, nor with any other."
        remedy = "Check that the excitation is periodic and that this is the excited channel."
        return [DataError(what, where=where, remedy=remedy)], notes
    real = _real_period(found, samples_per_period, lines)
    if real != samples_per_period:
        period_s = real * sampling_period_s
        what = (
            f"It repeats every {real} samples ({period_s:.9g} s), not every {samples_per_period}"
            f" ({samples_per_period * sampling_period_s:.9g} s)."
        )
        remedy = f"Set excitation.period_s to {period_s:.9g}, or correct sampling_period_s."
        return [DataError(what, where=where, remedy=remedy)], notes
    if found.drifts(periods, lines):
        what = (
            f"Its period is {found.samples:.4f} samples, not a whole number: generator and log have different clocks."
        )
        remedy = f"Resample the log so that a period has {samples_per_period} samples, or use fewer periods."
        return [DataError(what, where=where, remedy=remedy)], notes
    if found.std_samples > 0.2:
        notes.append(f"The noise lets the period be checked to +-{4 * found.std_samples:.1g} samples only.")
    whole_periods = len(steady) // samples_per_period
    blocks = steady[: whole_periods * samples_per_period].reshape(whole_periods, samples_per_period)
    return check_lines(where, blocks[:periods], lines) if stated else [], notes


def _real_period(found: Repetition, stated: int, lines: IntArray) -> int:
    """The period to propose: the stated one where the signal does not speak against it."""
    if found.samples is None:
        return stated
    whole = stated if found.agrees(stated) else round(found.samples)
    if found.multiple > 1 and np.any(lines % found.multiple):
        return round(whole / found.multiple)
    # A stated period of several real ones is as good when the stated lines fit it.
    repeats = stated % whole == 0 and not np.any(lines % (stated // whole))
    return stated if repeats else whole
