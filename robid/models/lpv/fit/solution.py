"""A position-dependent model with everything that is to be kept of its fit, as plain values."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.models.lpv.fit.basis import Basis, Polynomials, Splines
from robid.models.lpv.fit.model import LpvModel, add_integrators
from robid.models.lpv.fit.responses import Agreement
from robid.models.lpv.fit.state_space import Sizes
from robid.models.lpv.fit.uncertainty import ResponseUncertainty, model_response
from robid.results.estimate import Estimate


@dataclass(frozen=True)
class Ports:
    """What goes in, what comes out, and what schedules, by name and unit."""

    inputs: tuple[str, ...]
    input_units: tuple[str, ...]
    outputs: tuple[str, ...]
    output_units: tuple[str, ...]
    scheduling: tuple[str, ...]
    scheduling_units: tuple[str, ...]
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
    """The basis functions in numbers.

    Attributes:
        names: Name of each function, the constant one not counted.
        kind: `polynomials` or `splines`.
        exponents (n_function, n_scheduling): Of the powers; none of splines.
        center (n_scheduling,): What powers are counted from.
        scale (n_scheduling,): What they are counted in.
        knots (n_scheduling, n_knot): Of the splines; none of powers.
        degree: Of the splines' pieces.
        lower (n_scheduling,): Lower end of the range.
        upper (n_scheduling,): Upper end.
    """

    names: tuple[str, ...]
    kind: str
    exponents: IntArray
    center: FloatArray
    scale: FloatArray
    knots: FloatArray
    degree: int
    lower: FloatArray
    upper: FloatArray

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

    A: FloatArray
    B: FloatArray
    C: FloatArray
    D: FloatArray


@dataclass(frozen=True)
class Core:
    """What the fit estimated: the model without integrators.

    Attributes:
        parameters (n_function + 1, n_local): Packed matrices of each function.
        covariance (n_param, n_param): Of all of them, outputs in units of the scales.
        scales (n_out,): Those units.
        integrators: How often each output integrates.
        n_state: States without integrators.
    """

    parameters: FloatArray
    covariance: FloatArray
    scales: FloatArray
    integrators: tuple[int, ...]
    n_state: int


@dataclass(frozen=True)
class Dense:
    """Models with all blocks, before any has a price, as the core's parameters.

    Attributes:
        smile (n_function + 1, n_local): The local models, interpolated.
        full (n_function + 1, n_local): The same, fitted to all responses together.
    """

    smile: FloatArray
    full: FloatArray


@dataclass(frozen=True)
class BlockTable:
    """Blocks of A, B, C and D.

    Attributes:
        kept (4, n_function): Which the model has.
        absolute (4, n_function + 1): Euclidean norm of each, the constant ones first.
        relative (4, n_function): What each contributes at most, relative to the constant block.
    """

    kept: BoolArray
    absolute: FloatArray
    relative: FloatArray


@dataclass(frozen=True)
class PathTable:
    """The regularisation path, the model without prices first; rows as of `robid.models.lpv.fit.path.PathPoint`."""

    gamma: FloatArray
    kept: BoolArray
    relative: FloatArray
    refit_cost: FloatArray
    validation_cost: FloatArray
    steps: IntArray
    status: tuple[str, ...]
    chosen: int


@dataclass(frozen=True)
class Held:
    """Responses that a model was held against.

    Attributes:
        points (n_pos, n_scheduling): Positions.
        frequency_hz (n_freq,): Lines.
        response (n_pos, n_freq, n_out, n_in): Measured.
        std (n_pos, n_freq, n_out, n_in): Its deviation; NaN where that is unknown, infinite where it is left out.
        modelled (n_pos, n_freq, n_out, n_in): The model's.
        modelled_std (n_pos, n_freq, n_out, n_in): Root of `E|error|^2` of the model's by its parameters.
        degrees_of_freedom: Behind the measured deviations.
        agreement: How well they agree.
    """

    points: FloatArray
    frequency_hz: FloatArray
    response: ComplexArray
    std: FloatArray
    modelled: ComplexArray
    modelled_std: FloatArray
    degrees_of_freedom: float
    agreement: Agreement


@dataclass(frozen=True)
class LpvSolution:
    """What a fit found.

    Attributes:
        estimate: Poles of the frozen models at the fitted positions.
        ports: Channels and scheduling parameters.
        basis: The basis functions.
        matrices: The model with its integrators.
        core: The model without, with its covariance.
        dense: The models that it was made sparse from.
        blocks: Which blocks it has.
        path: How they were chosen.
        own: The responses that were fitted.
        choosing: Those that chose the structure.
        misfit: Mean weighted square error of an element; near 1 where the model is right.
        largest_pole: Largest absolute value of a pole over the range, integrators not counted.
        largest_pole_at (n_scheduling,): Where it is reached.
    """

    estimate: Estimate
    ports: Ports
    basis: BasisTable
    matrices: Matrices
    core: Core
    dense: Dense
    blocks: BlockTable
    path: PathTable
    own: Held
    choosing: Held
    misfit: float
    largest_pole: float
    largest_pole_at: FloatArray

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
        """Returns the response of the model at rest, with its deviations.

        Args:
            points (n_pos, n_scheduling): Scheduling parameters.
            frequency_hz (n_freq,): Lines.

        Raises:
            DataError: If a point lies outside the range.
        """
        core = self.core
        return model_response(self.core_model, core.scales, core.covariance, core.integrators, points, frequency_hz)
