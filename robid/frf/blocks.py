"""Estimators of the frequency response from experiment blocks: how they average, and what noise does to them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray
from robid.frf.spectra import Blocks


@dataclass(frozen=True)
class BlockEstimate:
    """A response and its first-order error.

    Attributes:
        response (n_freq, n_out, n_in): The response.
        weights (n_real, n_freq, n_exp, n_in): W of the error `sum_m V_m W_m` that output residuals
            V_m (n_out, n_exp) of block m cause.
    """

    response: ComplexArray
    weights: ComplexArray

    @property
    def input_factor(self) -> ComplexArray:
        """`sum_m W_m^T conj(W_m)` (n_freq, n_in, n_in), the first factor of the structured covariance."""
        return np.asarray(np.einsum("rfei,rfej->fij", self.weights, self.weights.conj()))


def arithmetic(blocks: Blocks) -> BlockEstimate:
    """Mean of the blocks' responses `Y U^-1`."""
    inverse = np.linalg.inv(blocks.torque)
    return BlockEstimate((blocks.acceleration @ inverse).mean(axis=0), inverse / len(inverse))


def logarithmic(blocks: Blocks) -> BlockEstimate:
    """Mean of the logarithms of the blocks' elements, its branch relative to the arithmetic mean.

    Source:
        METHODS sec. 4; Wernholt and Moberg, LiTH-ISY-R-2827.
    """
    inverse = np.linalg.inv(blocks.torque)
    return BlockEstimate(logarithmic_mean(blocks.acceleration @ inverse), inverse / len(inverse))


ESTIMATORS: dict[str, Callable[[Blocks], BlockEstimate]] = {
    "arithmetic": arithmetic,
    "logarithmic": logarithmic,
    "robust_local": logarithmic,
}


def logarithmic_mean(per_block: ComplexArray) -> ComplexArray:
    """Averages block responses (n_real, ...) by their logarithm, branch relative to the arithmetic mean."""
    mean = per_block.mean(axis=0)
    return np.asarray(mean * np.exp(np.log(per_block / mean).mean(axis=0)))
