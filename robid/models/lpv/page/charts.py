"""Figures of a position-dependent model: responses with bands, poles over the range, the regularisation path."""

from __future__ import annotations

from statistics import NormalDist

import numpy as np

from robid.arrays import FloatArray
from robid.models.lpv.fit.solution import Held, LpvSolution, Ports
from robid.models.lpv.fit.uncertainty import continuous_poles
from robid.report.numbers import joint_text, significant
from robid.report.section import Curve, Figure, Line

_MEASURED, _MODEL = 0, 1
_SURFACE, _GRID = 7, 101


def quantile(confidence: float) -> float:
    """Returns how many standard deviations lie on either side at a level of confidence."""
    return NormalDist().inv_cdf(0.5 + 0.5 * confidence)


def place_label(ports: Ports, point: FloatArray) -> str:
    """Names a position by its scheduling parameters."""
    pairs = zip(ports.scheduling, point.tolist(), ports.scheduling_units, strict=True)
    return ", ".join(f"{name} {_position_text(value, unit)}" for name, value, unit in pairs)


def _position_text(value: float, unit: str) -> str:
    """Writes a scheduling parameter with its unit, angles in degrees."""
    if unit == "rad":
        return f"{joint_text(np.degrees(value), unit)}°"
    return f"{joint_text(value, unit) if unit == 'm' else significant(value, 4)} {unit}"


def gain_title(ports: Ports, output: int, port: int) -> str:
    """Names the magnitude of an element with its unit."""
    return f"Magnitude [{ports.output_units[output]} / ({ports.input_units[port]})]"


def response_figures(held: Held, ports: Ports, place: tuple[int, int, int], confidence: float) -> tuple[Figure, Figure]:
    """Magnitude and phase of one element at one position, measured and modelled, with their bands.

    Args:
        held: The responses.
        ports: Channels.
        place: Position, output and input.
        confidence: Level of the bands.
    """
    at = (place[0], slice(None), place[1], place[2])
    measured, model, frequency_hz = held.response[at], held.modelled[at], held.frequency_hz
    radius = np.where(np.isfinite(held.std[at]), held.std[at], np.nan) * np.sqrt(-np.log(1 - confidence))
    half = quantile(confidence) * held.modelled_std[at] / np.sqrt(2)
    left_out = np.isinf(held.std[at])
    size, angle = np.where(left_out, np.nan, np.abs(measured)), np.degrees(np.unwrap(np.angle(model)))
    phase = angle + (np.degrees(np.angle(measured)) - angle + 180) % 360 - 180
    turned, own = (
        np.degrees(np.arcsin(np.minimum(wide / np.maximum(np.abs(one), np.finfo(float).tiny), 1.0)))
        for wide, one in ((radius, measured), (half, model))
    )
    heights = (
        _banded("measured", frequency_hz, size, radius, _MEASURED),
        _banded("model", frequency_hz, np.abs(model), np.minimum(half, np.abs(model)), _MODEL),
    )
    angles = (
        _banded("measured", frequency_hz, np.where(left_out, np.nan, phase), turned, _MEASURED),
        _banded("model", frequency_hz, angle, own, _MODEL),
    )
    known = np.concatenate([size[np.isfinite(size)], np.abs(model)])
    known = known[known > 0]
    ends = (0.5 * float(known.min()), 2.0 * float(known.max())) if known.size else None
    return (
        Figure("Magnitude", "Frequency [Hz]", gain_title(ports, place[1], place[2]), heights, y_range=ends),
        Figure("Phase", "Frequency [Hz]", "Phase [°]", angles, log_y=False),
    )


