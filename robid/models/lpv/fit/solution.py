"""A position-dependent model with everything that is to be kept of its fit, as plain values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray, Quantity
from robid.models.lpv.fit.model import Basis, LpvModel, Polynomials, Splines, add_integrators
from robid.models.lpv.fit.responses import Agreement
from robid.models.lpv.fit.state_space import Sizes
from robid.models.lpv.fit.uncertainty import ResponseUncertainty, model_response
from robid.results.estimate import Estimate

_ELEMENTS = "function_or_constant element"
_BLOCKS = "price matrix function"
_RESPONSE = "position frequency output input"


@dataclass(frozen=True)
class Ports:
    """What goes in, what comes out, and what schedules, by name and unit."""

    inputs: Annotated[tuple[str, ...], Quantity("1", "input")]
    input_units: Annotated[tuple[str, ...], Quantity("1", "input")]
    outputs: Annotated[tuple[str, ...], Quantity("1", "output")]
    output_units: Annotated[tuple[str, ...], Quantity("1", "output")]
    scheduling: Annotated[tuple[str, ...], Quantity("1", "scheduling", "Names of the scheduling parameters")]
    scheduling_units: Annotated[tuple[str, ...], Quantity("1", "scheduling")]
    sampling_period_s: float

    def place(self, point: FloatArray) -> str:
        """Names a position (n_scheduling,) by its scheduling parameters, angles in degrees."""
        pairs = zip(self.scheduling, point.tolist(), self.scheduling_units, strict=True)
        return ", ".join(
            f"{name} = {np.degrees(value):.4g}°" if unit == "rad" else f"{name} = {value:.4g} {unit}"
            for name, value, unit in pairs
        )


@dataclass(frozen=True)
class BasisTable:
    """The basis functions in numbers."""

    names: Annotated[tuple[str, ...], Quantity("1", "function", "Basis functions, the constant one not counted")]
    kind: str  # `polynomials` or `splines`
    exponents: Annotated[IntArray, Quantity("1", "power scheduling", "Exponents of the powers")]
    center: Annotated[FloatArray, Quantity("as of scheduling", "scheduling", "What powers are counted from")]
    scale: Annotated[FloatArray, Quantity("as of scheduling", "scheduling", "What they are counted in")]
    knots: Annotated[FloatArray, Quantity("as of scheduling", "scheduling knot", "Knots of the splines")]
    degree: int  # of the splines' pieces
    lower: Annotated[FloatArray, Quantity("as of scheduling", "scheduling", "Lower end of the range")]
    upper: Annotated[FloatArray, Quantity("as of scheduling", "scheduling", "Upper end of the range")]

    def basis(self) -> Basis:
        """Returns the basis."""
        if self.kind == "splines":
            knots = tuple(tuple(row) for row in self.knots.tolist())
            return Basis(Splines(knots, self.degree), self.lower, self.upper)
        exponents = tuple(tuple(row) for row in self.exponents.tolist())
        functions = Polynomials(exponents, tuple(self.center.tolist()), tuple(self.scale.tolist()))
        return Basis(functions, self.lower, self.upper)


def tabulate_basis(basis: Basis) -> BasisTable:
    """Puts a basis in numbers.

    Raises:
        TypeError: If its functions are neither powers nor splines.
    """
    functions, n = basis.functions, len(basis.lower)
    if isinstance(functions, Splines):
        none, zeros = np.zeros((0, n), int), np.zeros(n)
        knots, degree = np.array(functions.knots), functions.degree
        return BasisTable(functions.names, "splines", none, zeros, zeros, knots, degree, basis.lower, basis.upper)
    if not isinstance(functions, Polynomials):
        message = f"{type(functions).__name__} has no table"
        raise TypeError(message)
    exponents, center, scale = (np.array(each) for each in (functions.exponents, functions.center, functions.scale))
    none = np.zeros((n, 0))
    return BasisTable(functions.names, "polynomials", exponents, center, scale, none, 0, basis.lower, basis.upper)


@dataclass(frozen=True)
class Matrices:
    """Matrices of each function, the constant one first, integrators included."""

    A: Annotated[
        FloatArray,
        Quantity("1", "function_or_constant state state", "Matrices of each function, the constant one first"),
    ]
    B: Annotated[FloatArray, Quantity("1", "function_or_constant state input", "The same of B")]
    C: Annotated[FloatArray, Quantity("1", "function_or_constant output state", "The same of C")]
    D: Annotated[FloatArray, Quantity("1", "function_or_constant output input", "The same of D")]


@dataclass(frozen=True)
class Core:
    """What the fit estimated: the model without integrators."""

    parameters: Annotated[FloatArray, Quantity("1", _ELEMENTS, "Matrices without integrators, row by row")]
    covariance: Annotated[
        FloatArray, Quantity("1", "parameter parameter", "Of all of them, outputs in units of scales")
    ]
    scales: Annotated[FloatArray, Quantity("as of the output", "output", "Units of the outputs")]
    integrators: Annotated[tuple[int, ...], Quantity("1", "output", "How often each output integrates")]
    n_state: int  # states without integrators


@dataclass(frozen=True)
class Dense:
    """Models with all blocks, before any has a price, as the core's parameters."""

    smile: Annotated[FloatArray, Quantity("1", _ELEMENTS, "The local models interpolated, as the core's parameters")]
    full: Annotated[FloatArray, Quantity("1", _ELEMENTS, "The fit of all blocks, likewise")]


