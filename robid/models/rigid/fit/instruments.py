"""Instrumental variables: the regressor along the motion of a model without noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.rigid.fit.least_squares import Regression
from robid.models.rigid.fit.options import InstrumentOptions
from robid.models.rigid.fit.reduction import residuals
from robid.models.rigid.fit.rows import RowSource
from robid.models.rigid.fit.uncertainty import Influence

_WAY = (0.0, 0.5, 0.8, 1.0)


def instrumental_variables(
    instrumented: Callable[[FloatArray], RowSource | None],
    start: Regression,
    options: InstrumentOptions | None = None,
    known: FloatArray | None = None,
) -> tuple[Regression, Influence, RowSource]:
    """Estimates with the simulated model as instrument, simulated again until the parameters stay.

    Args:
        instrumented: Simulates parameters (n_param,) and returns the rows with these instruments; where rows are
            dropped, the instrument's speed decides. None where the simulation is lost.
        start: Where to start: its parameters and its joints' weights.
        options: When to stop.
        known (n_param,): Parameters that can be simulated, such as the robot file's: least squares on badly filtered
            rows may be no robot at all, and the simulation then begins on the way to these.

    Returns:
        The estimate, its linearisation, and the rows of its last simulation.

    Raises:
        ValueError: If the rows have no instruments, or these do not determine the parameters.
        DataError: If nothing can be simulated.

    Source:
        Janot, Vandanjon and Gautier (2014), "A generic instrumental variable approach for industrial robot
        identification".
    """
    chosen = options or InstrumentOptions()
    parameters, weights = start.parameters, start.weights
    status: Literal["converged", "iteration_limit"] = "iteration_limit"
    iterations = 0
    while status != "converged" and iterations < chosen.iteration_limit:
        iterations += 1
        rows = _simulated(instrumented, parameters, parameters if known is None else known)
        found, influence = solve_instruments(rows, weights)
        step = np.abs(found.parameters - parameters)
        parameters = found.parameters
        if np.all(step <= chosen.tolerance * found.standard_deviation):
            status = "converged"
    return replace(found, iterations=iterations, status=status), influence, rows


def _simulated(
    instrumented: Callable[[FloatArray], RowSource | None], parameters: FloatArray, known: FloatArray
) -> RowSource:
    """Rows with instruments of some parameters, or as near to them as can be simulated on the way to known ones."""
    for share in _WAY:
        rows = instrumented(parameters + share * (known - parameters))
        if rows is not None:
            return rows
    message = "the model cannot be simulated in its loop, not even with the robot file's values"
    raise DataError(message, where="record", remedy="state `instruments: none`, or correct the robot file")


def solve_instruments(rows: RowSource, weights: FloatArray) -> tuple[Regression, Influence]:
    """Estimates with the instruments that the rows bring.

    Args:
        rows: Rows with instruments.
        weights (n_joint,): Weight of each joint's rows.

    Returns:
        The estimate and its linearisation.

    Raises:
        ValueError: If the rows have no instruments or these do not determine the parameters.
    """
    cross, right, square = _products(rows)
    scale = 1 / np.sqrt(np.diag(np.einsum("j,jab->ab", weights, square)))
    matrix = scale[:, None] * np.einsum("j,jab->ab", weights, cross) * scale
    condition = float(np.linalg.cond(matrix))
    if not condition < 1 / np.finfo(float).eps:
        raise ValueError("The instruments do not determine all parameters: fit base parameters, on a richer motion.")
    bread = scale[:, None] * np.linalg.inv(matrix) * scale
    parameters = bread @ (weights @ right)
    residual = residuals(rows, parameters)
    n_row = np.sum(np.isfinite(residual), axis=0)
    share = len(parameters) / n_row.sum()
    deviation = np.sqrt(np.nansum(residual**2, axis=0) / (n_row * (1 - share)))
    covariance = bread @ np.einsum("j,jab->ab", (weights * deviation) ** 2, square) @ bread.T
    found = Regression(parameters, covariance, deviation, n_row, weights, condition)
    return found, Influence(parameters, bread, weights, np.full(len(weights), np.inf), instrumented=True)


def _products(source: RowSource) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Sums the products of instruments with columns, torques and themselves, joint by joint."""
    sums: list[FloatArray] = []
    for rows in source:
        if rows.instruments is None:
            raise ValueError("The rows have no instruments: simulate the model along the same reference.")
        columns, torque = rows.columns.swapaxes(0, 1), rows.torque.T[..., None]
        counted = np.where(rows.used[..., None], rows.instruments, 0.0).transpose(1, 2, 0)
        parts = [counted @ columns, (counted @ torque)[..., 0], counted @ counted.swapaxes(1, 2)]
        sums = [old + new for old, new in zip(sums, parts, strict=True)] if sums else parts
    return sums[0], sums[1], sums[2]
