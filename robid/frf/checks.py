"""Checks of a record against what spoils a frequency response without being seen in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.frf.channels import LimitShares, limit_shares, saturation_error
from robid.frf.frf import Frf
from robid.frf.timing import Shift, common_shift, find_shifts, measure_jitter, period_differences, sparse_samples
from robid.signals.quantities import DRIVES, shown
from robid.signals.record import Record

JITTER_LIMIT = 0.1  # Standard deviation of the sampling instants above which a record is refused [samples]
JITTER_SIGMAS = 5.0  # Standard deviations by which jitter must stand out to be believed
INCOHERENT = 0.9  # Coherence below which noise may have a say in the response of a loop
STILL_SHARE = 0.25  # Share of the time in which a motor stands still above which it is told
_WHERE = "configuration at"
_STILL_SPEED = 0.05
_PLACES = ("angle", "position")
_MOVED = 1.5
_SHOWN = 3


@dataclass(frozen=True)
class RecordFinding:
    """Something wrong with a record."""

    kind: str  # `period`, `dropped`, `jitter`, `saturation`, `still`, `weak` or `loop`
    what: str  # What is wrong, with channel, experiment, realization, period and sample where they are known
    remedy: str
    fatal: bool


def check_record(record: Record, limits: LimitShares | None = None, *, periodic: bool = True) -> list[RecordFinding]:
    """Looks for a wrong period, dropped samples, jitter, saturated channels and motors that stood still.

    Args:
        record: Finite record of a single configuration, simulated or measured.
        limits: How long its channels lie at a limit, where that is known.
        periodic: Whether its periods repeat each other; the time base is not looked at otherwise.

    Returns:
        What was found; nothing else is looked at where the time base is wrong. Experiments, realizations, periods
        and samples are numbered from 1.
    """
    return (_timing(record) if periodic else []) or [*_saturation(limits or limit_shares(record)), *_still(record)]


def fed_back(record: Record, frf: Frf) -> list[RecordFinding]:
    """Tells where noise that a controller feeds back may bias the response of an arbitrary signal.

    Drives are told by a controller what their motion asks for. Without the reference as instrument the response leans
    towards minus the controller's inverse, by about the noise's share of the signal, which the coherence tells.
    """
    drives = all(channel.quantity in DRIVES for channel in record.input_channels)
    if not (record.is_arbitrary and drives) or record.reference is not None or frf.coherence is None:
        return []
    # Any output that the inputs do not explain tells of noise in the loop.
    low = np.nan_to_num(frf.coherence[0], nan=1.0).min(axis=1) < INCOHERENT
    if not low.any():
        return []
    what = (
        f"D224 at {int(low.sum())} of {len(low)} lines the coherence is below {INCOHERENT:g}, and no reference was "
        "logged:"
        " where a controller drives the motors, noise that it feeds back biases the response there"
    )
    return [RecordFinding("loop", what, "log the references and name them, or trust these lines less", fatal=False)]


def refuse_faults(record: Record, findings: list[RecordFinding]) -> None:
    """Raises what is fatal among findings, all at once.

    Raises:
        DataError: With every fatal finding.
    """
    fatal = [finding for finding in findings if finding.fatal]
    if fatal:
        remedies = dict.fromkeys(finding.remedy for finding in fatal)
        raise DataError("; ".join(one.what for one in fatal), where=_where(record), remedy="; ".join(remedies))


def finding_notes(record: Record, findings: list[RecordFinding]) -> tuple[str, ...]:
    """Writes findings as notes, see `is_finding`."""
    return tuple(f"In the {_where(record)}: {finding.what}; {finding.remedy}." for finding in findings)


def is_finding(note: str) -> bool:
    """Whether a note of a frequency response is a finding in one of its configurations."""
    return note.startswith(f"In the {_WHERE}")


def _where(record: Record) -> str:
    configuration = record.require_periods("A check of the time base")[0]
    return f"{_WHERE} {shown(configuration, record.joint_units)}"


def _timing(record: Record) -> list[RecordFinding]:
    found = period_differences(record)
    if found is None:
        return []
    shifts = find_shifts(record, found)
    n_real, n_exp, n_pair = found.difference.shape[:3]
    lost = common_shift(shifts, n_real * n_exp * n_pair)
    if lost:
        return [_wrong_period(record, -lost)]
    dropped = [shift for shift in shifts if shift.unusual]
    if dropped:
        return [_dropped(record, dropped)]
    jitter, sigmas = measure_jitter(found)
    if jitter < JITTER_LIMIT or sigmas < JITTER_SIGMAS:
        return []
    what = (
        f"D225 the sampling instants jitter by {jitter:.2g} samples RMS ({sigmas:.0f} standard deviations above none)"
    )
    return [
        RecordFinding("jitter", what, "record with a clock shared by generator and logger, or resample by time", True)
    ]


def _wrong_period(record: Record, longer: int) -> RecordFinding:
    stated = record.inputs.shape[4]
    real = stated + longer
    what = f"D226 the signals repeat every {real} samples, not every {stated}: the period is off by {abs(longer)}"
    period_s = real * record.sampling_period_s
    return RecordFinding("period", what, f"set the period to {period_s:.9g} s, or correct the sampling period", True)


def _dropped(record: Record, shifts: list[Shift]) -> RecordFinding:
    first = {(one.realization, one.experiment): one for one in reversed(shifts)}
    told = "; ".join(_place(record, one) for one in list(first.values())[::-1][:_SHOWN])
    more = f" and in {len(first) - _SHOWN} more experiments" if len(first) > _SHOWN else ""
    remedy = "record these experiments again, or leave their realization out"
    return RecordFinding("dropped", f"D227 the time base is broken: {told}{more}", remedy, True)


def _place(record: Record, shift: Shift) -> str:
    count = abs(shift.lost)
    noun = f"{count} sample{'s' if count > 1 else ''} {'missing' if shift.lost > 0 else 'too many'}"
    n_sample = record.inputs.shape[4]
    if shift.whole:
        place = f"between periods {shift.period} and {shift.period + 1}"
    elif shift.sample < 0:
        place = f"in period {shift.period} near sample {n_sample + shift.sample + 1}"
    else:
        place = f"in period {shift.period + 1} near sample {shift.sample + 1}"
    names = [f"{one.name} {one.title}" for one in record.input_channels] + list(record.output_names)
    everywhere = len(shift.channels) > len(names) / 2
    channels = "all channels" if everywhere else ", ".join(names[index] for index in shift.channels)
    return f"realization {shift.realization + 1}, experiment {shift.experiment + 1}: {noun} {place} ({channels})"


def _saturation(limits: LimitShares) -> list[RecordFinding]:
    findings = []
    for channel, share in limits.saturated():
        place = f"({_worst_place(share)})"
        what = f"D228 {channel.name}: {channel.title} saturates for {100 * share.max():.2g} % of the time {place}"
        off = f"{100 * saturation_error(float(share.max())):.2g} %"
        remedy = f"lower the excitation; where the sensor clips, the response may be off by {off} and more"
        findings.append(RecordFinding("saturation", what, remedy, False))
    return findings


def _still(record: Record) -> list[RecordFinding]:
    moved = [
        record.output_names.index(name)
        for name in record.input_names
        if name in record.output_names and _shows_motion(record, name)
    ]
    if not moved:
        return []
    chosen = sparse_samples(record)
    if not chosen.count:
        return []
    step = (record.outputs[0][..., chosen.after, :] - record.outputs[0][..., chosen.before, :])[..., moved]
    # Speeds as differences of nearby samples, mean over the periods.
    mean = step.mean(axis=2)
    usual = np.sqrt((mean**2).mean(axis=(0, 1, 2)))
    noise = _noise(step)
    share = (np.abs(mean) < _STILL_SPEED * usual).mean(axis=2)
    findings = []
    for index, column in enumerate(moved):
        name = record.output_names[column]
        what, part = "", share[..., index]
        if usual[index] < _MOVED * noise[index] or usual[index] == 0:
            what = f"D229 {name}: the motor did not move beyond the noise of its angle"
        elif part.max() > STILL_SHARE:
            what = f"D230 {name}: the motor stood still for {100 * part.max():.2g} % of the time ({_worst_place(part)})"
        if what:
            remedy = "raise the excitation of this motor, or keep it moving slowly against friction"
            findings.append(RecordFinding("still", what, remedy, False))
    return findings


def _shows_motion(record: Record, name: str) -> bool:
    """Whether an output is the motion of a motor or arm; a tool rests in the channels that are not commanded."""
    channel = record.output_channels[record.output_names.index(name)]
    return channel.side != "tool" and channel.quantity in _PLACES


def _noise(step: FloatArray) -> FloatArray:
    """RMS (n_motor,) of the noise of the periods' mean, of values (n_real, n_exp, n_period, n_point, n_motor)."""
    n_period = step.shape[2]
    if n_period < 2:
        return np.zeros(step.shape[-1])
    return np.asarray(np.sqrt(step.var(axis=2, ddof=1).mean(axis=(0, 1, 2)) / n_period))


def _worst_place(share: FloatArray) -> str:
    real, exp = np.unravel_index(int(np.argmax(share)), share.shape)
    return f"realization {real + 1}, experiment {exp + 1}"
