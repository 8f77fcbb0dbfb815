"""Estimators of the response from experiment blocks: how they average, and whether the blocks tell the motors apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.distortion import FEWEST
from robid.frf.spectra import Blocks
from robid.signals.quantities import shown
from robid.signals.record import Record


@dataclass(frozen=True)
class BlockEstimate:
    """A response and its first-order error."""

    response: ComplexArray  # (n_freq, n_out, n_in) The response
    # (n_real, n_freq, n_exp, n_in) W of the error `sum_m V_m W_m` that output residuals V_m (n_out, n_exp) of block m
    # cause
    weights: ComplexArray

    @property
    def input_factor(self) -> ComplexArray:
        """`sum_m W_m^T conj(W_m)` (n_freq, n_in, n_in), the first factor of the structured covariance."""
        # With cov(vec V_m) = I (x) C_v, vec(V_m W_m) = (W_m^T (x) I) vec V_m has (W_m^T conj(W_m)) (x) C_v; blocks add
        # up.
        return np.asarray((np.swapaxes(self.weights, -1, -2) @ self.weights.conj()).sum(axis=0))


def arithmetic(blocks: Blocks) -> BlockEstimate:
    """Mean of the blocks' responses `Y U^-1`."""
    inverse = np.linalg.inv(blocks.inputs)
    # Y = G U + V gives Y U^-1 = G + V U^-1, so that W_m = U_m^-1 / M of M blocks.
    return BlockEstimate((blocks.outputs @ inverse).mean(axis=0), inverse / len(inverse))


def logarithmic(blocks: Blocks) -> BlockEstimate:
    """Mean of the logarithms of the blocks' elements, its branch relative to the arithmetic mean.

    Source:
        docs/methods, sec. 4; Wernholt and Moberg, LiTH-ISY-R-2827.
    """
    inverse = np.linalg.inv(blocks.inputs)
    # To first order log(G + e) averages as e / G does: the error has the weights of the arithmetic mean.
    return BlockEstimate(logarithmic_mean(blocks.outputs @ inverse), inverse / len(inverse))


def joint(blocks: Blocks) -> BlockEstimate:
    """Joint input-output estimate, the reference R its instrument: `(sum Y R^H) (sum U R^H)^-1`.

    Noise that the loop feeds back is in U but not in R, so it averages out instead of leaving a bias. Torque
    that compensation takes out changes U only: the instrument stays what was injected.

    Source:
        Pintelon and Schoukens (2012), System Identification, sec. 2.6 and 7.2.
    """
    return _projected(blocks, _reference(blocks))


def h1(blocks: Blocks) -> BlockEstimate:
    """Least squares with the torque as regressor: `(sum Y U^H) (sum U U^H)^-1`.

    In closed loop it is biased towards minus the controller's inverse by noise that the loop feeds back to U.
    With one block it is `Y U^-1`.
    """
    return _projected(blocks, blocks.inputs)


def indirect(blocks: Blocks) -> BlockEstimate:
    """Quotient of the mean closed-loop responses from the reference: `mean(Y R^-1) mean(U R^-1)^-1`.

    It weighs every block alike where `joint` weighs by the reference's power; for orthogonal blocks of the same
    amplitudes `R^-1` is `R^H` times a constant and both are one.

    Source:
        Turk et al. (2018), indirect method.
    """
    return _projected(blocks, np.swapaxes(np.linalg.inv(_reference(blocks)), -1, -2).conj())


ESTIMATORS: dict[str, Callable[[Blocks], BlockEstimate]] = {
    "arithmetic": arithmetic,
    "logarithmic": logarithmic,
    "joint": joint,
    "h1": h1,
    "indirect": indirect,
    "robust_local": logarithmic,
}
NEEDS_REFERENCE = frozenset({"joint", "indirect"})  # Estimators that need what was injected
NEEDS_SQUARE_BLOCKS = frozenset({"arithmetic", "logarithmic", "indirect", "robust_local"})
"""Estimators that need as many experiments per block as inputs; the others need as many in all blocks together."""


def logarithmic_mean(per_block: ComplexArray) -> ComplexArray:
    """Averages block responses (n_real, ...) by their logarithm, branch relative to the arithmetic mean.

    Elements without any response, of channels that never left one step of their resolution, stay zero.
    """
    mean = per_block.mean(axis=0)
    # Quotients with the mean lie near 1, away from the cut of the logarithm at the negative axis.
    relative = np.divide(per_block, mean, out=np.ones_like(per_block), where=mean != 0)
    return np.asarray(mean * np.exp(np.log(relative).mean(axis=0)))


