"""A response as a file has it, in the file's units: one configuration, all its elements."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.signals.response_options import ResponseOptions


@dataclass(frozen=True)
class ResponseTable:
    """One configuration's response."""

    frequency_hz: FloatArray  # (n_freq,) Lines [Hz]
    response: ComplexArray  # (n_freq, n_out, n_in) In the file's units; NaN where a line says nothing
    variance: FloatArray | None = None  # (n_freq, n_out, n_in) E|error|^2; None where the file does not state it
    coherence: FloatArray | None = None  # (n_freq, n_out, n_in), or (n_freq, n_out, 1) of multiple coherence
    # What only our own files hold: arrays of `Frf` of one configuration, by their names
    parts: dict[str, FloatArray | ComplexArray] = field(default_factory=dict)
    texts: dict[str, tuple[str, ...]] = field(default_factory=dict)  # The same of names
    sampling_period_s: float | None = None  # What the file states [s]; 0 for continuous time
    averages: float | None = None  # What the file states of its degrees of freedom
    notes: tuple[str, ...] = ()


@contextmanager
def contradictions_refused(where: str) -> Iterator[None]:
    """Refuses a file whose parts do not fit each other, whatever reading it then meets.

    Raises:
        DataError: If sizes, names or numbers of a file contradict each other.
    """
    try:
        yield
    except (ValueError, KeyError, IndexError, TypeError, OverflowError, ZeroDivisionError) as error:
        told = " ".join(str(error).split())[:200]
        what = f"D635 the file's parts do not fit each other ({told})"
        raise DataError(
            what, where=where, remedy="export the responses again, or check that it was copied completely"
        ) from error


def check_variance(variance: FloatArray, where: str) -> None:
    """Refuses negative variances.

    Raises:
        DataError: If there is one.
    """
    wrong = variance[variance < 0]
    if wrong.size:
        what = f"D636 a variance is {float(wrong[0]):.3g}, and none is below 0"
        raise DataError(what, where=where, remedy="export the responses again, or take another `covariance`")


def check_lines(frequency_hz: FloatArray, where: str) -> None:
    """Refuses lines that do not rise from one to the next, or are no frequencies.

    Raises:
        DataError: If it is so, naming the first line that is wrong.
    """
    wrong = np.flatnonzero(~(np.isfinite(frequency_hz) & (frequency_hz > 0)))
    if wrong.size:
        index = int(wrong[0])
        what = f"D606 the frequency of line {index + 1} is {frequency_hz[index]:g}, and must be above 0"
        raise DataError(what, where=where, remedy="leave the line out, or correct the column of the frequencies")
    if frequency_hz.size < 2:
        raise DataError(f"D607 there are {frequency_hz.size} lines", where=where, remedy="measure several frequencies")
    back = np.flatnonzero(np.diff(frequency_hz) <= 0)
    if back.size:
        index = int(back[0])
        one, other = frequency_hz[index : index + 2]
        how = "is repeated" if one == other else f"follows {one:g} Hz"
        what = f"D608 frequencies must rise: {other:g} Hz {how} in line {index + 2}"
        remedy = "sort the lines, and keep one of those that are repeated; two sweeps belong into two configurations"
        raise DataError(what, where=where, remedy=remedy)


def complex_of(magnitude: FloatArray, phase: FloatArray, *, db: bool, deg: bool, where: str) -> ComplexArray:
    """Numbers of magnitudes and phases (n_freq,) that may be in dB and degrees.

    Raises:
        DataError: If these contradict the units: negative magnitudes that are no dB, phases that turn as degrees do
            where they are said to be radians, or the other way round.
    """
    told = magnitude[np.isfinite(magnitude)]
    if not db and (told < 0).any():
        what = f"D609 a magnitude is {told.min():g}: magnitudes in dB, read as numbers"
        raise DataError(what, where=where, remedy="set `magnitude: db`")
    _check_phase(phase[np.isfinite(phase)], deg=deg, where=where)
    size = 10 ** (magnitude / 20) if db else magnitude
    return np.asarray(size * np.exp(1j * (np.deg2rad(phase) if deg else phase)))


def _check_phase(phase: FloatArray, *, deg: bool, where: str) -> None:
    """A wrapped phase jumps by a turn: by 360 in degrees, by 6.28 in radians."""
    if phase.size < 2:
        return
    jumps, turn, other = np.abs(np.diff(phase)), (360.0, 2 * np.pi)[not deg], (360.0, 2 * np.pi)[deg]
    within = np.abs(phase).max() <= other
    # Nearly whole turns of the other unit, as a wrapped phase has them, and nothing of its own.
    turned = (np.abs(jumps / other - 1) < 0.2).any() and not (np.abs(jumps / turn - 1) < 0.2).any()
    beyond = not deg and np.abs(phase).max() > 90 and np.median(jumps) > 1
    if within and (turned or beyond):
        told, right = ("degrees", "rad") if deg else ("radians", "deg")
        what = f"D610 the phase, from {phase.min():.3g} to {phase.max():.3g}, is not in {told}: it turns by {other:.3g}"
        raise DataError(what, where=where, remedy=f"set `phase: {right}`")


def check_pairs(options: ResponseOptions, found: object, where: str, known: Sequence[str] = ()) -> None:
    """Refuses a response that lacks pairs of outputs and inputs, naming them.

    Raises:
        DataError: If one is missing.
    """
    missing = [
        f"`{output.variable}` per `{one.variable}`"
        for row, output in enumerate(options.outputs)
        for column, one in enumerate(options.inputs)
        if (row, column) not in found  # type: ignore[operator]
    ]
    if missing:
        more = f" and {len(missing) - 3} more" if len(missing) > 3 else ""
        there = f"; there are {', '.join(list(dict.fromkeys(known))[:8])}" if known else ""
        message = f"D615 the response lacks {', '.join(missing[:3])}{more}{there}"
        remedy = "correct `variable` under `inputs` and `outputs`, or leave out the channel that was not measured"
        raise DataError(message, where=where, remedy=remedy)


MEASURED = r"measured as (\S+), (\S+), ([^,]+), (\S+), freedom (\S+)"
"""What our tables and Universal Files say of each output: quantity, side, unit, samples, degrees of freedom."""


def with_notes(table: ResponseTable, notes: Mapping[str, str], options: ResponseOptions) -> ResponseTable:
    """A table with what our exports note of each output, by its name; as it is where they do not note it of all."""
    found = [(one.variable, re.fullmatch(MEASURED, notes.get(one.variable, ""))) for one in options.outputs]
    rows = [(name, *row.groups()) for name, row in found if row]
    if len(rows) < len(found):
        return table
    keys = ("names", "quantities", "sides", "units", "samples", "freedom")
    texts = {f"measured_{key}": tuple(values) for key, values in zip(keys, zip(*rows, strict=True), strict=True)}
    return replace(table, texts=texts, averages=float(texts.pop("measured_freedom")[0]) + 1)
