"""What of a campaign's responses a model is about: some of its channels, at the positions that schedule."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.lpv.fit.responses import LocalResponses


def channel_indices(frf: Frf, outputs: Sequence[str], inputs: Sequence[str], where: str) -> tuple[IntArray, IntArray]:
    """Returns the indices of named outputs and inputs in a response; of all where none is named.

    Raises:
        DataError: If one is not there; `where` is who names it.
    """
    found = []
    for wanted, known, word in ((outputs, frf.output_names, "output"), (inputs, frf.input_names, "input")):
        missing = [name for name in wanted if name not in known]
        if missing:
            message = f"D178 the response has no {word} `{missing[0]}` (it has {', '.join(known)})"
            raise DataError(message, where=f"{where}.{word}s", remedy="name channels of the response")
        found.append(np.array([known.index(name) for name in wanted or known]))
    return found[0], found[1]


def local_responses(frf: Frf, points: FloatArray, outputs: IntArray, inputs: IntArray) -> LocalResponses:
    """Returns some of a response's elements, by their indices, at positions (n_pos, n_scheduling).

    What was not measured is left out; without any covariance the variance is unknown.

    Raises:
        DataError: If an output does not respond at all.
    """
    place = np.ix_(np.arange(len(frf.response)), np.arange(len(frf.frequency_hz)), outputs, inputs)
    response, variance = frf.response[place], frf.element_variance()[place]
    missing = ~np.isfinite(response) | ~np.isfinite(variance)
    _refuse_silent(frf, outputs, np.abs(response), ~missing)
    unknown = not variance.any()
    return LocalResponses(
        points=points,
        frequency_hz=frf.frequency_hz,
        response=np.where(missing, 0, response),
        variance=None if unknown and not missing.any() else np.where(missing, np.inf, variance),
        sampling_period_s=frf.sampling_period_s,
    )


def _refuse_silent(frf: Frf, outputs: IntArray, size: FloatArray, known: BoolArray) -> None:
    """Refuses outputs and positions whose response is zero wherever it is known: nothing is relative to it.

    Sizes (n_pos, n_freq, n_out, n_in) are of the elements chosen, of which those `known` were measured.
    """
    told, moves = (each.any(axis=(0, 1, 3)) for each in (known, known & (size > 0)))
    silent = [frf.output_names[index] for index in outputs[told & ~moves].tolist()]
    told, moves = (each.any(axis=(1, 2, 3)) for each in (known, known & (size > 0)))
    still = np.flatnonzero(told & ~moves).tolist()
    if silent or still:
        who = f"{', '.join(silent)} never move{'s' if len(silent) == 1 else ''}" if silent else ""
        who = who or f"nothing moves at position {still[0]}, counted from 0"
        message = f"D602 {who}: the response is zero"
        remedy = "check the channel's mapping, or leave the output or position out"
        raise DataError(message, where="fit", remedy=remedy)
