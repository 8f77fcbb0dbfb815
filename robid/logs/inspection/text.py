"""What was found in a log, in words, and the proposed mapping as an experiment file to paste."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from robid.logs.inspection.channels import Entry
from robid.logs.inspection.findings import Findings
from robid.logs.inspection.roles import Signal
from robid.logs.inspection.sampling import Sampling
from robid.logs.pace import JITTER
from robid.logs.period import format_lines
from robid.printable import printable
from robid.signals.log_options import TIME_UNITS

_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9_./-]*( [A-Za-z]+)?")
_WORDS = ("true", "false", "yes", "no", "on", "off", "null", "y", "n")
_ONE_SHOT = (
    "nothing repeats, so it is taken for a record without a response; for one say excitation:"
    " {signal: arbitrary, low_hz: .., high_hz: .., resolution_hz: ..} in place of this"
)
_MOTION = "all joints move far and slowly, which is for a rigid model"
_NOTHING = "put the name of a variable in place of NAME and take the mark away: nothing looks like"
_PLACEHOLDERS = {
    "inputs": "{name: drive, variable: NAME, unit: N m}",
    "outputs": "{name: drive, variable: NAME, unit: rad}",
}
_BACKWARD = "sort the log and drop repeated rows; leave `time` out only where its stamps are rounded"
_CYCLE = (
    "the controller's cycle or the recorder's settings do: then `robid inspect` with `--sampling-period SECONDS` writes"
    " this and all times that follow from it"
)
_REFERENCES = "references are matched to an excitation that robid has designed; leave them out where others have"
_ROBOT = "my_robot.yaml # for fits that need to know the robot: its joints' names are then those of the channels"


def write_experiment(
    found: Findings,
    name: str,
    path: Callable[[Path], str] = str,
    format_: str | None = None,
    dialect: Mapping[str, object] | None = None,
) -> str:
    """Writes the proposal as an experiment file, with what to check as comments.

    `path` says how the file shall name a log; format and dialect are stated as far as they are given.
    """
    counts: dict[str, int] = {}
    numbering: tuple[str, ...] = ()
    if found.numbered is not None:
        place, check = found.numbered.place_among(len(found.proposal.inputs))
        counts, numbering = {place: found.numbered.count} if found.numbered.count > 1 else {}, (check,)
    found = _renamed(found, next(iter(counts), ""))
    made, is_arbitrary, experiments = found.proposal, _is_arbitrary(found), counts.get("experiment", 1)
    stated = [f"format: {format_}"] if format_ else []
    stated += [f"dialect: {_flow(dialect)}"] if dialect else []
    lines = ["schema_version: 2", f"name: {re.sub('[^A-Za-z0-9_-]+', '_', name).strip('_-') or 'log'}"]
    lines += [f"# robot: {_ROBOT}", "campaigns:", "  log:", *_campaign(found)]
    lines += _source(found, counts, numbering, path, stated)
    if "experiment" in counts:
        lines += [f"    experiments: {experiments}"]
    elif len(made.inputs) > 1 and not (made.one_shot or is_arbitrary):
        needed = "a response takes n logs for n inputs, `{experiment}` in their names"
        lines += [f"    experiments: 1 # check: {f'{_MOTION}; ' if made.is_motion else ''}{needed}"]
    if not made.one_shot:
        local = ", estimator: local_periodic" if len(made.inputs) > experiments and not is_arbitrary else ""
        lines += [f"    estimate: {{compensation: none{local}}}"]
    lines += ["execution: {backend: serial} # a single log is one task"]
    # A log names its variables as it likes: in a comment no name may end the line.
    return "\n".join(printable(line, keep="") for line in lines) + "\n"


def _source(
    found: Findings,
    counts: Mapping[str, int],
    numbering: tuple[str, ...],
    path: Callable[[Path], str],
    stated: Sequence[str],
) -> list[str]:
    """Where the record comes from: the log, how it is read, which part of it, its channels."""
    made, inside = found.proposal, " " * 8
    lines = [f"    realizations: {counts['realization']}"] if "realization" in counts else []
    lines += ["    source:", "      acquire:"]
    lines += [f"{inside}file: {_text(_braced(path(found.contents.file)))}{_comment(numbering)}"]
    lines += [f"{inside}{one}" for one in (*stated, *_sampling(found))]
    if made.part_s is not None:
        lines += [f"{inside}from_s: {_value(made.part_s[0])} # the longest part without a gap"]
        lines += [f"{inside}to_s: {_value(made.part_s[1])}"]
    if made.resample:
        why = _uneven(found.sampling) if made.resample == "time" else "the period is no whole number of samples"
        lines += [f"{inside}resample: {made.resample}{_comment((why,))}"]
    lines += [f"{inside}one_shot: true # check: {_ONE_SHOT}"] * made.one_shot
    lines += [f"{inside}drop_periods: {made.drop_periods}{_comment(_dropped(found))}"] if made.drop_periods else []
    if made.take_last:
        gaps = found.has_gaps and made.part_s is None
        held = f"the log contains {found.shared.held if found.shared else 0:.4g} periods"
        reason = "the longest part without a gap is at its end" if gaps else held
        lines += [f"{inside}take: last # {reason}"]
    lines += _entries("inputs", made.inputs, inside, "a torque, a current or a command", path)
    lines += _entries("outputs", made.outputs, inside, "an angle or a speed", path)
    if made.references:
        mark = "" if made.one_shot else "# "
        lines += _entries("references", made.references, inside + mark, "", path)
        lines += [] if made.one_shot else [f"{inside}# ({_REFERENCES})"]
    return lines


def _renamed(found: Findings, place: str) -> Findings:
    """What was found, the name of a place in variables' names where numbers were."""
    if found.numbered is None or not place:
        return found
    write, made = found.numbered.write, found.proposal

    def renamed(entries: tuple[Entry, ...]) -> tuple[Entry, ...]:
        columns = [replace(one.signal.column, name=write(one.signal.column.name, place)) for one in entries]
        signals = [replace(one.signal, column=column) for one, column in zip(entries, columns, strict=True)]
        return tuple(replace(one, signal=signal) for one, signal in zip(entries, signals, strict=True))

    inputs, outputs, references = map(renamed, (made.inputs, made.outputs, made.references))
    sampling = replace(found.sampling, variable=write(found.sampling.variable, place))
    made = replace(made, inputs=inputs, outputs=outputs, references=references)
    return replace(found, sampling=sampling, proposal=made)


