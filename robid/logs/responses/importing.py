"""Responses of files as an `Frf`: units, motions as accelerations, delay, and the covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any, Literal

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.logs.responses.table import ResponseTable, check_lines, check_variance
from robid.logs.responses.variance import coherence_variance, neighbour_variance
from robid.signals.quantities import DRIVES, QUANTITIES, Channel, QuantityName
from robid.signals.response_options import ResponseOptions

_KNOWN_FREEDOM = 1e6  # Complex degrees of freedom of a variance that is stated without them
_LONGEST_S = 1e4  # Longest period whose lines some frequencies are
_SAME = 1e-9
_FINE = 20.0  # Samples of the highest frequency's period, where nothing says how often was sampled

Kind = Literal["stated", "coherence", "neighbours"]


@dataclass(frozen=True)
class Told:
    """Where a response's error comes from."""

    kind: Kind
    variance: FloatArray  # (n_freq, n_out, n_in) E|error|^2, in the file's units
    freedom: float  # Complex degrees of freedom behind it


def frf_of(
    table: ResponseTable,
    options: ResponseOptions,
    configuration: FloatArray,
    joint_units: tuple[str, ...] | None,
    where: str,
    *,
    accelerations: bool | None = None,
) -> tuple[Frf, Kind]:
    """Returns one configuration's response with its covariance, and where that comes from.

    Args:
        table: The response as its file has it.
        options: What the file means.
        configuration (n_joint,): Arm-side joint positions [rad, or m].
        joint_units: Their units; None where all turn.
        where: The file, for messages.
        accelerations: Whether motions become accelerations; where the inputs drive when not given.

    Raises:
        DataError: If lines or values cannot be used, or nothing tells the covariance that was asked for.
    """
    check_lines(table.frequency_hz, where)
    table = _stated_period(table, options, where)
    told = _error(table, options, where)
    if options.estimator == "h2" and table.coherence is not None:
        # H1 = g2 H2: with noise on the output alone, H1 has no bias.
        table = replace(table, response=table.response * table.coherence)
    drives = all(one.channel.quantity in DRIVES for one in options.inputs)
    factor = _factors(table.frequency_hz, options, drives if accelerations is None else accelerations)
    response = table.response * factor
    dropped = np.asarray(~np.isfinite(response).all(axis=1))
    kept, variance = _interpolated(response, dropped, where), told.variance * np.abs(factor) ** 2
    outputs = tuple(one.channel for one in options.outputs)
    kept_outputs = tuple(one.acceleration for one in outputs) if _moves(drives, accelerations) else outputs
    held = options.sampling_period_s is not None and options.inputs[0].hold == "zoh"
    lines = _lines(table.frequency_hz)
    frf = Frf(
        frequency_hz=table.frequency_hz,
        lines=lines,
        configurations=configuration[None],
        response=kept[None],
        sensitivity=np.zeros((1, 0, *kept.shape), complex),
        coefficient_names=(),
        coefficient_relative_std=np.zeros(0),
        removed_torque_rms=np.zeros((1, kept.shape[2])),
        sampling_period_s=options.sampling_period_s or 1 / (_FINE * float(table.frequency_hz[-1])),
        input_channels=tuple(one.channel for one in options.inputs),
        output_channels=kept_outputs,
        measured_channels=outputs,
        input_hold="zoh" if held else "band_limited",
        coherence=None if table.coherence is None else table.coherence.mean(axis=2)[None],
        compensation="none",
        joint_units=joint_units,
        dropped=dropped[None],
        notes=table.notes,
        noise_covariance=None,
        noise_degrees_of_freedom=0.0,
        total_degrees_of_freedom=told.freedom,
        **_structured(np.where(dropped[:, None], np.nan, variance)),
    )
    found = _with_parts(_measured(frf, table, options), table, options, factor)
    check_variance(found.element_variance(), where)
    return found, told.kind


def _measured(frf: Frf, table: ResponseTable, options: ResponseOptions) -> Frf:
    """With what its outputs were sampled as, by the file or by the settings: it decides what folds down."""
    told = [table.texts.get(f"measured_{name}", ()) for name in ("names", "quantities", "units", "sides", "samples")]
    if told[0]:
        channels = [Channel(*each) for each in zip(*told, strict=True)]
        known = {one.name: one for one in channels}
        names = [one.variable for one in options.outputs]
        ordered = [known.get(name) for name in names]
        if all(one is not None for one in ordered):
            pairs = zip(ordered, options.outputs, strict=True)
            return replace(frf, measured_channels=tuple(replace(one, name=mine.name) for one, mine in pairs if one))
    rows = [
        _sampled(channel, options.measured_as.get(one.name), encoded=options.sampling_period_s is not None)
        for one, channel in zip(options.outputs, frf.measured_channels, strict=True)
    ]
    return replace(frf, measured_channels=tuple(rows))


