"""What explains a motor's torque apart from the model that all motors share: evidence that it is not noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray, Quantity
from robid.models.rigid.fit.rows import RowSource

_MOST_ROWS = 4000
_PIECES = 10  # of a record; every other one is left out
_RIDGE = 1e-3  # of a column's mean square: poor motions leave single parameters open, which say nothing here
_POORLY = 0.2  # of a motor's torque that the fit leaves, above which it is looked at
RECORDS = -1
"""Stands for each record on its own, in place of a joint."""


@dataclass(frozen=True)
class Alone:
    """Errors of motors' torques by what explains each best, with parameters of its own."""

    error: Annotated[FloatArray, Quantity("1", "joint", "Error on left-out pieces over the torque; NaN if not tried")]
    # Of the joint whose row of the model explains it, the motor's own or another's; `RECORDS` where the own one does,
    # with other parameters in each record
    row: Annotated[IntArray, Quantity("1", "joint", "Index of the joint whose motion explains it")]


def explained_alone(rows: RowSource, shot: IntArray, left: FloatArray) -> Alone:
    """Explains torques that the fit explains poorly by single rows of the model.

    A torque of noise is explained by none. One that another channel has, or whose sign or unit changes between records,
    is: by the motion of another joint, or in each record alone.

    Args:
        rows: The rows of the fit.
        shot (n_row,): Index of the record that each is of.
        left (n_joint,): What the fit leaves of each torque, over its size.
    """
    error, row = np.full(len(left), np.nan), np.arange(len(left))
    poor = np.flatnonzero(left > _POORLY)
    if not len(poor):
        return Alone(error, row)
    step = -(-len(shot) // _MOST_ROWS)
    torque, columns, used = _thinned(rows, step)
    shot = shot[::step]
    records = [shot == index for index in np.unique(shot)]
    for motor in poor.tolist():
        tried = {}
        for joint in range(len(left)):
            both = used[:, motor] & used[:, joint]
            tried[joint] = _left_out(columns[:, joint], torque[:, motor], [both], records)
        if len(records) > 1:
            own = [used[:, motor] & record for record in records]
            tried[RECORDS] = _left_out(columns[:, motor], torque[:, motor], own, records)
        # Its own row first, where several do alike.
        row[motor] = min(tried, key=lambda key: (tried[key], key != motor))
        error[motor] = tried[row[motor]]
    return Alone(error, row)


def _thinned(rows: RowSource, step: int) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Torques, columns and which rows count, of every so many rows of all blocks, which need not fit into memory."""
    parts, first = [], 0
    for each in rows:
        kept = slice(-first % step, None, step)
        parts.append((each.torque[kept], each.columns[kept], each.used[kept]))
        first += len(each.torque)
    torque, columns, used = (np.concatenate(part) for part in zip(*parts, strict=True))
    return torque, columns, used


def _left_out(
    columns: FloatArray, torque: FloatArray, parts: Sequence[BoolArray], records: Sequence[BoolArray]
) -> float:
    """Error on pieces left out over the torque (n_row,), each part of the rows with parameters of its own."""
    odd = np.zeros(len(torque), bool)
    for record in records:
        piece = np.arange(int(record.sum())) * _PIECES // max(int(record.sum()), 1)
        odd[record] = piece % 2 == 1
    squares = size = 0.0
    for part in parts:
        for fitted in (part & odd, part & ~odd):
            left = part & ~fitted
            if fitted.sum() <= np.any(columns[fitted] != 0, axis=0).sum():
                return np.inf
            values = _ridge(columns[fitted], torque[fitted])
            squares += float(((torque[left] - columns[left] @ values) ** 2).sum())
            size += float((torque[left] ** 2).sum())
    return float(np.sqrt(squares / size)) if size > 0 else np.inf


def _ridge(columns: FloatArray, torque: FloatArray) -> FloatArray:
    """Parameters (n_param,) of rows (n_row, n_param), held near zero where these hardly tell them."""
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scaled = np.divide(columns, scale, out=np.zeros_like(columns), where=scale > 0)
    n_row, n_param = columns.shape
    normal = scaled.T @ scaled / n_row + _RIDGE * np.eye(n_param)
    return np.asarray(np.linalg.solve(normal, scaled.T @ torque / n_row) / np.where(scale > 0, scale, 1.0))
