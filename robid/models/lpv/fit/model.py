"""A linear model whose matrices are sums of basis functions of the scheduling parameters, and these functions."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from scipy.interpolate import BSpline

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray, check_shape
from robid.errors import DataError
from robid.models.lpv.fit.options import BasisOptions
from robid.models.lpv.fit.state_space import Sizes, StateSpace, pack, response, unpack

_GRID = 201
_MARGIN = 1e-3  # of the range: a position at its end that is measured again


class Functions(Protocol):
    """Functions of the scheduling parameters, besides the constant one."""

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each function."""
        ...

    def values(self, points: FloatArray) -> FloatArray:
        """Returns the functions (n_point, n_function) at points (n_point, n_scheduling)."""
        ...


@dataclass(frozen=True)
class Polynomials:
    """Monomials `prod_j ((p_j - center_j) / scale_j)^e_j`."""

    exponents: tuple[tuple[int, ...], ...]  # (n_function, n_scheduling): exponents of each monomial; none is all zero
    # (n_scheduling,): where the parameters are counted from; what is sparse about one need not be about another.
    center: tuple[float, ...]
    scale: tuple[float, ...]  # (n_scheduling,): what they are counted in; it changes no structure

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each function."""
        single = len(self.exponents[0]) == 1 if self.exponents else True
        parts = (
            [
                f"p{'' if single else at + 1}{'' if power == 1 else f'^{power}'}"
                for at, power in enumerate(powers)
                if power
            ]
            for powers in self.exponents
        )
        return tuple(" ".join(each) for each in parts)

    def values(self, points: FloatArray) -> FloatArray:
        """Returns the functions (n_point, n_function) at points (n_point, n_scheduling)."""
        reduced = (points - np.array(self.center)) / np.array(self.scale)
        return np.asarray(np.prod(reduced[:, None] ** np.array(self.exponents), axis=-1))


@dataclass(frozen=True)
class Splines:
    """Products of B-splines of each parameter, without the first one, which the constant function replaces."""

    knots: tuple[tuple[float, ...], ...]  # knots of each parameter's splines, those at the ends repeated
    degree: int = 3  # degree of the pieces

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each function."""
        counts = [range(len(knots) - self.degree - 1) for knots in self.knots]
        return tuple("spline " + ",".join(str(part + 1) for part in parts) for parts in product(*counts))[1:]

    def values(self, points: FloatArray) -> FloatArray:
        """Returns the functions (n_point, n_function) at points (n_point, n_scheduling)."""
        together = np.ones((len(points), 1))
        for column, knots in zip(points.T, self.knots, strict=True):
            # Positions may lie a little outside, as measurements repeat; splines end at their last knots.
            inside = np.clip(column, knots[0], knots[-1])
            single = BSpline.design_matrix(inside, np.array(knots), self.degree).toarray()
            together = (together[:, :, None] * single[:, None]).reshape(len(points), -1)
        return together[:, 1:]


@dataclass(frozen=True)
class Basis:
    """The constant function, further ones, and the range in which they hold."""

    functions: Functions  # the further ones
    lower: FloatArray  # (n_scheduling,): smallest value of each scheduling parameter
    upper: FloatArray  # (n_scheduling,): largest value of each

    @property
    def largest(self) -> FloatArray:
        """Largest absolute value (n_function,) of each function in the range."""
        return np.asarray(np.abs(self.functions.values(self.grid())).max(axis=0))

    def grid(self, count: int = _GRID) -> FloatArray:
        """Returns points (n_point, n_scheduling) all over the range, at most about `count` squared of them."""
        each = max(2, round(count ** min(1.0, 2 / len(self.lower))))
        axes = [np.linspace(low, high, each) for low, high in zip(self.lower, self.upper, strict=True)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))

    def values(self, points: FloatArray) -> FloatArray:
        """Returns all functions (n_point, n_function + 1) at points (n_point, n_scheduling), the constant one first.

        Raises:
            DataError: If a point lies outside the range.
        """
        check_shape("points", points, "n_point n_scheduling", n_scheduling=len(self.lower))
        outside = is_outside(points, self.lower, self.upper)
        if outside.any():
            lower, upper, place = (_told(point) for point in (self.lower, self.upper, points[outside][0]))
            remedy = "Ask for positions within the range, or measure further out and fit again."
            raise DataError(f"D166 The model is valid from {lower} to {upper}, not at {place}.", remedy=remedy)
        return np.column_stack([np.ones(len(points)), self.functions.values(points)])