def _sampled(channel: Channel, stated: QuantityName | None, *, encoded: bool) -> Channel:
    """What an output was sampled as: as stated; an acceleration of motor or arm by an encoder, else as it is."""
    length = channel.unit.split("/")[0]
    turns = length == "rad"
    if stated is None and encoded and channel.quantity == "acceleration" and channel.side != "tool":
        stated = "angle" if turns else "position"
    if stated is None:
        return channel
    units = {"speed": f"{length}/s", "acceleration": f"{length}/s^2"}
    return replace(channel, quantity=stated, unit=units.get(stated, length))


def _moves(drives: bool, accelerations: bool | None) -> bool:
    return drives if accelerations is None else accelerations


def _stated_period(table: ResponseTable, options: ResponseOptions, where: str) -> ResponseTable:
    own, stated = table.sampling_period_s, options.sampling_period_s
    if own and stated and abs(own / stated - 1) > 1e-6:
        what = f"D622 the file says a sampling period of {own:g} s, the experiment file {stated:g} s"
        raise DataError(what, where=where, remedy="correct `sampling_period_s`")
    if stated is not None and table.frequency_hz[-1] > 0.5 / stated * (1 + _SAME):
        what = f"D623 {table.frequency_hz[-1]:g} Hz is above half the sampling rate, {0.5 / stated:g} Hz"
        raise DataError(what, where=where, remedy="correct `sampling_period_s`, or the unit of the frequencies")
    return table


def _factors(frequency_hz: FloatArray, options: ResponseOptions, accelerations: bool) -> ComplexArray:
    """What turns the file's numbers into the response in SI units (n_freq, n_out, n_in)."""
    s = 2j * np.pi * frequency_hz[:, None]
    outputs = np.array([one.factor for one in options.outputs]) * np.ones_like(s)
    if accelerations:
        # A motion's acceleration is that motion, differentiated as often as it is short of one.
        outputs = outputs * s ** np.array(
            [QUANTITIES[one.channel.quantity].derivatives or 0 for one in options.outputs]
        )
    given = np.array([one.factor for one in options.inputs])
    return np.asarray(outputs[:, :, None] / given)


def _interpolated(response: ComplexArray, dropped: BoolArray, where: str) -> ComplexArray:
    """The response, straight lines where lines say nothing of an input."""
    if not dropped.any():
        return response
    found, place = response.copy(), np.arange(len(response))
    for column in range(response.shape[2]):
        known = ~dropped[:, column]
        if known.sum() < 2:
            raise DataError("D624 fewer than two lines have numbers", where=where, remedy="export the response again")
        for row in range(response.shape[1]):
            own = response[known, row, column]
            found[:, row, column] = np.interp(place, place[known], own.real) + 1j * np.interp(
                place, place[known], own.imag
            )
    return found


def _structured(variance: FloatArray) -> dict[str, Any]:
    """Factors of a covariance of independent elements with these variances (n_freq, n_out, n_in); NaN is any."""
    known = np.where(np.isfinite(variance) & (variance > 0), variance, np.nan)
    typical = np.nanmedian(np.where(np.isfinite(known), known, np.nan)) if np.isfinite(known).any() else 1.0
    filled = np.where(np.isfinite(known), known, typical)
    # Outputs by inputs as a product, the rest in the scale of each element at each line.
    rows = np.exp(np.log(filled).mean(axis=2))
    columns = np.exp(np.log(filled / rows[:, :, None]).mean(axis=1))
    whole = np.where(np.isfinite(variance), variance, filled) / (rows[:, :, None] * columns[:, None, :])
    size = whole.mean(axis=0)
    size = np.where(size > 0, size, 1.0)
    diagonal = np.eye(variance.shape[1]), np.eye(variance.shape[2])
    return {
        "total_covariance": (rows[:, :, None] * diagonal[0]).astype(complex)[None],
        "input_factor": (columns[:, :, None] * diagonal[1]).astype(complex)[None],
        "element_scale": size[None],
        "line_scale": (whole / size)[None],
    }


def _error(table: ResponseTable, options: ResponseOptions, where: str) -> Told:
    asked = options.covariance
    if asked in ("auto", "stated") and table.variance is not None:
        freedom = (table.averages or options.averages or _KNOWN_FREEDOM + 1) - 1
        return Told("stated", table.variance, freedom)
    if asked == "stated":
        remedy = "name `deviation` under `elements`, or choose another `covariance`"
        raise DataError("D625 the file states no deviations", where=where, remedy=remedy)
    if asked == "coherence" or (asked == "auto" and table.coherence is not None and options.averages is not None):
        return _by_coherence(table, options, where)
    told = np.isfinite(table.response).all(axis=(1, 2))
    frequency, response = table.frequency_hz[told], table.response[told]
    if len(frequency) < 4:
        what = f"D626 {len(frequency)} lines do not tell their scatter"
        remedy = "state deviations, or coherence with `averages`"
        raise DataError(what, where=where, remedy=remedy)
    # In logarithms of the frequency, relative to the response's own size, a resonance bends less.
    variance, freedom = neighbour_variance(frequency, response)
    whole = np.full(table.response.shape, np.nan)
    whole[told] = variance
    return Told("neighbours", whole, freedom)


