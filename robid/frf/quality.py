"""How well responses are known: what a reader without a model looks at first."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.frf.frf import Frf
from robid.frf.saturation import saturation_error


@dataclass(frozen=True)
class Quality:
    """How well each output's response is known, at the input that moves it the most.

    NaN where a line told too little of all inputs, or where the record does not tell.

    Attributes:
        strongest (n_conf, n_freq, n_out): Index of that input.
        relative_std (n_conf, n_freq, n_out): Standard deviation over the magnitude.
        signal_to_noise_db (n_conf, n_freq, n_out): Power over the variance that noise gives it [dB].
        coherence (n_conf, n_freq, n_out): Multiple coherence: share of the output's power that the response to all
            inputs explains.
        odd (n_conf, n_freq, n_out): Level of the odd silent lines, as a deviation of the response over its magnitude.
        even (n_conf, n_freq, n_out): The same of the even ones.
    """

    strongest: IntArray
    relative_std: FloatArray
    signal_to_noise_db: FloatArray
    coherence: FloatArray
    odd: FloatArray
    even: FloatArray


def known_response(frf: Frf) -> ComplexArray:
    """The response (n_conf, n_freq, n_out, n_in), NaN where a line told too little of an input."""
    if frf.dropped is None:
        return frf.response
    return np.asarray(np.where(frf.dropped[:, :, None], complex(np.nan, np.nan), frf.response))


def dropped_lines(frf: Frf) -> BoolArray:
    """Lines (n_conf, n_freq, n_in) that told too little of an input."""
    shape = (*frf.response.shape[:2], frf.response.shape[3])
    return np.zeros(shape, bool) if frf.dropped is None else frf.dropped


def saturated_signals(
    frf: Frf, inputs: Collection[int] | None = None, outputs: Collection[int] | None = None
) -> dict[str, FloatArray]:
    """Share of the time (n_conf,) in which each signal saturates, by what it is; empty where it is unknown.

    Args:
        frf: The response.
        inputs: Indices of the inputs that count; all unless told.
        outputs: Those of the outputs.
    """
    sides = (
        (frf.input_channels, frf.saturated_inputs, inputs),
        (frf.measured_channels or frf.output_channels, frf.saturated_outputs, outputs),
    )
    return {
        f"{channel.name}: {channel.title}": share[:, index]
        for channels, share, chosen in sides
        if share is not None
        for index, channel in enumerate(channels)
        if chosen is None or index in chosen
    }


def worst_saturation(frf: Frf) -> float:
    """Largest share of the time in which an input or output saturates; 0 where none does or it is unknown."""
    return float(max((share.max(initial=0.0) for share in saturated_signals(frf).values()), default=0.0))


def saturation_text(frf: Frf) -> str:
    """Says by how much a saturated signal may put a response off, beyond its uncertainty; empty where none is."""
    share = worst_saturation(frf)
    if not share:
        return ""
    off = f"{100 * saturation_error(share):.2g} %"
    return f"a signal saturates for {100 * share:.2g} % of the time, which may put the response off by {off} and more"


def judge(frf: Frf) -> Quality:
    """Says how well a response is known."""
    size = np.abs(known_response(frf))
    columns = np.sqrt(np.real(np.diagonal(frf.input_factor, axis1=-2, axis2=-1)))
    reach = np.nan_to_num(size / np.maximum(columns, np.finfo(float).tiny)[..., None, :])
    strongest = reach.argmax(axis=-1)
    unknown = np.full(size.shape[:3], np.nan)

    def share(deviation: FloatArray | None) -> FloatArray:
        if deviation is None:
            return unknown
        chosen, whole = (np.take_along_axis(each, strongest[..., None], -1)[..., 0] for each in (deviation, size))
        known = np.isfinite(chosen) & (whole > 0)
        return np.asarray(np.divide(chosen, whole, out=unknown.copy(), where=known))

    has_variance = frf.total_covariance is not None or frf.noise_covariance is not None
    noise = share(None if frf.noise_covariance is None else np.sqrt(frf.element_variance(noise_only=True)))
    return Quality(
        strongest=strongest,
        relative_std=share(np.sqrt(frf.element_variance()) if has_variance else None),
        signal_to_noise_db=-20 * np.log10(noise, out=unknown.copy(), where=noise > 0),
        coherence=unknown if frf.coherence is None else frf.coherence,
        odd=share(frf.response_level("odd")),
        even=share(frf.response_level("even")),
    )


def middle(values: FloatArray) -> float:
    """Median of what is finite; NaN where nothing is."""
    finite = values[np.isfinite(values)]
    return float(np.median(finite)) if finite.size else float("nan")


def lowest(values: FloatArray) -> float:
    """Smallest of what is finite; NaN where nothing is."""
    finite = values[np.isfinite(values)]
    return float(finite.min()) if finite.size else float("nan")
