"""What the model's errors at rest are, held against the deviations of the measured responses."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.fit.lpv.solution import Held


def deviations(held: Held, response: ComplexArray) -> FloatArray:
    """Returns the error of a response (n_pos, n_freq, n_out, n_in) over the deviation of the measured mean.

    NaN where that is unknown or the element is left out.
    """
    known = np.isfinite(held.std) & (held.std > 0)
    error = np.abs(response - held.response)
    return np.asarray(np.divide(error, held.std, out=np.full(error.shape, np.nan), where=known))


def share_within(ratio: FloatArray, limit: float) -> float:
    """Returns the share of all known ratios within a limit; NaN where there is none."""
    known = ratio[np.isfinite(ratio)]
    return float(np.mean(known <= limit)) if known.size else float("nan")


def deviation_db(held: Held) -> FloatArray:
    """Returns the median (n_out,) over positions, lines and inputs of the deviation over the response [dB]."""
    known = np.isfinite(held.std) & (held.std > 0)
    decibels = 20 * np.log10(np.where(known, held.std, np.nan) / np.abs(held.response))
    return np.asarray(np.nanmedian(decibels, axis=(0, 1, 3)))


def held_figures(name: str, held: Held, outputs: tuple[str, ...]) -> dict[str, float]:
    """Returns the shares of the lines within one and two deviations, and how far these are below the response.

    Args:
        name: What the figures' names begin with.
        held: The responses and the model's.
        outputs: Names of the outputs.
    """
    ratio = deviations(held, held.modelled)
    below = -deviation_db(held)
    return {
        f"{name}.share_within_2std": share_within(ratio, 2.0),
        f"{name}.share_within_1std": share_within(ratio, 1.0),
        **{f"{name}.median_deviation_db.{output}": float(one) for output, one in zip(outputs, below, strict=True)},
    }
