"""Figures beyond curves: arms, still or moving, curves in space, ratios, heat maps, matrices of Bode plots."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from robid.arrays import ComplexArray, FloatArray, check_shape
from robid.frf.frf import Frf
from robid.frf.quality import dropped_lines
from robid.report.numbers import MINUS, fixed, number_of, percent, pretty_unit, rounded
from robid.signals.quantities import readable, readable_units


@dataclass(frozen=True)
class Skeletons:
    """Arms in space that the reader can turn, on the floor z = 0."""

    title: str  # title above it
    names: tuple[str, ...]  # name of each arm
    # Points of each arm from base to tool, (x, y, z) in the base frame [m].
    points: tuple[tuple[tuple[float, float, float], ...], ...]
    weights: tuple[float, ...]  # weight of each arm, which its line shows
    others: tuple[tuple[float, float, float], ...] = ()  # tool points of arms that are not drawn [m]
    caption: str = ""  # what the reader has to know


Triples: TypeAlias = tuple[tuple[float, float, float], ...]


@dataclass(frozen=True)
class Motion:
    """How points swing about their rest: by `cosine cos(phase) + sine sin(phase)`."""

    name: str  # its name
    anchor: str  # its name in the page's address; who follows it sees the motion
    text: str  # what is said of it
    cosine: Triples  # (x, y, z) of each point [m]
    sine: Triples  # the same a quarter of a period later [m]


@dataclass(frozen=True)
class MovingArms:
    """Arms in space that swing slowly; the reader chooses arm and motion, stops it, and turns the view."""

    title: str  # title above it
    names: tuple[str, ...]  # name of each arm
    # Points of each arm at rest from base to tool, then the ends of two axes of its tool, in the base frame [m].
    points: tuple[Triples, ...]
    motions: tuple[tuple[Motion, ...], ...]  # motions of each arm
    caption: str = ""  # what the reader has to know


@dataclass(frozen=True)
class Heatmap:
    """Values between -1 and 1 of pairs, as a symmetric matrix."""

    title: str  # title above it
    names: tuple[str, ...]  # of rows and of columns
    values: tuple[tuple[float, ...], ...]  # one tuple a row; not finite where there is none
    value_title: str  # what they are
    groups: tuple[int, ...] = ()  # number of rows of each group, in their order; one group when empty
    caption: str = ""  # what the reader has to know


@dataclass(frozen=True)
class Ratio:
    """A value over its nominal one."""

    name: str  # its name
    estimate: float  # the ratio
    lower: float  # lower end of its interval
    upper: float  # upper end of its interval
    truth: float | None = None  # true value over the nominal one, or None
    identifiable: bool = True  # whether the data determine it
    text: str = ""  # the value itself, written out


@dataclass(frozen=True)
class RatioChart:
    """Values over their nominal ones, with intervals and the truth."""

    title: str  # title above it
    # Title and values of each panel; they stand beside each other on one scale.
    panels: tuple[tuple[str, tuple[Ratio, ...]], ...]
    interval: str  # what the intervals are, as in `95 % interval`
    caption: str = ""  # what the reader has to know


@dataclass(frozen=True)
class Layer:
    """Curves of one kind, one at each place; where a height is not finite there is a gap."""

    name: str  # its name
    x: tuple[float, ...]  # along the curves, the same at all places
    heights: tuple[tuple[float, ...], ...]  # one tuple of values a place
    drawn: Literal["points", "line", "dashed"] = "line"  # how


@dataclass(frozen=True)
class Waterfall:
    """Curves over one axis, one behind the other along a second one, that the reader can turn."""

    title: str  # title above it
    x_title: str  # quantity and unit along the curves
    place_title: str  # quantity and unit of the places
    y_title: str  # quantity and unit of the heights; the shorter, the better
    places: tuple[float, ...]  # where the curves stand
    layers: tuple[Layer, ...]  # what is drawn at each place
    log_x: bool = True  # whether x is logarithmic
    caption: str = ""  # what the reader has to know
    height: int = 460  # height on the page [pixel]

    def __post_init__(self) -> None:
        for layer in self.layers:
            if {len(layer.heights)} != {len(self.places)} or {*map(len, layer.heights)} != {len(layer.x)}:
                raise ValueError(f"Layer `{layer.name}` must have one height for each of its x at each place.")


_SMALLEST = 1e-30


@dataclass(frozen=True)
class Mark:
    """A frequency that stands out."""

    configuration: int  # index of the configuration
    channel: str  # name of the channel, marked in its own element
    frequency_hz: float  # the frequency [Hz]


@dataclass(frozen=True)
class Overlay:
    """A further measured response, at lines of its own."""

    name: str  # its name
    frequency_hz: FloatArray  # (n_line,): its frequencies [Hz]
    response: ComplexArray  # (n_conf, n_line, n_out, n_in): the response; NaN where it has none
    # (n_conf, n_line, n_out, n_in): Radius of each element's uncertainty circle over its magnitude; 0 where that is
    # unknown.
    radius: FloatArray


@dataclass(frozen=True)
class BodeResponse:
    """One measured response that the reader may choose."""

    label: str  # its name
    frf: Frf  # the response with its covariance
    # Name and response (n_conf, n_freq, n_out, n_in) of each model, in the unit of `frf.response`.
    models: tuple[tuple[str, ComplexArray], ...] = ()
    marks: tuple[Mark, ...] = ()  # frequencies that stand out
    mark_title: str = ""  # what they are
    overlays: tuple[Overlay, ...] = ()  # further measured responses, in the unit of `frf.response`

    def __post_init__(self) -> None:
        axes = ("n_conf", "n_freq", "n_out", "n_in")
        for name, model in self.models:
            check_shape(
                f"{name}_response", model, " ".join(axes), **dict(zip(axes, self.frf.response.shape, strict=True))
            )


@dataclass(frozen=True)
class BodeMatrix:
    """Responses of every output to every input; the reader chooses response, configuration, element and view."""

    title: str  # title above it
    responses: tuple[BodeResponse, ...]  # what there is to choose from
    level: float = 0.95  # level of the bands
    input_quantity: str = "torque"  # what the inputs are, as in `torque`
    output_quantity: str = "acceleration"  # what the outputs are, as in `acceleration`
    unit: str = "rad/(s^2 {})"  # unit of an output over an input's, which stands for `{}`
    caption: str = ""  # what the reader has to know
    measured: str = "measured"  # what the measured responses are called
    quality: bool = True  # whether distortion, noise and coherence are shown too


def bode_data(figure: BodeMatrix) -> dict[str, Any]:
    """Gathers what the page draws, rounded."""
    return {
        "kind": "bode",
        "level": percent(figure.level),
        "input_quantity": figure.input_quantity,
        "output_quantity": figure.output_quantity,
        "measured": figure.measured,
        "responses": [_response_data(response, figure) for response in figure.responses],
    }


def configuration_label(frf: Frf, index: int) -> str:
    """Names a configuration by its number and joint angles, as in `3: 0, 20, 30°`."""
    values = readable(frf.configurations[index], frf.joint_units)
    if frf.joint_units is not None:
        pairs = zip(values.tolist(), readable_units(frf.joint_units, len(values)), strict=True)
        texts = [f"{value:.2f} m" if unit == "m" else f"{value:.0f}°" for value, unit in pairs]
        return f"{number_of(index)}: {', '.join(texts).replace('-', MINUS)}"
    written = ", ".join(str(angle).replace("-", MINUS) for angle in np.round(values).astype(int))
    return f"{number_of(index)}: {written}°" if written else number_of(index)


def band_radius(frf: Frf, level: float) -> FloatArray:
    """Radius of each element's uncertainty circle relative to its magnitude (n_conf, n_freq, n_out, n_in)."""
    return np.asarray(frf.error_radius(level) / np.maximum(np.abs(frf.response), _SMALLEST))