def _projected(blocks: Blocks, instrument: ComplexArray) -> BlockEstimate:
    """`(sum Y Z^H) (sum U Z^H)^-1` of instruments Z (n_real, n_freq, n_in, n_exp)."""
    adjoint = np.swapaxes(instrument, -1, -2).conj()
    # (sum Y Z^H)(sum U Z^H)^-1 is linear in Y: its error has W_m = Z_m^H (sum U Z^H)^-1.
    weights = adjoint @ np.linalg.inv((blocks.inputs @ adjoint).sum(axis=0))
    return BlockEstimate((blocks.outputs @ weights).sum(axis=0), weights)


def _reference(blocks: Blocks) -> ComplexArray:
    if blocks.reference is None:
        raise ValueError("Argument `blocks` must hold a reference.")
    return blocks.reference


_CONDITION_LIMIT = 1e6
_NOTHING = 1e-12  # Power of a line, relative to the usual one, below which not even rounding is told from it


def solvable_lines(record: Record, blocks: Blocks, estimator: str) -> BoolArray:
    """Finds the lines (n_freq,) whose experiments excite every input, in the torque or in the reference if needed.

    Raises:
        DataError: If there are too few experiments, or too few such lines, with the worst frequency.
    """
    n_real, _, n_in, n_exp = blocks.inputs.shape
    square = estimator in NEEDS_SQUARE_BLOCKS
    if n_exp != n_in if square else n_real * n_exp < n_in:
        message = f"D011 {n_exp} experiments per block cannot separate {n_in} inputs"
        remedy = "record as many experiments per realization as there are motors, or use the estimator `local_periodic`"
        raise DataError(message, where=place_of(record), remedy=remedy)
    told = carrying_lines(blocks.inputs) & (_condition(blocks.inputs, square=square) < _CONDITION_LIMIT)
    remedy = "excite all motors, or check that the lines are those played"
    _require(record, told, "the experiments do not", remedy)
    if estimator not in NEEDS_REFERENCE:
        return told
    instrument = _recorded_reference(record, blocks, estimator)
    told &= _condition(instrument, square=square) < _CONDITION_LIMIT
    remedy = "choose `logarithmic`, or check the imported reference"
    _require(record, told, f"estimator `{estimator}`: the reference does not", remedy)
    return told


def carrying_lines(inputs: ComplexArray) -> BoolArray:
    """Finds the lines (n_freq,) at which every input (n_real, n_freq, n_in, n_exp) has some power at all."""
    power = (np.abs(inputs) ** 2).sum(axis=(0, 3))
    return np.asarray((power > _NOTHING * np.median(power, axis=0)).all(axis=1))


def _require(record: Record, told: BoolArray, who: str, remedy: str) -> None:
    """Refuses a record of which too few lines can be solved."""
    needed, left = min(FEWEST, len(told)), int(told.sum())
    if left >= needed:
        return
    frequency = record.frequency_hz[int(np.argmin(told))]
    message = (
        f"D012 {who} excite every motor at {frequency:.3g} Hz: {left} of {len(told)} lines tell all of them apart, "
        f"{needed}"
        " are needed"
    )
    raise DataError(message, where=place_of(record), remedy=remedy)


def _recorded_reference(record: Record, blocks: Blocks, estimator: str) -> ComplexArray:
    if blocks.reference is None:
        remedy = "choose `logarithmic`, or import what was injected with the log"
        raise DataError(
            f"D013 estimator `{estimator}` needs the reference, which the record lacks",
            where=place_of(record),
            remedy=remedy,
        )
    return blocks.reference


def _condition(inputs: ComplexArray, *, square: bool) -> FloatArray:
    """Condition (n_freq,) of the worst of the blocks (n_real, n_freq, n_in, n_exp), or of all of them together."""
    if square:
        return np.asarray(np.nan_to_num(np.linalg.cond(inputs, 1).max(axis=0), nan=np.inf))
    # All experiments together: the condition of a wide U is the root of that of U U^H.
    power = (inputs @ np.swapaxes(inputs, -1, -2).conj()).sum(axis=0)
    return np.asarray(np.nan_to_num(np.sqrt(np.linalg.cond(power, 1)), nan=np.inf))


def place_of(record: Record) -> str:
    """Says which configuration a record is of."""
    configuration = record.require_periods("A frequency response")[0]
    return f"configuration at {shown(configuration, record.joint_units)}"
