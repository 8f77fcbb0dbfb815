"""Figures of transfer functions, after Figs 5 to 8, 10 and 11 of Oliveira et al. (2019)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.fit.etfe import Excitation
from robid.models.external.fit.solution import ExternalSolution, StepResponses
from robid.models.parameters import ERROR, GREY, MEASURED, MODEL, curve, over_time, quantile
from robid.report.section import Curve, Figure, Line

_HIDES = 0.5  # of what curves span, bounds reach beyond them
_BEYOND = 4.0  # times the highest excited frequency
_READABLE = {"m": (1e3, "mm"), "rad": (180 / np.pi, "°"), "m/s": (1e3, "mm/s"), "rad/s": (180 / np.pi, "°/s")}


def readable_factor(unit: str) -> tuple[float, str]:
    """Returns the factor to a unit that reads well, and that unit."""
    return _READABLE.get(unit, (1.0, unit))


def excitation_figures(found: Excitation, channel: int, shot: int, units: tuple[str, str]) -> tuple[Figure, Figure]:
    """Command and output of one shot of a channel over time, and their spectra against the resolution."""
    rows = (found.time_channel == channel) & (found.time_shot == shot)
    lines = (found.line_channel == channel) & (found.line_shot == shot)
    (to_command, unit), (to_answer, other) = (readable_factor(each) for each in units)
    title = f"[{unit}]" if unit == other else f"[{unit}; {other}]"
    time = (
        over_time("command", found.time_s[rows], to_command * found.command[rows], MEASURED),
        over_time("output", found.time_s[rows], to_answer * found.answer[rows], MODEL),
    )
    spectra = (
        curve("command", found.frequency_hz[lines], to_command * found.command_amplitude[lines], MEASURED),
        curve("output", found.frequency_hz[lines], to_answer * found.answer_amplitude[lines], MODEL),
    )
    limit = Line("y", to_answer * float(found.answer_resolution[channel]), "resolution")
    return (
        Figure(found.shots[shot], "Time [s]", title, time, log_x=False, log_y=False, height=260),
        Figure("Amplitude of each component", "Frequency [Hz]", title, spectra, lines=(limit,), height=260),
    )


def response_figures(solution: ExternalSolution, channel: int) -> tuple[Figure, Figure]:
    """Magnitude and phase of one channel's empirical response with its band, and of the model with its own."""
    etfe, found = solution.etfe, solution.responses
    place = (slice(None), solution.transfers.outputs[channel], solution.transfers.inputs[channel])
    measured, radius = etfe.response[place], etfe.radius[place]
    shown = found.frequency_hz <= _BEYOND * solution.quality.highest_hz[solution.transfers.block_of[channel]]
    frequency_hz, wide = found.frequency_hz[shown], quantile(solution.estimate.confidence)
    model = found.sampled[shown, channel]
    size, off = np.abs(model), wide * found.relative_std[shown, channel]
    angle, turned = np.degrees(np.unwrap(np.angle(model))), np.degrees(wide * found.phase_std[shown, channel])
    near = np.interp(etfe.frequency_hz, frequency_hz, angle)
    phase = near + (np.degrees(np.angle(measured)) - near + 180) % 360 - 180
    with np.errstate(invalid="ignore", divide="ignore"):
        half = np.degrees(np.arcsin(np.minimum(radius / np.abs(measured), 1.0)))
    unit = solution.ports.output_units[place[1]], solution.ports.input_units[place[2]]
    gain = "Magnitude" if unit[0] == unit[1] else f"Magnitude [{unit[0]} / ({unit[1]})]"
    heights = (
        curve("measured", etfe.frequency_hz, np.abs(measured), MEASURED, radius, points=True),
        curve("model", frequency_hz, size, MODEL, size * np.minimum(off, 1.0)),
    )
    angles = (
        curve("measured", etfe.frequency_hz, phase, MEASURED, half, points=True),
        curve("model", frequency_hz, angle, MODEL, turned),
    )
    kept = _reach(measured, size)
    return (
        Figure("Magnitude", "Frequency [Hz]", gain, heights, y_range=kept),
        Figure("Phase", "Frequency [Hz]", "Phase [°]", angles, log_y=False, y_range=_phase_range(angle, phase)),
    )


def step_figure(found: StepResponses, channel: int, final: float, confidence: float) -> Figure:
    """One channel's response to a unit step, with its bounds and its final value."""
    time, value = found.time_s[:, channel], found.value[:, channel]
    half = quantile(confidence) * found.std[:, channel]
    course = replace(curve("output", time, value, MODEL, half), dashed=False)
    lines = (Line("y", 0.0), Line("y", final)) if np.isfinite(final) else (Line("y", 0.0),)
    kept = _data_range(half, value, np.array([line.at for line in lines]))
    title, axes = "Step response", ("Time [s]", "Output per step")
    return Figure(title, *axes, (course,), log_x=False, log_y=False, height=380, lines=lines, y_range=kept)