def _is_arbitrary(found: Findings) -> bool:
    return found.proposal.excitation is not None and found.proposal.excitation.is_arbitrary


def _campaign(found: Findings) -> list[str]:
    made = found.proposal
    lines = [] if made.one_shot else ["    # configurations: {list_deg: [[0]]} # with a robot file: where it stood"]
    if made.excitation is not None and found.sampling.step_s is None:
        lines.append(_without_times(found))
    elif made.excitation is not None:
        lines.append(f"    excitation: {_flow(made.excitation.settings)}{_comment(made.excitation.checks)}")
    if made.periods is not None:
        lines.append(f"    periods: {made.periods}")
    return lines


def _without_times(found: Findings) -> str:
    """What was played, without the numbers that follow from a sampling period which is not known."""
    if found.shared is None or _is_arbitrary(found):
        wanted = "low_hz, high_hz and resolution_hz follow from sampling_period_s"
        return f"    excitation: {{signal: arbitrary}}{_comment((f'nothing repeats; {wanted}',))}"
    repeats = f"it repeats every {found.shared.samples:.6g} samples, lines with energy: {format_lines(found.lines)}"
    wanted = "period_s, low_hz and high_hz follow from sampling_period_s"
    return f"    # excitation: {{period_s: .., low_hz: .., high_hz: ..}}{_comment((f'{repeats}; {wanted}',))}"


def _uneven(sampling: Sampling) -> str:
    """What the steps of a time are that is to be brought to even ones."""
    if sampling.gaps and sampling.jitter <= JITTER:
        return f"about {sampling.missing} samples are missing within it, and interpolated"
    longest = f", the longest is {sampling.longest_step:.2g} usual ones" if sampling.gaps else ""
    return f"time steps deviate by up to {100 * sampling.jitter:.0f} %{longest}"


