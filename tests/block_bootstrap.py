"""Block bootstrap of least squares: whole stretches of the record drawn again, so that their correlation stays."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.rows import Rows, RowSource

_MOST_BLOCKS = 200


def bootstrap_blocks(
    source: RowSource, weights: FloatArray, n_row: int, n_draw: int = 500, seed: int = 0, n_block: int | None = None
) -> FloatArray:
    """Estimates from stretches of the record drawn with replacement.

    Args:
        source: The rows, for one pass.
        weights (n_joint,): Weight of each joint's rows.
        n_row: Kept samples of the pass.
        n_draw: Estimates to draw.
        seed: Seed of the draws.
        n_block: Stretches; by default the root of the kept samples, 200 at most.

    Returns:
        Parameters (n_draw, n_param); their spread is the estimator's.

    Raises:
        ValueError: If there are too few stretches to determine the parameters.

    Source:
        Carlstein (1986), blocks that do not overlap.
    """
    blocks = n_block or min(_MOST_BLOCKS, round(n_row**0.5))
    grams = _block_grams(source, weights, n_row, blocks)
    scale = 1 / np.sqrt(np.diag(grams.sum(axis=0)))
    scale[-1] = 1.0
    grams *= scale[:, None] * scale
    generator = np.random.default_rng(seed)
    drawn = np.empty((n_draw, len(scale) - 1))
    for draw in range(n_draw):
        counts = generator.multinomial(blocks, np.full(blocks, 1 / blocks))
        gram = np.tensordot(counts, grams, axes=1)
        try:
            drawn[draw] = np.linalg.solve(gram[:-1, :-1], gram[:-1, -1]) * scale[:-1]
        except np.linalg.LinAlgError as error:
            message = f"{blocks} stretches of the record do not always determine {len(scale) - 1} parameters."
            raise ValueError(message) from error
    return drawn


def _block_grams(source: RowSource, weights: FloatArray, n_row: int, n_block: int) -> FloatArray:
    """Products (n_block, n_param + 1, n_param + 1) of the weighted `[W y]` of each stretch."""
    grams: FloatArray | None = None
    first = 0
    for rows in source:
        joined = _joined(rows, weights)
        if grams is None:
            grams = np.zeros((n_block, joined.shape[2], joined.shape[2]))
        block = np.minimum((first + np.arange(len(joined))) * n_block // n_row, n_block - 1)
        for index in np.unique(block):
            own = joined[block == index].reshape(-1, joined.shape[2])
            grams[index] += own.T @ own
        first += len(joined)
    if grams is None or first != n_row:
        message = f"Argument `n_row` must be the number of kept samples, {first}, but is {n_row}."
        raise ValueError(message)
    return grams


def _joined(rows: Rows, weights: FloatArray) -> FloatArray:
    joined = np.concatenate([rows.columns, rows.torque[..., None]], axis=2)
    return np.asarray(np.where(rows.used[..., None], joined, 0.0) * np.sqrt(weights)[:, None])