def _by_coherence(table: ResponseTable, options: ResponseOptions, where: str) -> Told:
    coherence, averages = table.coherence, options.averages
    if coherence is None or averages is None:
        lacks = "coherence" if coherence is None else "number of averages"
        remedy = "name `coherence` under `elements`" if coherence is None else "state `averages`"
        raise DataError(f"D627 the {lacks} is missing", where=where, remedy=remedy)
    told = coherence[np.isfinite(coherence)]
    if told.size == 0 or told.min() < 0 or told.max() > 1 + 1e-6:
        what = f"D628 a coherence is from 0 to 1, not {told.max(initial=0.0):g}"
        raise DataError(what, where=where, remedy="export gamma squared, not in per cent or dB")
    if options.loop == "closed" and options.estimator != "reference":
        what = "D629 a closed loop biases a response from input to output, and its coherence says nothing of it"
        remedy = "estimate with a reference from outside the loop (`estimator: reference`), and state deviations"
        raise DataError(what, where=where, remedy=remedy)
    together = len(options.inputs) > 1 and options.excited == "together"
    if together and coherence.shape[2] > 1:
        equal = np.allclose(coherence, coherence[:, :, :1], equal_nan=True)
        if not equal or not options.input_rms:
            what = "D630 inputs that were excited together need multiple coherence of each output, and their RMS"
            remedy = (
                "set `excited: alone`, if one input was excited at a time, or give `input_rms`, or state deviations"
            )
            raise DataError(what, where=where, remedy=remedy)
        coherence = coherence[:, :, :1]
    power = np.array(options.input_rms) ** 2 if options.input_rms else None
    response = table.response if options.estimator != "h2" else table.response * coherence
    if averages <= response.shape[2]:
        what = f"D631 {averages:g} averages do not tell the error of {response.shape[2]} inputs"
        raise DataError(what, where=where, remedy="average more")
    variance = coherence_variance(response, coherence, averages, power)
    return Told("coherence", variance, averages - (response.shape[2] if together else 1))


def _lines(frequency_hz: FloatArray) -> IntArray:
    """DFT lines of the shortest period that has them all; counted from 1 where there is none."""
    steps = np.diff(frequency_hz, prepend=0.0)
    base = Fraction(float(frequency_hz[0])).limit_denominator(10_000)
    for period in {1 / float(steps[1:].min()), *(k / float(base) for k in range(1, 11))} if base else ():
        counted = frequency_hz * period
        if period < _LONGEST_S and np.allclose(counted, np.round(counted), atol=1e-5, rtol=_SAME) and counted[0] > 0.5:
            return np.round(counted).astype(int)
    return np.arange(1, frequency_hz.size + 1)


def _with_parts(frf: Frf, table: ResponseTable, options: ResponseOptions, factor: ComplexArray) -> Frf:
    """With what our own exports tell besides: the whole covariance, and torques that were compensated."""
    parts = table.parts
    if not {"input_factor", "output_covariance", "element_scale"} <= parts.keys():
        return frf
    changed: dict[str, Any] = {
        "input_factor": np.asarray(parts["input_factor"], complex)[None],
        "total_covariance": np.asarray(parts["output_covariance"], complex)[None],
        "element_scale": np.real(parts["element_scale"])[None],
        # Units of the file may be others: what turns them is in the scale of each line.
        "line_scale": None if np.allclose(np.abs(factor), 1.0) else np.abs(factor[None]) ** 2,
    }
    if "sensitivity" in parts:
        changed["sensitivity"] = (np.asarray(parts["sensitivity"]) * factor)[None]
        changed |= {
            name: np.real(parts[name]) for name in ("coefficient_relative_std", "coefficient_offset") if name in parts
        }
    if "line_correlation" in parts:
        changed["line_correlation"] = np.real(parts["line_correlation"])[None]
    if "input_amplitude" in parts:
        given = np.array([one.factor for one in options.inputs])
        changed["input_amplitude"] = (np.asarray(parts["input_amplitude"], complex) * given[:, None])[None]
    if "lines" in parts:
        changed["lines"] = np.real(parts["lines"]).astype(int)
    if table.texts.get("coefficient_names"):
        changed["coefficient_names"] = table.texts["coefficient_names"]
    return replace(frf, **changed)


def channels_told(options: ResponseOptions) -> Sequence[str]:
    """Says what the response relates, for people."""
    return [f"{one.name} [{one.channel.unit}]" for one in (*options.outputs, *options.inputs)]
