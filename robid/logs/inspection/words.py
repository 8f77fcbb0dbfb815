"""What was found in a log, in words."""

from __future__ import annotations

from robid.logs.inspection.findings import Findings
from robid.logs.inspection.roles import Signal
from robid.logs.lines import format_lines

_EVEN = 1e-5
"""Deviation of time steps that is not worth a word."""

_BY = {
    "unit": "by its unit",
    "name": "by its name",
    "short": "by a letter of its name: a guess",
    "file": "by the log's name: a guess",
    "relation": "by how it goes with others: a guess",
}


def role_text(signal: Signal) -> str:
    """Says what a signal was taken for, and how sure that is."""
    if signal.twin:
        return "a copy"
    if signal.role in ("", "other"):
        return "unknown" if not signal.role else "nothing of a drive"
    command = " command" if signal.commanded else ""
    return f"{signal.role}{command} ({_BY[signal.by]})"


def describe_sampling(found: Findings) -> str:
    """Says how a log was sampled."""
    sampling, count = found.sampling, f"{found.n_sample} samples"
    if sampling.step_s is None:
        return f"{count}; {sampling.doubt or 'nothing tells the sampling period'}: state it by `--sampling-period`"
    told = [f"{count}, {found.duration_s:.6g} s at {1 / sampling.step_s:.6g} Hz"]
    if sampling.variable:
        unit = f"in {sampling.unit}" if sampling.is_stated else f"taken for {sampling.unit}: not stated"
        told.append(f"time `{sampling.variable}` {unit}")
        even = sampling.jitter < _EVEN
        told.append("equal steps" if even else f"steps deviate by up to {100 * sampling.jitter:.1g} %")
    if sampling.told_by:
        told.append(f"as {sampling.told_by} says")
    if sampling.gaps:
        gaps = "1 gap" if sampling.gaps == 1 else f"{sampling.gaps} gaps"
        told.append(f"{gaps}, about {sampling.missing} samples missing, first after {sampling.first_gap}")
    if sampling.backward:
        told.append(f"time stands still or goes back {sampling.backward} times")
    return "; ".join(told)


def describe_period(found: Findings) -> str:
    """Says how a log repeats."""
    shared = found.shared
    if shared is None:
        return "nothing that drives repeats" if found.periods else "nothing was found that drives"
    lines = f"; lines with energy: {format_lines(found.lines)}" if len(found.lines) else ""
    first = f"the first {shared.settling} periods" if shared.settling > 1 else "the first period"
    transient = (
        f"; {first} of {', '.join(shared.transient)} differ{'s' * (shared.settling == 1)}" if shared.transient else ""
    )
    lasts = "" if found.sampling.step_s is None else f" ({shared.samples * found.step_s:.7g} s)"
    return f"repeats every {shared.samples:.7g} samples{lasts}, {shared.held:.4g} periods{lines}{transient}"


def remarks(found: Findings, signal: Signal) -> list[str]:
    """Says what is to be noted about a signal."""
    quality, told = signal.quality, list(signal.reasons)
    if signal.column.title:
        told.insert(0, f"called {signal.column.title}")
    if signal.twin:
        told.append(f"the same as `{signal.twin}`")
    if quality.is_dead:
        told.append("never changes")
    elif quality.values is not None:
        told.append(f"has {quality.values} different values only")
    if quality.missing:
        told.append(
            f"{quality.missing} values are NaN or infinite, the first at sample {quality.first_missing},"
            f" {quality.longest_missing} in a row at most"
        )
    if quality.saturated:
        told.append(f"flat at its highest or lowest value for {100 * quality.saturated:.2g} % of the time: saturated?")
    if signal.wrap is not None:
        unit = "" if signal.wrap.unit == "counts" else f" {signal.wrap.unit}"
        told.append(
            f"starts again after {signal.wrap.size:.6g}{unit} {signal.wrap.count} times: proposed with `unwrap`"
        )
    elif quality.turns:
        told.append(f"jumps by its whole range {quality.turns} times: an angle that wraps? (`unwrap: true`)")
    measured = found.periods.get(signal.name)
    if measured is not None and found.shared is not None and signal.name not in found.shared.names:
        alone = "does not repeat" if measured.samples is None else f"repeats every {measured.samples:.6g} samples"
        told.append(alone)
    return told
