"""What is wrong with information matrices, named in the user's words."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError

_UNSEEN = 1e-12  # Smallest eigenvalue of the scaled total information, relative to the largest, that counts as seen
_ALIKE = 1e-9  # Largest difference of matrices, relative to them, at which candidates count as alike


def check_finite(matrices: FloatArray) -> None:
    """Refuses information (n_draw, n_cand, n_param, n_param) that is not finite.

    Raises:
        DataError: With the first candidate that is not.
    """
    wrong = np.flatnonzero(~np.isfinite(matrices).all(axis=(0, 2, 3)))
    if wrong.size:
        raise DataError(
            f"The information of {wrong.size} of {matrices.shape[1]} candidates is not finite, first that of"
            f" candidate {wrong[0]}.",
            where="design",
            remedy="Check the campaign's responses and their covariance, or leave these candidates out.",
        )


def check_different(matrices: FloatArray) -> None:
    """Refuses candidates of which each has the same information (n_draw, n_cand, n_param, n_param) but for a factor.

    Raises:
        DataError: If there is nothing to choose.
    """
    if matrices.shape[1] < 2:
        return
    first = matrices[:, :1]
    factor = (matrices * first).sum(axis=(0, 2, 3)) / (first**2).sum() if first.any() else np.zeros(matrices.shape[1])
    if matrices.shape[-1] == 1:
        # A single parameter leaves the factor to choose by.
        factor = np.ones_like(factor)
    if np.abs(matrices - factor[:, None, None] * first).max() <= _ALIKE * np.abs(matrices).max():
        raise DataError(
            "The candidates are all alike: each tells the same about the parameters, so there is nothing to choose.",
            where="design",
            remedy="Offer configurations that differ in more than the first axis, or leave the design out.",
        )


def checked_scale(total: FloatArray, names: tuple[str, ...], by: str, remedy: str) -> FloatArray:
    """Returns the root of the diagonal of a total information, or names the combinations it does not see.

    Args:
        total (n_param, n_param): Total information about the log-parameters.
        names: Names of the parameters.
        by: Whose information it is, for the message.
        remedy: What to do.

    Raises:
        DataError: If the total is singular.
    """
    diagonal = np.diag(total)
    unseen = [name for name, value in zip(names, diagonal, strict=True) if not value > 0]
    if not unseen:
        scale = np.sqrt(diagonal)
        values, vectors = np.linalg.eigh(total / (scale[:, None] * scale))
        unseen = [_combination(vector / scale, names) for vector in vectors.T[values <= _UNSEEN * values[-1]]]
        if not unseen:
            return np.asarray(scale)
    raise DataError(f"The responses of {by} do not depend on: {'; '.join(unseen)}.", where="design", remedy=remedy)


def is_regular(total: FloatArray) -> bool:
    """Whether a total information (n_param, n_param) sees every combination of parameters."""
    scale = np.sqrt(np.diag(total))
    if not (scale > 0).all():
        return False
    values = np.linalg.eigvalsh(total / (scale[:, None] * scale))
    return bool(values[0] > _UNSEEN * values[-1])


def _combination(vector: FloatArray, names: tuple[str, ...]) -> str:
    """Writes a direction in log-parameters with its larger terms."""
    scaled = vector / vector[np.argmax(np.abs(vector))]
    order = [index for index in np.argsort(-np.abs(scaled), kind="stable") if abs(scaled[index]) > 0.05]
    return " ".join(f"{scaled[index]:+.2g} log({names[index]})" for index in order)
