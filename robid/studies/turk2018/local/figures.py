"""What the model's errors at rest are, held against the deviations of the measured responses."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.models.lpv.fit.responses import expected_share, smooth_variance
from robid.models.lpv.fit.solution import Held, LpvSolution
from robid.report.numbers import MINUS


def deviations(held: Held, response: ComplexArray) -> FloatArray:
    """Returns the error of a response (n_pos, n_freq, n_out, n_in) over the deviation of the measured mean.

    NaN where that is unknown or the element is left out.
    """
    error = np.abs(response - held.response)
    return np.asarray(np.divide(error, held.std, out=np.full(error.shape, np.nan), where=_is_known(held)))


def share_within(ratio: FloatArray, limit: float) -> float:
    """Returns the share of all known ratios within a limit; NaN where there is none."""
    known = ratio[np.isfinite(ratio)]
    return float(np.mean(known <= limit)) if known.size else float("nan")


def below_response_db(held: Held) -> FloatArray:
    """Returns how far (n_out,) the deviations are below the responses: median over positions, lines and inputs [dB]."""
    size = np.where(_is_known(held), held.std, np.nan)
    return np.asarray(np.nanmedian(20 * np.log10(np.abs(held.response) / size), axis=(0, 1, 3)))


def error_ratio(held: Held, response: ComplexArray, window: int) -> float:
    """Returns the root mean square over all lines of the error over its deviation, as a fit weighs it.

    Args:
        held: What was measured.
        response (n_pos, n_freq, n_out, n_in): What a model says there.
        window: Lines over which the variance is averaged, so that few lines with small estimates do not decide.
    """
    known = _is_known(held)
    variance = smooth_variance(np.where(known, held.std, np.inf) ** 2, window)
    return float(np.sqrt(np.mean((np.abs(response - held.response) ** 2 / variance)[known])))


def rest_figures(solution: LpvSolution, left_out: Held, window: int) -> dict[str, float]:
    """Returns what the study says of the model at rest.

    Args:
        solution: The fit.
        left_out: Responses that no fit read, and what the model says of them.
        window: Lines over which the fit's weights average the variance.
    """
    kept, outputs = solution.blocks.kept, solution.ports.outputs
    full = solution.full_model.frozen_response(left_out.points, left_out.frequency_hz)
    sparse, dense = (error_ratio(left_out, response, window) for response in (left_out.modelled, full))
    return {
        **_held_figures("local", solution.own, outputs),
        **_held_figures("left_out", left_out, outputs),
        "perfect_share_within_2std": expected_share(left_out.degrees_of_freedom),
        "perfect_share_within_1std": expected_share(left_out.degrees_of_freedom, 1.0),
        "left_out.error_ratio": sparse,
        "left_out.full_error_ratio": dense,
        "left_out.excess_percent": 100 * (sparse / dense - 1),
        "blocks": float(kept.size),
        "blocks_dropped": float(kept.size - kept.sum()),
        "largest_pole": solution.largest_pole,
    }


def places(held: Held) -> list[str]:
    """Writes the positions' first scheduling parameter."""
    return [f"{value:g}".replace("-", MINUS) for value in held.points[:, 0].tolist()]


def _held_figures(name: str, held: Held, outputs: tuple[str, ...]) -> dict[str, float]:
    ratio = deviations(held, held.modelled)
    below = zip(outputs, below_response_db(held).tolist(), strict=True)
    return {
        f"{name}.share_within_2std": share_within(ratio, 2.0),
        f"{name}.share_within_1std": share_within(ratio, 1.0),
        **{f"{name}.median_deviation_db.{output}": one for output, one in below},
    }


def _is_known(held: Held) -> BoolArray:
    return np.isfinite(held.std) & (held.std > 0)
