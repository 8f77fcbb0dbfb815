"""The Bode matrix: measured responses with their bands against models, every element a cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray, check_shape
from robid.frf.frf import Frf
from robid.report.numbers import MINUS, fixed, number_of, percent, pretty_unit, rounded
from robid.signals.positions import readable, readable_units

_SMALLEST = 1e-30


@dataclass(frozen=True)
class Mark:
    """A frequency that stands out.

    Attributes:
        configuration: Index of the configuration.
        channel: Name of the channel, marked in its own element.
        frequency_hz: The frequency [Hz].
    """

    configuration: int
    channel: str
    frequency_hz: float


@dataclass(frozen=True)
class BodeResponse:
    """One measured response that the reader may choose.

    Attributes:
        label: Its name.
        frf: The response with its covariance.
        models: Name and response (n_conf, n_freq, n_out, n_in) of each model, in the unit of `frf.response`.
        marks: Frequencies that stand out.
        mark_title: What they are.
    """

    label: str
    frf: Frf
    models: tuple[tuple[str, ComplexArray], ...] = ()
    marks: tuple[Mark, ...] = ()
    mark_title: str = ""

    def __post_init__(self) -> None:
        axes = ("n_conf", "n_freq", "n_out", "n_in")
        for name, model in self.models:
            check_shape(
                f"{name}_response", model, " ".join(axes), **dict(zip(axes, self.frf.response.shape, strict=True))
            )


@dataclass(frozen=True)
class BodeMatrix:
    """Responses of every output to every input; the reader chooses response, configuration, element and view.

    Attributes:
        title: Title above it.
        responses: What there is to choose from.
        level: Level of the bands.
        input_quantity: What the inputs are, as in `torque`.
        output_quantity: What the outputs are, as in `acceleration`.
        unit: Unit of an output over an input's, which stands for `{}`.
        caption: What the reader has to know.
    """

    title: str
    responses: tuple[BodeResponse, ...]
    level: float = 0.95
    input_quantity: str = "torque"
    output_quantity: str = "acceleration"
    unit: str = "rad/(s^2 {})"
    caption: str = ""


def bode_data(figure: BodeMatrix) -> dict[str, Any]:
    """Gathers what the page draws, rounded."""
    return {
        "kind": "bode",
        "level": percent(figure.level),
        "input_quantity": figure.input_quantity,
        "output_quantity": figure.output_quantity,
        "responses": [
            _response_data(response, figure.level, figure.unit.format(response.frf.input_unit))
            for response in figure.responses
        ],
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


def _response_data(response: BodeResponse, level: float, unit: str) -> dict[str, Any]:
    frf = response.frf
    radius = band_radius(frf, level)
    configurations = [
        {
            "label": configuration_label(frf, index),
            **_curve(_known(frf, index)),
            "models": [_curve(model[index]) for _, model in response.models],
            "radius": _per_element(radius[index], 3) if radius[index].any() else None,
            "uncompensated": None
            if frf.uncompensated_response is None
            else _decibels(frf.uncompensated_response[index]),
            "marks": [
                [mark.channel, rounded(mark.frequency_hz)] for mark in response.marks if mark.configuration == index
            ],
            **_quality(frf, index),
        }
        for index in range(frf.response.shape[0])
    ]
    return {
        "label": response.label,
        "frequency": [rounded(value) for value in frf.frequency_hz],
        "inputs": list(frf.input_names),
        "outputs": list(frf.output_names),
        "unit": pretty_unit(unit),
        "models": [name for name, _ in response.models],
        "mark_title": response.mark_title,
        "configurations": configurations,
    }


def _known(frf: Frf, index: int) -> ComplexArray:
    """The response of a configuration, NaN where a line told too little of an input."""
    if frf.dropped is None:
        return np.asarray(frf.response[index])
    return np.asarray(np.where(frf.dropped[index][:, None], np.nan, frf.response[index]))


def _curve(response: ComplexArray) -> dict[str, Any]:
    """Magnitude and phase of a response (n_freq, n_out, n_in)."""
    return {"magnitude": _decibels(response), "phase": _per_element(np.rad2deg(np.angle(response)), decimals=1)}


def _quality(frf: Frf, index: int) -> dict[str, Any]:
    """Levels per output and the factor per input, in dB: an element's level is the sum of the two."""
    inputs = np.sqrt(np.real(np.diagonal(frf.input_factor[index], axis1=-2, axis2=-1)))
    noise = None
    if frf.noise_covariance is not None:
        noise = np.sqrt(np.real(np.diagonal(frf.noise_covariance[index], axis1=-2, axis2=-1)))
    odd, even = frf.residual_level("odd"), frf.residual_level("even")
    return {
        "factor": _level(inputs),
        "noise": None if noise is None else _level(noise),
        "odd": None if odd is None else _level(odd[index]),
        "even": None if even is None else _level(even[index]),
        "incoherence": None
        if frf.coherence is None or not np.isfinite(frf.coherence[index]).any()
        else [[rounded(value, 3) for value in row] for row in 1 - frf.coherence[index].T],
    }


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