def _response_data(response: BodeResponse, figure: BodeMatrix) -> dict[str, Any]:
    frf = response.frf
    radius = band_radius(frf, figure.level)
    response_known, dropped = frf.known_response, dropped_lines(frf)
    configurations = [
        {
            "label": configuration_label(frf, index),
            **_curve(response_known[index]),
            "models": [_curve(model[index]) for _, model in response.models],
            "overlays": [
                {**_curve(one.response[index]), "radius": _radius(one.radius[index])} for one in response.overlays
            ],
            "dropped": [[rounded(value) for value in frf.frequency_hz[lost]] for lost in dropped[index].T],
            "radius": _radius(radius[index]),
            "marks": [
                [mark.channel, rounded(mark.frequency_hz)] for mark in response.marks if mark.configuration == index
            ],
            **(_quality(frf, index, figure.level) if figure.quality else {}),
        }
        for index in range(frf.response.shape[0])
    ]
    return {
        "label": response.label,
        "frequency": [rounded(value) for value in frf.frequency_hz],
        "inputs": list(frf.input_names),
        "outputs": list(frf.output_names),
        "unit": pretty_unit(figure.unit.format(frf.input_unit)),
        "models": [name for name, _ in response.models],
        "overlays": [
            {"name": overlay.name, "frequency": [rounded(value) for value in overlay.frequency_hz]}
            for overlay in response.overlays
        ],
        "mark_title": response.mark_title,
        "configurations": configurations,
    }