def surface_figures(solution: LpvSolution, output: int, port: int) -> tuple[Figure, ...]:
    """Magnitude of one element of the frozen model over the range of the first scheduling parameter."""
    points = _line(solution, _SURFACE)
    lines = solution.own.frequency_hz
    frequency_hz = np.geomspace(lines[0], lines[-1], 4 * _GRID) if lines.size > 1 else lines
    size = np.abs(solution.model.frozen_response(points, frequency_hz)[..., output, port])
    curves = tuple(
        Curve(place_label(solution.ports, point), tuple(frequency_hz.tolist()), tuple(one.tolist()))
        for point, one in zip(points, size, strict=True)
    )
    title = "Over the range"
    return (Figure(title, "Frequency [Hz]", gain_title(solution.ports, output, port), curves, height=380),)


def pole_figures(solution: LpvSolution) -> tuple[Figure, Figure]:
    """Natural frequencies and damping ratios of the frozen model over the range of the first scheduling parameter."""
    points = _line(solution, _GRID)
    poles = continuous_poles(solution.core_model.at(points).A, solution.ports.sampling_period_s)
    upper = poles.imag >= 0
    size = np.abs(poles)
    along = np.broadcast_to(_readable(points[:, 0], solution.ports.scheduling_units[0])[:, None], size.shape)[upper]
    hertz, damping = size[upper] / (2 * np.pi), -poles.real[upper] / np.maximum(size[upper], np.finfo(float).tiny)
    fitted = tuple(
        Line("x", float(value))
        for value in _readable(np.unique(solution.own.points[:, 0]), solution.ports.scheduling_units[0])
    )
    name, unit = solution.ports.scheduling[0], solution.ports.scheduling_units[0]
    title = f"{name} [{'°' if unit == 'rad' else unit}]"
    drawn = [
        Curve("poles", tuple(along.tolist()), tuple(values.tolist()), points=True, symbol="small", shade=_MODEL)
        for values in (hertz, damping)
    ]
    common = {"log_x": False, "legend": False, "lines": fitted}
    return (
        Figure("Natural frequencies", title, "Frequency [Hz]", (drawn[0],), log_y=True, **common),  # type: ignore[arg-type]
        Figure("Damping ratios", title, "Damping ratio", (drawn[1],), log_y=False, **common),  # type: ignore[arg-type]
    )


def path_figures(solution: LpvSolution) -> tuple[Figure, Figure]:
    """Costs and number of blocks over the price of a block."""
    path = solution.path
    priced = path.gamma > 0
    gamma = tuple(path.gamma[priced].tolist())
    lines = (Line("x", float(path.gamma[path.chosen]), "chosen"),) if priced[path.chosen] else ()
    left = tuple(float(np.count_nonzero(kept)) for kept in path.kept[priced])
    costs = (
        Curve("of the fit", gamma, tuple(path.refit_cost[priced].tolist()), shade=_MEASURED),
        Curve("of what chooses", gamma, tuple(path.validation_cost[priced].tolist()), shade=_MODEL, dashed=True),
    )
    blocks = (Curve("blocks", gamma, left, points=True, shade=_MODEL),)
    return (
        Figure("Costs after the refit", "Price of a block", "Weighted cost", costs, lines=lines),
        Figure("Blocks that are left", "Price of a block", "Blocks", blocks, log_y=False, legend=False, lines=lines),
    )


def _line(solution: LpvSolution, count: int) -> FloatArray:
    """Points (count, n_scheduling) along the first scheduling parameter, the others in the middle."""
    lower, upper = solution.basis.lower, solution.basis.upper
    points = np.tile(0.5 * (lower + upper), (count, 1))
    points[:, 0] = np.linspace(lower[0], upper[0], count)
    return points


def _readable(values: FloatArray, unit: str) -> FloatArray:
    return np.degrees(values) if unit == "rad" else values


def _banded(name: str, x: FloatArray, y: FloatArray, half: FloatArray, shade: int) -> Curve:
    measured = shade == _MEASURED
    known = bool(np.isfinite(half).any())
    lower, upper = (tuple((y + sign * half).tolist()) if known else () for sign in (-1, 1))
    return Curve(
        name,
        tuple(x.tolist()),
        tuple(y.tolist()),
        points=measured,
        symbol="small",
        lower=lower,
        upper=upper,
        shade=shade,
        dashed=not measured,
    )