def is_outside(points: FloatArray, lower: FloatArray, upper: FloatArray) -> BoolArray:
    """Tells which points (n_point, n_scheduling) lie outside a range, but for what repeated measurements differ."""
    room = _MARGIN * (upper - lower)
    return np.asarray(~np.all((points >= lower - room) & (points <= upper + room), axis=1))


def different_positions(points: FloatArray) -> IntArray:
    """Returns the first of each of the positions (n_pos, n_scheduling) that are more than measured again.

    Positions that were logged never repeat exactly; what lies between two of one place is nothing but noise.
    """
    room = _MARGIN * np.ptp(points, axis=0)
    chosen: list[int] = []
    for index, point in enumerate(points):
        if not np.any(np.all(np.abs(points[chosen] - point) <= room, axis=1)):
            chosen.append(index)
    return np.array(chosen, int)


def make_basis(points: FloatArray, options: BasisOptions) -> Basis:
    """Makes the basis of options over the range of positions (n_pos, n_scheduling).

    Raises:
        ValueError: If a center is given that does not name every parameter.
    """
    if options.kind == "splines":
        return spline_basis(points, pieces=options.pieces, degree=options.degree)
    if options.center and len(options.center) != points.shape[1]:
        raise ValueError("Option `center` must have one value per scheduling parameter.")
    return polynomial_basis(points, options.degree, center=np.array(options.center) if options.center else None)


def polynomial_basis(points: FloatArray, degree: int, *, center: FloatArray | None = None) -> Basis:
    """Makes the basis of all monomials up to a total degree, over the range of positions (n_pos, n_scheduling).

    The parameters are counted from `center` (n_scheduling,), zero by default, as in the paper.

    Source:
        Turk et al. (2018), eq. 19.
    """
    lower, upper = points.min(axis=0), points.max(axis=0)
    middle = np.zeros(points.shape[1]) if center is None else center
    scale = np.maximum(np.abs(points - middle).max(axis=0), np.finfo(float).tiny)
    powers = [one for one in product(range(degree + 1), repeat=points.shape[1]) if 0 < sum(one) <= degree]
    ordered = tuple(sorted(powers, key=lambda one: (sum(one), tuple(-power for power in one))))
    return Basis(Polynomials(ordered, tuple(middle.tolist()), tuple(scale.tolist())), lower, upper)


