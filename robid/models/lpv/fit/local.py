"""One linear model per position from its response, all in one basis of states, interpolated (SMILE)."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.models.lpv.fit.responses import Problem, solve
from robid.models.lpv.fit.state_space import StateSpace, balance, pack, remap, resolvent, stack, transform, unpack
from robid.results.levenberg import Status


def subspace_model(
    z: ComplexArray, response: ComplexArray, root_weight: FloatArray, *, order: int, n_block: int
) -> StateSpace:
    """Realises a frequency response from the space that its states span.

    The lines are first spread over the circle: lines far below the sampling rate crowd at 1, and their powers tell
    states apart badly. Given are points of the unit circle (n_freq,), the response and the root of each element's
    weight (n_freq, n_out, n_in), and more block rows than `order / n_out`; the model is stable.

    Source:
        McKelvey, Akcay and Ljung (1996), Subspace-based multivariable system identification from frequency response
        data, algorithm 2.
    """
    # The bilinear map of tan(angle / 2) by its median brings the median line to a quarter turn; `remap` takes it back.
    tangent = np.tan(np.angle(z) / 2)
    middle = float(np.median(tangent))
    w = (middle + 1j * tangent) / (middle - 1j * tangent)
    A, C = _states(w, response, root_weight.mean(axis=(1, 2)), order, n_block)
    # Poles go into the unit circle: 1 / conj(pole) has the same magnitude response but for a factor; a little inside,
    # so that it is never on the circle.
    values, vectors = np.linalg.eig(A)
    size = np.abs(values)
    inside = np.where(size >= 1, values / np.maximum(size, 1e-300) ** 2 * 0.999, values)
    A = np.asarray(np.real(vectors @ (inside[:, None] * np.linalg.inv(vectors))))
    B, D = _inputs(w, response, root_weight, A, C)
    return remap(StateSpace(A, B, C, D), middle + 1, middle - 1, middle - 1, middle + 1)


def _states(
    w: ComplexArray, response: ComplexArray, weight: FloatArray, order: int, n_block: int
) -> tuple[FloatArray, FloatArray]:
    _, n_out, n_in = response.shape
    # Y = O X + Gamma U over the lines, block row k multiplied by w^k; real and imaginary parts are rows of their own,
    # so that the model is real.
    powers = w ** np.arange(n_block)[:, None] * weight
    inputs = np.einsum("bf,ij->bifj", powers, np.eye(n_in)).reshape(n_block * n_in, -1)
    outputs = np.einsum("bf,foj->bofj", powers, response).reshape(n_block * n_out, -1)
    rows = np.concatenate([inputs, outputs])
    # LQ of [U; Y]: the last block is Y without what U explains. Its columns span those of the observability matrix O.
    triangle = np.asarray(np.linalg.qr(np.concatenate([rows.real, rows.imag], axis=1).T, mode="r")).T
    seen = triangle[n_block * n_in :, n_block * n_in :]
    space = np.linalg.svd(seen)[0][:, :order]
    # O without its last block row, times A, is O without its first; C is its first block row.
    return np.linalg.lstsq(space[:-n_out], space[n_out:], rcond=None)[0], space[:n_out]


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


_SINGULAR = 1e-8  # of the largest, a singular value of a transformation that loses a state


def align_neighbours(systems: StateSpace, points: FloatArray) -> StateSpace:
    """Brings local models to the basis of a middle one, balanced, each by way of a neighbour that is there already.

    A transformation makes a model as much like its neighbour as a basis can: linear least squares, from its own
    balanced basis, so that the basis it came in does not matter. Stable models stand at points (n_pos, n_scheduling).

    Raises:
        DataError: If a model has nothing in common with its neighbour.
    """
    reduced = (points - points.mean(axis=0)) / np.maximum(np.ptp(points, axis=0), np.finfo(float).tiny)
    # Nearest first, as in a minimum spanning tree: no model is compared with one that is much unlike it.
    distance = np.linalg.norm(reduced[:, None] - reduced, axis=2)
    middle = middle_position(points)
    balanced = [balance(systems[index])[0] for index in range(len(points))]
    aligned = {middle: balanced[middle]}
    while len(aligned) < len(points):
        done, left = list(aligned), [index for index in range(len(points)) if index not in aligned]
        near = distance[np.ix_(done, left)]
        row, column = np.unravel_index(np.argmin(near), near.shape)
        aligned[left[column]] = _like(balanced[left[column]], aligned[done[row]], left[column])
    return stack([aligned[index] for index in range(len(points))])


def middle_position(points: FloatArray) -> int:
    """Returns the position nearest to the mean of all."""
    reduced = (points - points.mean(axis=0)) / np.maximum(np.ptp(points, axis=0), np.finfo(float).tiny)
    return int(np.argmin(np.linalg.norm(reduced, axis=1)))


def _like(system: StateSpace, other: StateSpace, index: int) -> StateSpace:
    """The model in the states `T x` that minimise `|T A - A' T|^2 + |T B - B'|^2 + |C - C' T|^2`."""
    n = system.A.shape[0]
    eye = np.eye(n)
    # Row by row, vec(T A) = kron(1, A^T) vec(T) and vec(A' T) = kron(A', 1) vec(T): one linear least-squares problem in
    # T.
    rows = [np.kron(eye, system.A.T) - np.kron(other.A, eye), np.kron(eye, system.B.T), np.kron(other.C, eye)]
    right = [np.zeros(n * n), other.B.ravel(), system.C.ravel()]
    T = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0].reshape(n, n)
    values = np.linalg.svd(T, compute_uv=False)
    if not values[-1] > _SINGULAR * values[0]:
        message = "D168 No basis makes the local model resemble its neighbour's."
        remedy = "Measure positions in between, or choose another order."
        raise DataError(message, where=f"position {index}", remedy=remedy)
    return transform(system, T)


def check_positions(values: FloatArray) -> None:
    """Refuses positions that do not tell the basis functions (n_pos, n_function + 1) apart.

    Raises:
        DataError: If there are fewer positions than functions, or they leave a combination of functions open.
    """
    n_pos, n_function = values.shape
    if n_pos < n_function:
        told = f"{n_pos} different positions cannot tell {n_function} basis functions apart (the constant one counted)."
        raise DataError(f"D169 {told}", remedy="Fit more positions, or take fewer functions (`basis`).")
    if np.linalg.matrix_rank(values / np.linalg.norm(values, axis=0)) < n_function:
        remedy = "Take fewer functions (`basis`), or positions that vary every scheduling parameter."
        raise DataError("D170 At these positions some basis functions are combinations of others.", remedy=remedy)


def interpolate(systems: StateSpace, values: FloatArray) -> FloatArray:
    """Fits every element of the matrices over the positions by least squares, packed (n_function + 1, n_local).

    Local models are in one basis; `values` (n_pos, n_function + 1) are the basis functions at their positions.

    Raises:
        DataError: If the positions do not tell the basis functions apart.

    Source:
        De Caigny, Camino and Swevers (2009), Interpolating model identification for SISO linear parameter-varying
        systems; Turk et al. (2018), sec. III-B.
    """
    check_positions(values)
    return np.asarray(np.linalg.lstsq(values, pack(systems), rcond=None)[0])


@dataclass(frozen=True)
class LocalModels:
    """Linear models at the positions, each in a basis of its own."""

    systems: StateSpace  # one model per position
    cost: FloatArray  # (n_pos,): what each leaves of its response
    status: tuple[Status, ...]  # how each fit ended


def fit_local_models(problem: Problem, *, max_iterations: int = 100) -> LocalModels:
    """Fits one model of the problem's order at every position; its basis functions play no part.

    Every fit starts from subspace models, then also from its neighbours' results: the better one stays, a stable one
    before any that is not.

    Raises:
        DataError: If there are too few lines for the order, or a model is unstable.
    """
    n_state, n_out, n_in = problem.sizes.n_state, problem.sizes.n_out, problem.sizes.n_in
    # A complex line tells two numbers. A model in any basis has n (n_out + n_in) + n_out n_in of them.
    told = np.count_nonzero(problem.root_weight, axis=(1, 2, 3)) * 2
    # Subspace models, with which every fit begins, have a block row to spare.
    most = min((int(told.min()) - n_out * n_in) // (n_out + n_in), (len(problem.z) // 2 - 1) * n_out)
    if n_state > most:
        message, where = f"D171 The lines are too few for {n_state} states.", f"position {int(np.argmin(told))}"
        remedy = f"Measure more lines, or lower `order` to {max(most, 1)} at most."
        raise DataError(message, where=where, remedy=remedy)
    n_pos = len(problem.response)
    found = [_fit(at_position(problem, index), max_iterations) for index in range(n_pos)]
    # Forth and back, so that a good minimum reaches every position from wherever it was found.
    for index in [*range(1, n_pos), *range(n_pos - 2, -1, -1)]:
        for neighbour in {max(index - 1, 0), min(index + 1, n_pos - 1)} - {index}:
            again = _descend(at_position(problem, index), found[neighbour][0], max_iterations)
            found[index] = min(found[index], again, key=_rank)
    systems = [balanced_or_refused(system, index) for index, (system, _, _) in enumerate(found)]
    return LocalModels(stack(systems), np.array([one[1] for one in found]), tuple(one[2] for one in found))


def at_position(problem: Problem, index: int) -> Problem:
    """Returns the problem of one position alone: a model that does not change."""
    only = slice(index, index + 1)
    return replace(
        problem, response=problem.response[only], root_weight=problem.root_weight[only], values=np.ones((1, 1))
    )


def balanced_or_refused(system: StateSpace, index: int) -> StateSpace:
    """Returns a local model in its balanced basis.

    Raises:
        DataError: If the model is unstable, or has a state without effect.
    """
    radius = float(system.spectral_radius)
    if radius >= 1:
        raise DataError(
            f"D172 The local model has a pole of absolute value {radius:.6g}: it is unstable.",
            where=f"position {index}",
            remedy="State the `integrators` that the response has, no fewer and no more; lower `order`; or measure more"
            " lines and periods there.",
        )
    return balance(system)[0]


def _fit(problem: Problem, max_iterations: int) -> tuple[StateSpace, float, Status]:
    """The best descent from subspace models of several depths."""
    n_state, n_freq = problem.sizes.n_state, len(problem.z)
    depths = {min(depth, n_freq // 2) for depth in (n_state + 1, 2 * n_state + 2, 4 * n_state + 4)}
    starts = [
        subspace_model(problem.z, problem.response[0], problem.root_weight[0], order=n_state, n_block=depth)
        for depth in sorted(depths)
    ]
    return min((_descend(problem, start, max_iterations) for start in starts), key=_rank)


def _rank(found: tuple[StateSpace, float, Status]) -> tuple[bool, float]:
    """Stable models first, then by cost: a pole outside the circle may fit noise no better than one inside."""
    return bool(found[0].spectral_radius >= 1), found[1]


def _descend(problem: Problem, start: StateSpace, max_iterations: int) -> tuple[StateSpace, float, Status]:
    if start.spectral_radius < 1:
        with suppress(DataError):  # a start may have more states than it needs
            start = balance(start)[0]
    parameters, minimum = solve(problem, pack(start)[None], max_iterations=max_iterations)
    return unpack(parameters[0], problem.sizes), minimum.cost, minimum.status
