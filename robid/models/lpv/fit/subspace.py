"""A state-space model straight from a frequency response: where the local fits start."""

from __future__ import annotations

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.lpv.fit.state_space import StateSpace, remap, resolvent


def subspace_model(
    z: ComplexArray, response: ComplexArray, root_weight: FloatArray, *, order: int, n_block: int
) -> StateSpace:
    """Realises a frequency response from the space that its states span.

    The lines are first spread over the circle: lines far below the sampling rate crowd at 1, and their powers tell
    states apart badly.

    Args:
        z (n_freq,): Points of the unit circle.
        response (n_freq, n_out, n_in): Frequency response.
        root_weight (n_freq, n_out, n_in): Root of each element's weight.
        order: Number of states.
        n_block: Block rows, more than `order / n_out`.

    Returns:
        A stable model.

    Source:
        McKelvey, Akcay and Ljung (1996), Subspace-based multivariable system identification from frequency response
        data, algorithm 2.
    """
    tangent = np.tan(np.angle(z) / 2)
    middle = float(np.median(tangent))
    w = (middle + 1j * tangent) / (middle - 1j * tangent)
    A, C = _states(w, response, root_weight.mean(axis=(1, 2)), order, n_block)
    A = _reflect(A)
    B, D = _inputs(w, response, root_weight, A, C)
    return remap(StateSpace(A, B, C, D), middle + 1, middle - 1, middle - 1, middle + 1)


def _states(
    w: ComplexArray, response: ComplexArray, weight: FloatArray, order: int, n_block: int
) -> tuple[FloatArray, FloatArray]:
    _, n_out, n_in = response.shape
    powers = w ** np.arange(n_block)[:, None] * weight
    inputs = np.einsum("bf,ij->bifj", powers, np.eye(n_in)).reshape(n_block * n_in, -1)
    outputs = np.einsum("bf,foj->bofj", powers, response).reshape(n_block * n_out, -1)
    rows = np.concatenate([inputs, outputs])
    triangle = np.asarray(np.linalg.qr(np.concatenate([rows.real, rows.imag], axis=1).T, mode="r")).T
    seen = triangle[n_block * n_in :, n_block * n_in :]
    space = np.linalg.svd(seen)[0][:, :order]
    return np.linalg.lstsq(space[:-n_out], space[n_out:], rcond=None)[0], space[:n_out]


def _reflect(A: FloatArray) -> FloatArray:
    """Brings poles into the unit circle."""
    values, vectors = np.linalg.eig(A)
    size = np.abs(values)
    inside = np.where(size >= 1, values / np.maximum(size, 1e-300) ** 2 * 0.999, values)
    return np.asarray(np.real(vectors @ (inside[:, None] * np.linalg.inv(vectors))))


def _inputs(
    w: ComplexArray, response: ComplexArray, root_weight: FloatArray, A: FloatArray, C: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Weighted least squares for B and D: the response is linear in them, input by input."""
    ahead = np.concatenate([C @ resolvent(A, w), np.broadcast_to(np.eye(len(C)), (len(w), len(C), len(C)))], axis=2)
    columns = []
    for index in range(response.shape[2]):
        weight = root_weight[:, :, index]
        left = (ahead * weight[..., None]).reshape(-1, ahead.shape[2])
        right = (response[:, :, index] * weight).ravel()
        real = np.concatenate([left.real, left.imag]), np.concatenate([right.real, right.imag])
        columns.append(np.linalg.lstsq(*real, rcond=None)[0])
    both = np.array(columns).T
    return both[: len(A)], both[len(A) :]
