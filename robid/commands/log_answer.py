"""What `robid inspect --json` says of a log."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from robid.arrays import Meaning
from robid.commands.output import Answer
from robid.logs.inspection.findings import Findings
from robid.logs.inspection.quality import Quality
from robid.logs.inspection.roles import Signal
from robid.logs.inspection.sampling import Sampling
from robid.logs.inspection.text import remarks
from robid.logs.period import format_lines


@dataclass(frozen=True, kw_only=True)
class SignalTold(Quality):
    """A signal: its quality, and what it was taken for."""

    name: Annotated[str, Meaning("Its name in the log, and which log where there are several.")]
    unit: Annotated[str, Meaning("Its unit, as the log states it.")]
    role: Annotated[str | None, Meaning("What it was taken for, as `torque`; null where nothing tells.")]
    by: Annotated[str | None, Meaning("What says so: `unit`, `name`, `short`, `file` or `relation`.")]
    commanded: Annotated[bool, Meaning("Whether it is a command.")]
    joint: Annotated[str | None, Meaning("Joint in its name.")]
    reasons: Annotated[tuple[str, ...], Meaning("What else speaks for its role.")]
    same_as: Annotated[str | None, Meaning("Another signal with the same samples.")]
    period_samples: Annotated[float | None, Meaning("Period with which it repeats, in samples.")]
    remarks: Annotated[tuple[str, ...], Meaning("What a reader should know.")]


@dataclass(frozen=True)
class PeriodTold:
    """The period that signals share."""

    samples: Annotated[float, Meaning("Its length in samples, a fraction included.")]
    std_samples: Annotated[float, Meaning("Standard deviation of it, in samples.")]
    periods: Annotated[float, Meaning("Periods in the log, a fraction included.")]
    signals: Annotated[tuple[str, ...], Meaning("Signals that repeat with it.")]
    transient: Annotated[tuple[str, ...], Meaning("Signals whose first periods differ from the others.")]
    lines: Annotated[tuple[int, ...], Meaning("Excited lines, in multiples of one over the period.")]
    lines_text: Annotated[str, Meaning("The same in short, as `5-99`.")]


@dataclass(frozen=True)
class LogAnswer(Answer, type="inspect-log"):
    """What is in a log, and how to import it."""

    file: Annotated[str, Meaning("The log.")]
    format: Annotated[str, Meaning("Its format.")]
    samples: Annotated[int, Meaning("Samples of its signals.")]
    duration_s: Annotated[float | None, Meaning("How long it lasts; null where nothing tells the time step [s].")]
    sampling: Annotated[Sampling, Meaning("How it was sampled.")]
    signals: Annotated[tuple[SignalTold, ...], Meaning("Its signals.")]
    others: Annotated[dict[str, int], Meaning("Samples of signals of another length or topic, by name.")]
    scalars: Annotated[dict[str, float], Meaning("Single numbers, by name.")]
    texts: Annotated[tuple[str, ...], Meaning("Names of texts.")]
    unreadable: Annotated[dict[str, str], Meaning("Why a variable could not be read, by name.")]
    period: Annotated[PeriodTold | None, Meaning("The period that signals share; null where none repeats.")]
    notes: Annotated[tuple[str, ...], Meaning("What a reader must know.")]
    proposal: Annotated[str, Meaning("The proposed experiment file.")]


def log_answer(found: Findings, proposal: str) -> LogAnswer:
    """Returns what was found in a log."""
    contents, shared = found.contents, found.shared
    period = None
    if shared is not None:
        lines = tuple(found.lines.tolist()), format_lines(found.lines)
        period = PeriodTold(shared.samples, shared.std_samples, shared.held, shared.names, shared.transient, *lines)
    return LogAnswer(
        file=str(contents.file),
        format=contents.format,
        samples=found.n_sample,
        duration_s=None if found.sampling.step_s is None else found.duration_s,
        sampling=found.sampling,
        signals=tuple(_signal(found, one) for one in found.signals),
        others={one.key: len(one.values) for one in found.others},
        scalars=dict(contents.scalars),
        texts=tuple(contents.texts),
        unreadable=dict(contents.unreadable),
        period=period,
        notes=tuple(contents.notes),
        proposal=proposal,
    )


def _signal(found: Findings, signal: Signal) -> SignalTold:
    measured = found.periods.get(signal.name)
    return SignalTold(
        **vars(signal.quality),
        name=signal.name,
        unit=signal.column.unit,
        role=signal.role or None,
        by=signal.by or None,
        commanded=signal.commanded,
        joint=signal.hint.joint or None,
        reasons=signal.reasons,
        same_as=signal.twin or None,
        period_samples=None if measured is None else measured.samples,
        remarks=tuple(remarks(found, signal)),
    )
