"""The covariance of a frequency response from some of its realizations alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid.errors import DataError
from robid.frf.covariance import pool
from robid.frf.frf import Frf


def by_realizations(frf: Frf, chosen: Sequence[int], pooled: int) -> Frf:
    """Estimates the covariance of the whole response anew, as some of its realizations alone show it.

    Args:
        frf: A response with its `realization_error`.
        chosen: Indices of two realizations or more.
        pooled: Neighbouring lines pooled.

    Returns:
        The same response; its total covariance and element scale are those that the chosen realizations give for the
        mean of all of them.

    Raises:
        DataError: If the response does not know what its realizations add, or fewer than two are chosen.
    """
    if frf.realization_error is None or len(chosen) < 2:
        message = f"D023 a covariance from realizations needs two of them, not {len(chosen)}"
        raise DataError(message, remedy="record more realizations, with an estimator that keeps them apart")
    errors = frf.realization_error[:, list(chosen)]
    count, whole = errors.shape[1], frf.realization_error.shape[1]
    n_freq, n_in = frf.response.shape[1], frf.response.shape[3]
    deviation = errors - errors.mean(axis=1, keepdims=True)
    weight = np.swapaxes(np.linalg.inv(frf.input_factor), -1, -2)
    outer = np.einsum("crfoi,cfij,crfpj->cfop", deviation, weight, deviation.conj(), optimize=True)
    covariance = np.stack([pool(each, pooled) for each in outer * (whole / (n_in * (count - 1)))])
    sample = (np.abs(deviation) ** 2).sum(axis=1) * (whole / (count - 1))
    changed = replace(
        frf,
        element_scale=np.ones_like(frf.element_scale),
        total_covariance=covariance,
        total_degrees_of_freedom=float(n_in * (count - 1) * min(pooled, n_freq)),
    )
    variance = changed.element_variance()
    ratio = np.divide(sample, variance, out=np.ones_like(variance), where=variance > 0)
    return replace(changed, element_scale=ratio.mean(axis=1))