def locus_figure(solution: ExternalSolution, channel: int) -> Figure:
    """One channel's poles and zeros below half the sampling rate, with their deviations, and its root locus."""
    found, limit = solution.loci, np.pi / solution.ports.sampling_period_s
    poles, zeros = found.poles[channel], found.zeros[channel]
    near = np.concatenate([each[np.abs(each) < limit] for each in (poles, zeros)])
    reach = 1.3 * float(np.abs(near).max(initial=0.0)) or float(limit)
    paths = found.roots[:, channel].ravel()
    paths = paths[np.isfinite(paths) & (np.abs(paths.real) <= reach) & (np.abs(paths.imag) <= reach)]
    wide = quantile(solution.estimate.confidence)
    curves = [
        curve("closed loop", paths.real, paths.imag, GREY, points=True),
        _roots("poles", poles, MODEL),
        _roots("zeros", zeros, MEASURED),
        _bounds("bounds of poles", poles, wide * found.pole_std[channel], reach, MODEL),
        _bounds("bounds of zeros", zeros, wide * found.zero_std[channel], reach, MEASURED),
    ]
    ends = (-reach, reach)
    return Figure(
        "Root locus",
        "Real part [rad/s]",
        "Imaginary part [rad/s]",
        tuple(each for each in curves if any(np.isfinite(each.x))),
        log_x=False,
        log_y=False,
        x_range=ends,
        y_range=ends,
        equal=True,
        height=380,
        lines=(Line("x", 0.0),),
    )


@dataclass(frozen=True)
class Trace:
    """Measured and simulated output of one shot."""

    name: str  # name of the shot
    time_s: FloatArray  # (n_row,): time since it began [s]
    measured: FloatArray  # (n_row,): measured output
    simulated: FloatArray  # (n_row,): simulated one
    # (n_row,): half the width of the region in which measured values are expected; None where it is unknown.
    half: FloatArray | None = None


def trace_figures(trace: Trace, unit: str) -> tuple[Figure, Figure]:
    """Measured and simulated output of one shot, with bounds, and their difference."""
    to_unit, shown = readable_factor(unit)
    time, measured, simulated = trace.time_s, to_unit * trace.measured, to_unit * trace.simulated
    half = None if trace.half is None else to_unit * trace.half
    both = (
        over_time("measured", time, measured, MEASURED),
        over_time("simulated", time, simulated, MODEL, half=half),
    )
    left = over_time("measured less simulated", time, measured - simulated, ERROR)
    limits = [] if half is None else [over_time("bounds", time, 0 * half, GREY, half=half)]
    reach, apart = _data_range(half, measured, simulated), _data_range(half, measured - simulated)
    unit = f"[{shown}]"
    return (
        Figure(trace.name, "", unit, both, log_x=False, log_y=False, y_range=reach, height=300),
        Figure("Difference", "Time [s]", unit, (left, *limits), log_x=False, log_y=False, y_range=apart, height=230),
    )


def _data_range(half: FloatArray | None, *curves: FloatArray) -> tuple[float, float] | None:
    """Ends of an axis that follows curves (n_row,) where bounds of half widths (n_row,) would hide them; None else."""
    every = np.concatenate(curves)
    low, high = float(every.min()), float(every.max())
    if half is None or not high > low or not np.nanmax(half, initial=0.0) > _HIDES * (high - low):
        return None
    return low - _HIDES * (high - low), high + _HIDES * (high - low)


def _roots(name: str, roots: ComplexArray, shade: int) -> Curve:
    texts = tuple(f"{name[:-1]} {root.real:.4g} {root.imag:+.4g}j rad/s" for root in roots)
    symbol: Literal["cross", "ring"] = "cross" if name == "poles" else "ring"
    return replace(curve(name, roots.real, roots.imag, shade, points=True), texts=texts, symbol=symbol)


def _bounds(name: str, roots: ComplexArray, half: ComplexArray, reach: float, shade: int) -> Curve:
    """Crosses whose arms are as long as the bounds of real and imaginary parts."""
    x: list[float] = []
    y: list[float] = []
    for root, arm in zip(roots, half, strict=True):
        if np.isfinite(root) and np.isfinite(arm) and abs(root) <= reach:
            x += [root.real - arm.real, root.real + arm.real, np.nan, root.real, root.real, np.nan]
            y += [root.imag, root.imag, np.nan, root.imag - arm.imag, root.imag + arm.imag, np.nan]
    return Curve(name, tuple(x), tuple(y), shade=shade)


def _reach(measured: ComplexArray, model: FloatArray) -> tuple[float, float]:
    """Ends of the magnitudes that are worth showing."""
    known = np.abs(measured)[np.isfinite(measured)]
    every = np.concatenate([known, model[model > 1e-3 * model.max()]])
    return 0.5 * float(every[every > 0].min()), 2.0 * float(every.max())


def _phase_range(model: FloatArray, measured: FloatArray) -> tuple[float, float]:
    known = measured[np.isfinite(measured)]
    low = min(known.min(initial=0.0), max(model.min(), -720.0))
    return float(90 * np.floor(low / 90)), float(90 * np.ceil(max(model.max(), known.max(initial=model.max())) / 90))