def spline_basis(points: FloatArray, *, pieces: int, degree: int = 3) -> Basis:
    """Makes B-splines with evenly spaced knots over the range of some positions (n_pos, n_scheduling)."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    knots = []
    for low, high in zip(lower, upper, strict=True):
        # End knots of full multiplicity: the splines sum to one, so that dropping the first one loses nothing beside
        # the constant.
        inner = np.linspace(low, high, pieces + 1).tolist()
        knots.append(tuple([inner[0]] * degree + inner + [inner[-1]] * degree))
    return Basis(Splines(tuple(knots), degree), lower, upper)


def _told(point: FloatArray) -> str:
    return ", ".join(f"{value:.6g}" for value in point)


@dataclass(frozen=True)
class LpvModel:
    """`A(p) = A_0 + sum_k A_k psi_k(p)`, and B, C and D alike, in discrete time.

    Source:
        Turk et al. (2018), eq. 1 and 2.
    """

    parameters: FloatArray  # (n_function + 1, n_local): packed matrices of each function, the constant one first
    sizes: Sizes  # States, inputs and outputs
    basis: Basis  # the functions and the range in which they hold
    sampling_period_s: float

    @property
    def coefficients(self) -> StateSpace:
        """The matrices of each function, the constant one first."""
        return unpack(self.parameters, self.sizes)

    def at(self, points: FloatArray) -> StateSpace:
        """Returns A(p), B(p), C(p) and D(p) at points (n_point, n_scheduling).

        Raises:
            DataError: If a point lies outside the range.
        """
        return unpack(self.basis.values(points) @ self.parameters, self.sizes)

    def frozen_response(self, points: FloatArray, frequency_hz: FloatArray) -> ComplexArray:
        """Returns the response (n_point, n_freq, n_out, n_in) of the model at rest at each point.

        Raises:
            DataError: If a point lies outside the range.
        """
        return response(self.at(points), unit_circle(frequency_hz, self.sampling_period_s))


def unit_circle(frequency_hz: FloatArray, sampling_period_s: float) -> ComplexArray:
    """Returns `exp(j omega T)` of frequencies (n_freq,)."""
    return np.asarray(np.exp(2j * np.pi * frequency_hz * sampling_period_s))


def largest_pole(model: LpvModel) -> tuple[float, FloatArray]:
    """Looks on a grid over the range for the frozen model with the largest pole: its absolute value, and where it is.

    Below one every frozen model on the grid is stable; a moving parameter may still excite.
    """
    grid = model.basis.grid()
    radius = model.at(grid).spectral_radius
    worst = int(np.argmax(radius))
    return float(radius[worst]), grid[worst]


def simulate_lpv(
    model: LpvModel, inputs: FloatArray, scheduling: FloatArray, initial_state: FloatArray | None = None
) -> tuple[FloatArray, FloatArray]:
    """Runs a model while its scheduling parameters (n_sample, n_scheduling) move.

    Returns outputs (n_sample, n_out) to inputs (n_sample, n_in) and the state (n_state,) after the last sample; the
    first one is zero by default.

    Raises:
        DataError: If the parameters leave the range.
        ValueError: If the shapes do not agree.
    """
    check_shape("inputs", inputs, "n_sample n_in", n_in=model.sizes.n_in)
    check_shape("scheduling", scheduling, "n_sample n_scheduling", n_sample=len(inputs))
    moving = model.at(scheduling)
    driven = (moving.B @ inputs[..., None])[..., 0]
    states = np.empty((len(inputs) + 1, model.sizes.n_state))
    states[0] = 0 if initial_state is None else initial_state
    for index, A in enumerate(moving.A):
        states[index + 1] = A @ states[index] + driven[index]
    outputs = np.einsum("tij,tj->ti", moving.C, states[:-1]) + np.einsum("tij,tj->ti", moving.D, inputs)
    return outputs, states[-1]


def add_integrators(model: LpvModel, integrators: tuple[int, ...]) -> LpvModel:
    """Puts integrators behind the outputs: `y(t+1) = y(t) + T v(t)`, as many as each output has.

    Behind the outputs, not before the inputs: what an output integrates stays its derivative while the scheduling
    parameter moves.
    """
    while any(integrators):
        chosen = np.array([count > 0 for count in integrators])
        model = _add_once(model, chosen)
        integrators = tuple(max(count - 1, 0) for count in integrators)
    return model


def _add_once(model: LpvModel, chosen: BoolArray) -> LpvModel:
    old, period = model.coefficients, model.sampling_period_s
    n, extra = model.sizes.n_state, int(chosen.sum())
    n_function, r, m = len(model.parameters), model.sizes.n_in, model.sizes.n_out
    A = np.zeros((n_function, n + extra, n + extra))
    # Integrator states follow the outputs that they replace: v+ = v + T (C x + D u), and the output is v.
    A[:, :n, :n], A[:, n:, :n] = old.A, period * old.C[:, chosen]
    A[0, n:, n:] = np.eye(extra)
    B = np.concatenate([old.B, period * old.D[:, chosen]], axis=1)
    C = np.zeros((n_function, m, n + extra))
    C[:, ~chosen, :n] = old.C[:, ~chosen]
    C[0, np.flatnonzero(chosen), n + np.arange(extra)] = 1.0
    D = np.where(chosen[:, None], 0.0, old.D)
    sizes = Sizes(n + extra, r, m)
    return LpvModel(pack(StateSpace(A, B, C, D)), sizes, model.basis, period)