@dataclass(frozen=True)
class BlockTable:
    """Blocks of A, B, C and D."""

    kept: Annotated[BoolArray, Quantity("1", "matrix function", "Whether the model has each block of A, B, C, D")]
    absolute: Annotated[FloatArray, Quantity("1", "matrix function_or_constant", "Norm of each block")]
    relative: Annotated[
        FloatArray, Quantity("1", "matrix function", "What it contributes, relative to the constant one")
    ]


@dataclass(frozen=True)
class PathTable:
    """The regularisation path, the model without prices first; rows as of `robid.models.lpv.fit.path.PathPoint`."""

    gamma: Annotated[FloatArray, Quantity("1", "price", "Price of a block")]
    kept: Annotated[BoolArray, Quantity("1", _BLOCKS, "Blocks that are left")]
    relative: Annotated[FloatArray, Quantity("1", _BLOCKS, "Their norms before the refit")]
    refit_cost: Annotated[FloatArray, Quantity("1", "price", "Cost of the exact refit")]
    validation_cost: Annotated[FloatArray, Quantity("1", "price", "Its cost on what chooses the structure")]
    steps: Annotated[IntArray, Quantity("1", "price", "Cone programs")]
    status: Annotated[tuple[str, ...], Quantity("1", "price", "How the refit ended")]
    chosen: int


@dataclass(frozen=True)
class Held:
    """Responses that a model was held against."""

    points: Annotated[FloatArray, Quantity("as of scheduling", "position scheduling", "Scheduling parameters")]
    frequency_hz: Annotated[FloatArray, Quantity("Hz", "frequency", "Lines")]
    response: Annotated[ComplexArray, Quantity("output over input", _RESPONSE, "Measured response")]
    std: Annotated[FloatArray, Quantity("output over input", _RESPONSE, "Its deviation, NaN where it is unknown")]
    modelled: Annotated[ComplexArray, Quantity("output over input", _RESPONSE, "The model's response")]
    # Root of `E|error|^2` of the model's by its parameters.
    modelled_std: Annotated[FloatArray, Quantity("output over input", _RESPONSE, "Its deviation by the parameters")]
    degrees_of_freedom: float  # behind the measured deviations
    agreement: Agreement  # how well they agree


@dataclass(frozen=True)
class LpvSolution:
    """What a fit found."""

    estimate: Estimate  # poles of the frozen models at the fitted positions
    ports: Ports  # channels and scheduling parameters
    basis: BasisTable  # the basis functions
    matrices: Matrices  # the model with its integrators
    core: Core  # the model without, with its covariance
    dense: Dense  # the models that it was made sparse from
    blocks: BlockTable  # which blocks it has
    path: PathTable  # how they were chosen
    own: Held  # the responses that were fitted
    choosing: Held  # those that chose the structure
    misfit: float  # mean weighted square error of an element; near 1 where the model is right
    largest_pole: float  # largest absolute value of a pole over the range, integrators not counted
    largest_pole_at: Annotated[
        FloatArray, Quantity("as of scheduling", "scheduling", "Where the largest pole of the range is")
    ]

    @property
    def core_model(self) -> LpvModel:
        """The model without integrators."""
        return self._without_integrators(self.core.parameters)

    @property
    def model(self) -> LpvModel:
        """The model with its integrators."""
        return add_integrators(self.core_model, self.core.integrators)

    @property
    def smile_model(self) -> LpvModel:
        """The interpolation of the local models, with its integrators."""
        return add_integrators(self._without_integrators(self.dense.smile), self.core.integrators)

    @property
    def full_model(self) -> LpvModel:
        """The fit of all blocks, with its integrators."""
        return add_integrators(self._without_integrators(self.dense.full), self.core.integrators)

    def _without_integrators(self, parameters: FloatArray) -> LpvModel:
        sizes = Sizes(self.core.n_state, len(self.ports.inputs), len(self.ports.outputs))
        return LpvModel(parameters, sizes, self.basis.basis(), self.ports.sampling_period_s)

    def response(self, points: FloatArray, frequency_hz: FloatArray) -> ResponseUncertainty:
        """Returns the response of the model at rest at points (n_pos, n_scheduling), with its deviations.

        Raises:
            DataError: If a point lies outside the range.
        """
        core = self.core
        return model_response(self.core_model, core.scales, core.covariance, core.integrators, points, frequency_hz)
