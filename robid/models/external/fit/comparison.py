"""What a model answers to a shot's commands, held against what was measured."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.fit.hold import discretise, propagate, release
from robid.models.external.fit.transfer import TransferMatrix, delayed

if TYPE_CHECKING:
    from robid.models.external.fit.data import Shot


def predict(model: TransferMatrix, shot: Shot, inputs: Sequence[int], outputs: Sequence[int]) -> FloatArray:
    """Simulates a shot's outputs (n_sample, n_out).

    What no model knows beforehand, an offset and the state that a free start begins in, is taken from the shot itself.

    Args:
        model: Transfer functions of the block.
        shot: The shot.
        inputs: Which of its inputs the model takes.
        outputs: Which of its outputs it gives.
    """
    commands = delayed(shot.inputs[:, list(inputs)], model.delay_samples, model.moving_average, shot.start)
    cascade, weights, scale = model.cascade()
    period = model.sampling_period_s * scale
    held = discretise(cascade, period, model.hold)
    simulated = np.einsum("oik,ikt->to", weights, propagate(held, period, commands, shot.start))
    rows: list[FloatArray] = []
    if shot.offset:
        rows.append(np.ones((1, len(simulated))))
    if shot.start == "free":
        rows.append(release(held, period, len(simulated)))
    if not rows:
        return np.asarray(simulated)
    local = np.concatenate(rows).T
    size = np.linalg.norm(local, axis=0)
    missing = shot.outputs[:, list(outputs)] - simulated
    added = np.linalg.lstsq(local / np.where(size > 0, size, 1.0), missing, rcond=1e-12)[0]
    return np.asarray(simulated + local / np.where(size > 0, size, 1.0) @ added)


def nrmse(measured: FloatArray, simulated: FloatArray) -> FloatArray:
    """Returns `1 - |y - f| / |y - mean y|` of each output (n_out,) of signals (n_sample, n_out); 1 is perfect.

    Source:
        Oliveira et al. (2019), Table 2.
    """
    left = np.linalg.norm(measured - simulated, axis=0)
    whole = np.linalg.norm(measured - measured.mean(axis=0), axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(1 - left / whole)
