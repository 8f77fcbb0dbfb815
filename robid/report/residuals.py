"""Residuals over frequency on the page of a fit: relative to the response, and in standard deviations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.report.section import Beside, Choice, Curve, Figure, Line, Part, Section
from robid.results.line_residuals import LineResiduals, root_mean_square

_SHADES, _MOST = 5, 10  # Shades of outputs, each solid and dashed
_INK = 5
_ALL_NOISE = 0.999
_LEAD = (
    "Where over frequency the model misses the measurement: root mean squares over the configurations, of the elements"
    " that count in the fit. Relative to the modelled response, and in standard deviations, in which a model that"
    " lacks nothing comes to 1."
)


@dataclass(frozen=True)
class ResidualData:
    """Residuals of a model on one set of responses."""

    name: str  # Which responses
    frequency_hz: FloatArray  # (n_freq,) Their lines [Hz]
    outputs: tuple[str, ...]  # Names of the outputs
    inputs: tuple[str, ...]  # Names of the inputs
    lines: LineResiduals  # The residuals
    # Frequencies that stand out: output, frequency [Hz], and what is said of it
    marks: tuple[tuple[str, float, str], ...] = ()


def residual_section(every: Sequence[ResidualData], allowed: str) -> tuple[Section, ...]:
    """Lays out residuals over frequency; nothing without any.

    Args:
        every: The residuals, with the same inputs and outputs.
        allowed: What a standard deviation holds, in words.
    """
    if not every:
        return ()
    first = every[0]
    groups = [first.outputs[at : at + _MOST] for at in range(0, len(first.outputs), _MOST)]
    whole = [] if len(first.inputs) == 1 else [("all inputs", slice(None))]
    inputs = [*whole, *((name, slice(place, place + 1)) for place, name in enumerate(first.inputs))]
    options: list[tuple[str, tuple[Part, ...]]] = [
        (_option(name, group, len(groups)), (Beside(tuple(_figures(every, chosen, group)), 2),))
        for group in groups
        for name, chosen in inputs
    ]
    caption = Choice("Input", tuple(options))
    lead = f"{_LEAD} {allowed} “Noise alone” is what the covariance of the response gives."
    return (Section("Residuals over frequency", lead, (caption,), "residuals"),)


def _option(name: str, group: tuple[str, ...], count: int) -> str:
    return name if count == 1 else f"{name}, {group[0]} to {group[-1]}"


def _figures(every: Sequence[ResidualData], inputs: slice, outputs: tuple[str, ...]) -> Iterator[Figure]:
    """The two figures of each set of responses, on the same scales."""
    views = (
        ("Residual over response", "Residual / response, RMS", "relative", "noise", ()),
        (
            "Residual in standard deviations", "Residual / deviation, RMS", "deviations", "noise_deviations",
            (Line("y", 1.0, "expected"),),
        ),
    )  # fmt: skip
    ends = [_ends(every, view[2:4], inputs, outputs) for view in views]
    for data in every:
        for (title, label, size, noise, lines), scale in zip(views, ends, strict=True):
            if scale is None:
                continue
            curves = (*_curves(data, size, noise, inputs, outputs), *_rug(data, outputs, scale[0]))
            if curves:
                yield Figure(
                    f"{title}: {data.name}", "Frequency [Hz]", label, curves, y_range=scale, lines=lines, height=380
                )


def _rms(data: ResidualData, what: str, inputs: slice, outputs: tuple[str, ...]) -> FloatArray:
    """Root mean squares (n_freq, n_out) over configurations and some inputs."""
    rows = [data.outputs.index(name) for name in outputs]
    return root_mean_square(getattr(data.lines, what)[:, :, rows, inputs], (0, 3))


def _noise(data: ResidualData, what: str, inputs: slice, outputs: tuple[str, ...]) -> FloatArray:
    """The same (n_freq,) of noise alone, over the outputs, too."""
    return root_mean_square(_rms(data, what, inputs, outputs), (1,))


def _ends(
    every: Sequence[ResidualData], what: tuple[str, ...], inputs: slice, outputs: tuple[str, ...]
) -> tuple[float, float] | None:
    """Ends of the vertical axis over all sets of responses; None where nothing is known."""
    size, noise = what
    values = [_rms(data, size, inputs, outputs).ravel() for data in every]
    values += [_noise(data, noise, inputs, outputs) for data in every]
    if size == "deviations":
        values.append(np.ones(1 if any(np.isfinite(each).any() for each in values) else 0))
    known = np.concatenate(values)
    known = known[np.isfinite(known) & (known > 0)]
    return (float(known.min()) / 1.6, float(known.max()) * 1.2) if known.size else None


def _curves(data: ResidualData, size: str, noise: str, inputs: slice, outputs: tuple[str, ...]) -> Iterator[Curve]:
    x = tuple(data.frequency_hz.tolist())
    for place, (name, values) in enumerate(zip(outputs, _rms(data, size, inputs, outputs).T, strict=True)):
        if np.isfinite(values).any():
            yield Curve(name, x, tuple(values.tolist()), shade=place % _SHADES, dashed=place >= _SHADES)
    alone = _noise(data, noise, inputs, outputs)
    # Where noise is all that a deviation allows for, it comes to 1 everywhere.
    if np.isfinite(alone).any() and (size != "deviations" or np.nanmin(alone) < _ALL_NOISE):
        yield Curve("noise alone", x, tuple(alone.tolist()), shade=_INK, dashed=True)


def _rug(data: ResidualData, outputs: tuple[str, ...], at: float) -> Iterator[Curve]:
    """Measured resonances as points along the lower edge."""
    shown = [(hz, text) for output, hz, text in data.marks if output in outputs]
    if shown:
        x, texts = zip(*shown, strict=True)
        yield Curve("resonances", x, (1.12 * at,) * len(x), texts, points=True, symbol="small", shade=_INK)