def _curve(response: ComplexArray) -> dict[str, Any]:
    """Magnitude and phase of a response (n_freq, n_out, n_in)."""
    return {"magnitude": _decibels(response), "phase": _per_element(np.rad2deg(np.angle(response)), decimals=1)}


def _radius(radius: FloatArray) -> list[Any] | None:
    """Radii of the bands; None where there are none."""
    return _per_element(radius, 3) if np.nan_to_num(radius).any() else None


def _quality(frf: Frf, index: int, level: float) -> dict[str, Any]:
    """Levels per output and the factor per input, in dB: an element's level is the sum of the two.

    `spread` turns the radius of a band into a deviation, for records whose periods do not tell noise.
    """
    odd, even = (frf.residual_level(kind) for kind in ("odd", "even"))
    before, noise = frf.uncompensated_response, frf.noise_covariance
    return {
        "uncompensated": None if before is None else _decibels(before[index]),
        "factor": _level(_deviation(frf.input_factor[index])),
        "noise": None if noise is None else _level(_deviation(noise[index])),
        "spread": rounded(frf.radius_factor(level)) if noise is None and frf.covariance.any() else None,
        "odd": None if odd is None else _level(odd[index]),
        "even": None if even is None else _level(even[index]),
        "incoherence": None
        if frf.coherence is None or not np.isfinite(frf.coherence[index]).any()
        else [[rounded(value, 3) for value in row] for row in 1 - frf.coherence[index].T],
    }


def _deviation(covariance: ComplexArray) -> FloatArray:
    return np.sqrt(np.real(np.diagonal(covariance, axis1=-2, axis2=-1)))


def _level(amplitude: FloatArray) -> list[Any]:
    """Amplitudes (n_freq, n_channel) in dB, the frequency axis last."""
    decibels = 20 * np.log10(np.maximum(amplitude, _SMALLEST)).T
    return [[fixed(value, 1) for value in row] for row in decibels]


def _decibels(response: ComplexArray) -> list[Any]:
    return _per_element(20 * np.log10(np.maximum(np.abs(response), _SMALLEST)), decimals=2)


def _per_element(values: FloatArray, digits: int = 4, *, decimals: int | None = None) -> list[Any]:
    """Puts the frequency axis (n_freq, n_out, n_in) last and rounds; not finite becomes null."""
    rows = np.moveaxis(values, 0, -1)
    if decimals is None:
        return [[[rounded(value, digits) for value in element] for element in row] for row in rows]
    return [[[fixed(value, decimals) for value in element] for element in row] for row in rows]
