"""How well a model agrees with responses, position by position."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, Quantity

_DEVIATIONS = 2.0
_CHANCE = 3.0  # deviations of a mean square by which noise may exceed what is expected of it


_ELEMENT = "position output input"


@dataclass(frozen=True)
class Agreement:
    """Measures of each position and element (n_pos, n_out, n_in); elements without weight are left out.

    Attributes:
        share_within: Share of the lines where the error is within two deviations; NaN where these are unknown.
        excess: The same of what noise, and its chance, do not explain, however uncertain the model is, over the
            response at all positions, or what is natural to the element by the others of its row and column where that
            is larger: coupling that is hardly there need not be known.
    """

    share_within: Annotated[FloatArray, Quantity("1", _ELEMENT, "Share of the lines within two deviations")]
    error_ratio: Annotated[FloatArray, Quantity("1", _ELEMENT, "Error over deviation, root mean square")]
    error_db: Annotated[FloatArray, Quantity("dB", _ELEMENT, "Median distance of the magnitudes")]
    relative_error: Annotated[FloatArray, Quantity("1", _ELEMENT, "Error over response, root mean square")]
    excess: Annotated[FloatArray, Quantity("1", _ELEMENT, "What deviations do not explain, over what is natural")]


def agree(response: ComplexArray, modelled: ComplexArray, std: FloatArray, noise: FloatArray) -> Agreement:
    """Compares a model with responses.

    Args:
        response (n_pos, n_freq, n_out, n_in): What was measured.
        modelled (n_pos, n_freq, n_out, n_in): What the model says.
        std (n_pos, n_freq, n_out, n_in): Root of `E|error|^2`; NaN where it is unknown, infinite where an element is
            left out.
        noise (n_pos, n_freq, n_out, n_in): What of it the measurement alone makes.
    """
    counts = ~np.isinf(std)
    known = counts & (std > 0)
    size = np.abs(modelled - response)
    ratio = np.divide(size, std, out=np.full(size.shape, np.nan), where=known)
    tiny = np.finfo(float).tiny
    levels = [20 * np.log10(np.maximum(np.abs(one), tiny)) for one in (modelled, response)]
    decibels = np.abs(levels[0] - levels[1])
    power = _mean(np.abs(response) ** 2, counts)
    error = _mean(size**2, counts)
    expected, chance = _of_noise(np.where(known, noise, np.nan), counts)
    return Agreement(
        share_within=_mean((ratio <= _DEVIATIONS).astype(float), known),
        error_ratio=np.sqrt(_mean(ratio**2, known)),
        error_db=_median(decibels, counts),
        relative_error=np.sqrt(error / power),
        excess=np.sqrt(np.maximum(error - expected - chance, 0)) / _natural(power),
    )


def hidden_error(response: ComplexArray, std: FloatArray) -> FloatArray:
    """Returns the error (n_pos, n_out, n_in), as of `Agreement.excess`, that chance could hide.

    Args:
        response (n_pos, n_freq, n_out, n_in): What was measured.
        std (n_pos, n_freq, n_out, n_in): Its deviation; NaN where it is unknown, infinite where it is left out.
    """
    counts = ~np.isinf(std)
    return np.asarray(np.sqrt(_of_noise(std, counts)[1]) / _natural(_mean(np.abs(response) ** 2, counts)))


def expected_share(degrees_of_freedom: float, deviations: float = _DEVIATIONS) -> float:
    """Share of the lines of a perfect model within some deviations that were estimated; NaN where they were not.

    The square of a circular normal error over its estimated variance is F distributed with 2 and 2 nu degrees of
    freedom.
    """
    if degrees_of_freedom <= 0:
        return float("nan")
    return float(-np.expm1(-degrees_of_freedom * np.log1p(deviations**2 / degrees_of_freedom)))


def _of_noise(noise: FloatArray, counts: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Mean square that noise of each line alone makes, and by how much chance may exceed it."""
    squared = np.where(counts, np.nan_to_num(noise, posinf=0.0), 0.0) ** 2
    expected, fourth = (np.nan_to_num(_mean(power, counts)) for power in (squared, squared**2))
    return expected, np.asarray(_CHANCE * np.sqrt(fourth / np.maximum(counts.sum(axis=1), 1)))


def _natural(power: FloatArray) -> FloatArray:
    """Size (n_out, n_in) of each element over all positions, or what its row and column make of it if that is more.

    A product of a factor of the output and one of the input does not depend on their units.
    """
    size = np.sqrt(np.nanmean(power, axis=0))
    logarithm = np.log(np.maximum(size, np.finfo(float).tiny))
    rows, columns = logarithm.mean(axis=1, keepdims=True), logarithm.mean(axis=0, keepdims=True)
    return np.asarray(np.maximum(size, np.exp(rows + columns - logarithm.mean())))


def _mean(values: FloatArray, chosen: BoolArray) -> FloatArray:
    """Mean over the lines of the chosen elements; NaN where there is none."""
    count = chosen.sum(axis=1)
    total = np.where(chosen, values, 0.0).sum(axis=1)
    return np.asarray(np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0))


def _median(values: FloatArray, chosen: BoolArray) -> FloatArray:
    some = np.asarray(chosen.any(axis=1))
    found = np.nanmedian(np.where(chosen | ~some[:, None], values, np.nan), axis=1)
    return np.where(some, found, np.nan)