def _sampling(found: Findings) -> list[str]:
    sampling, step_s = found.sampling, found.step_s
    if sampling.step_s is None:
        # A number that nobody stated stays out, so that the import stops and asks for it.
        units = " or ".join(sampling.likely)
        which = f"whether `{sampling.variable}` is in {units}" if units else "it"
        why = sampling.doubt or f"nothing in the log tells {which}"
        return [f"# sampling_period_s: SECONDS # check: {why}; {_CYCLE}"]
    lines = [f"sampling_period_s: {_value(step_s)}"]
    if sampling.variable and sampling.unit in TIME_UNITS:
        told = [] if sampling.is_stated else [f"unit not stated; {sampling.unit} gives {1 / step_s:.6g} Hz"]
        if found.has_gaps:
            count = "one place" if sampling.gaps == 1 else f"{sampling.gaps} places"
            places = f"samples are missing at {count}, first after {sampling.first_gap}"
            told += [f"{places}: the longest part without is used"]
        if sampling.backward:
            told += [f"it stands still or goes back {sampling.backward} times: {_BACKWARD}"]
        for name, later_s in zip(sampling.others, sampling.later_s, strict=True):
            if later_s:
                way = "later" if later_s > 0 else "earlier"
                whose = f"state `time: {name}` for the channels that it is the time of, if there are some"
                told.append(f"`{name}` is {abs(later_s):.3g} s {way} in the same row: {whose}")
        lines.append(f"time: {{variable: {_text(sampling.variable)}, unit: {sampling.unit}}}{_comment(told)}")
    return lines


def _dropped(found: Findings) -> tuple[str, ...]:
    if found.unbroken.start and found.proposal.part_s is None:
        return (f"the longest part without a gap begins at sample {found.unbroken.start}",)
    names = found.shared.transient if found.shared else ()
    first = "the first period" if found.proposal.drop_periods == 1 else "the first periods"
    return (f"{first} of {', '.join(names)} differ{'s' * (first == 'the first period')} from the others",)


def _entries(key: str, entries: tuple[Entry, ...], inside: str, none: str, path: Callable[[Path], str]) -> list[str]:
    if not entries:
        # An empty list would only be refused.
        return [f"{inside}# {key}: [{_PLACEHOLDERS[key]}] # check: {_NOTHING} {none}"]
    if any(one.is_open for one in entries):
        inside += "# "
    common = tuple(one for one in entries[0].checks if len(entries) > 1 and all(one in e.checks for e in entries))
    rest = [replace(one, checks=tuple(check for check in one.checks if check not in common)) for one in entries]
    lines = [f"{inside}{key}:{_comment(common)}"]
    for one in rest:
        column = one.signal.column
        file = {} if column.file is None else {"file": _braced(path(column.file))}
        settings = {"name": one.name, "variable": column.name, **file, **one.settings}
        lines.append(f"{inside}  - {_flow(settings)}{_comment(one.checks)}")
    return lines


def _comment(checks: Sequence[str]) -> str:
    return f" # check: {'; '.join(checks)}" if checks else ""


def _flow(settings: Mapping[str, object]) -> str:
    return "{" + ", ".join(f"{key}: {_value(value)}" for key, value in settings.items()) + "}"


def _value(value: object) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, int):
        return str(value)
    text = f"{value:.9g}"
    return text if "e" not in text or "." in text else text.replace("e", ".0e")


def _text(text: str) -> str:
    return text if _PLAIN.fullmatch(text) and text.lower() not in _WORDS else json.dumps(text, ensure_ascii=False)


def _braced(path: str) -> str:
    """A path whose braces stand for themselves."""
    return path.replace("{", "{{").replace("}", "}}")


_EVEN = 1e-5  # deviation of time steps that is not worth a word
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
            f"NaN or infinite at {quality.missing} of its samples, the first {quality.first_missing},"
            f" {quality.longest_missing} in a row at most"
        )
    if quality.saturated:
        told.append(f"flat at its highest or lowest value for {100 * quality.saturated:.2g} % of the time: saturated?")
    if signal.wrap is not None and signal.role not in ("angle", "position"):
        told.append(f"logged without signs, jumps by {signal.wrap.size:.6g}: proposed with `unwrap`")
    elif signal.wrap is not None:
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
