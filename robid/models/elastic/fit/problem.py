"""The elastic least-squares problem: residual, cost and normal equations, also of symmetric responses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg.blas import dsyrk

from robid.arrays import ComplexArray, FloatArray
from robid.frf.frf import Frf
from robid.frf.friction import FrictionMove, friction_move, motor_friction_move
from robid.frf.residual import Residual
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.parameters import ParameterMap
from robid.models.elastic.fit.weights import assumed_error, make_weights, make_whitening
from robid.results.levenberg import Normal
from robid.robot.collocated import Collocated, has_plain_inertias, is_collocated
from robid.robot.derivatives import jacobian
from robid.robot.linearize import LinearModel
from robid.robot.parameters import DIRECT
from robid.robot.response import response


class SymmetricNormal:
    """The sums of one problem at one point after the other; a point's cost and normal equations share its response.

    By reciprocity the element (o, i) of the modelled response is the element (i, o). Both measured ones keep
    their own residual and weight, but their derivatives are computed once.

    Args:
        problem: The problem, for which `SymmetricNormal.serves` holds.
    """

    def __init__(self, problem: Problem) -> None:
        """Sorts measured response and weights into pairs, lines without any weight left out."""
        self._problem, self._residuals = problem, problem.residual_kind
        used = np.asarray(problem.weight.any(axis=(2, 3)))
        frf = problem.frf
        self._collocated = Collocated(
            problem.model, frf.frequency_hz, frf.hold_period_s, used, problem.parameters.kinds
        )
        # The model has one element for each pair (o, i) and (i, o), the measurement two; a diagonal element has no
        # mirror, and counts once.
        self._rows, self._columns = np.triu_indices(problem.weight.shape[-1])
        self._weight = np.asarray(self._pairs(problem.weight[used]), float)
        self._weight[1, self._rows == self._columns] = 0.0
        self._sum = np.asarray(self._weight.sum(axis=0))
        self._root = np.sqrt(self._sum)
        self._inverse_root = np.divide(1, self._root, out=np.zeros_like(self._root), where=self._root > 0)
        self._weight_root = np.sqrt(self._weight)
        self._friction, self._by_motor = None, None
        if problem.parameters.n_friction:
            self._friction = FrictionMove(frf.response[used], problem.friction.share[used])
            self._by_motor = motor_friction_move(self._friction)
        self._measured = self._counted(frf.response[used])
        self._transformed = self._residuals.transform(self._measured)
        self._point: FloatArray | None = None
        self._residual: FloatArray | ComplexArray = np.empty(0)
        self._modelled = np.empty(0, complex)
        self._moved = self._moved_rows = np.empty(0, complex)
        self._total = np.inf

    @staticmethod
    def serves(problem: Problem) -> bool:
        """Whether the problem has the symmetry and the parameters that this needs."""
        model, kinds = problem.model, set(problem.parameters.kinds)
        bare = model.added is None and model.clinging is None
        constant = bare and model.rest.moves is None and not problem.parameters.nominal.cubic.any()
        plain = "link_inertia" not in kinds or has_plain_inertias(model)
        return constant and plain and is_collocated(model) and kinds <= set(DIRECT)

    def _pairs(self, values: FloatArray | ComplexArray) -> FloatArray | ComplexArray:
        """Elements (2, n_pair, n_line) of (n_line, n_out, n_in): upper triangle, and what mirrors it."""
        both = values[:, self._rows, self._columns].T, values[:, self._columns, self._rows].T
        return np.asarray(np.stack(both))

    def _counted(self, values: ComplexArray) -> ComplexArray:
        """The same of a measured response, with ones where there is no weight."""
        paired = self._pairs(values)
        return np.where((self._weight > 0) & (paired != 0), paired, 1.0)

    def cost(self, internal: FloatArray) -> float:
        """Weighted squares of the residual, without what is known beforehand."""
        if self._point is None or not np.array_equal(self._point, internal):
            self._move(internal)
        return self._total

    def normal(self, internal: FloatArray) -> Normal:
        """The same with half its gradient and half its Gauss-Newton Hessian."""
        total = self.cost(internal)
        parameters = self._problem.parameters
        # Both residuals of a pair have the same derivative d: the Hessian is the sum of (w1 + w2) d d', and the
        # gradient needs their weighted mean alone.
        scale = self._root / self._residuals.divisor(self._modelled)
        weighted = (self._weight * self._residual).sum(axis=0) * self._inverse_root
        rows = self._collocated.derivatives(parameters.kinds, parameters.masks, scale, weighted)
        # One product gives both: the products of the rows with each other, and with the residual after them.
        products = _gram(rows, self._real)
        rows, hessian, gradient = rows[:-1], products[:-1, :-1], products[:-1, -1]
        if self._friction is not None:
            scales = internal[-parameters.n_friction :]
            hessian, gradient = self._with_friction(self._slopes(self._friction, scales), rows, hessian, gradient)
        # From elements of the model to internal parameters. A residual falls where the model rises: hence the sign.
        chain = parameters.chain(internal)
        return Normal(total, -(chain.T @ gradient), chain.T @ hessian @ chain)

    @property
    def _real(self) -> bool:
        return self._residuals.parts == 1

    def _move(self, internal: FloatArray) -> None:
        parameters = self._problem.parameters
        self._modelled = self._collocated.response(parameters.parameters(internal))
        if self._friction is not None:
            scales = internal[-parameters.n_friction :]
            if self._by_motor is not None:
                self._moved, self._moved_rows = self._by_motor.moved(scales)
            else:
                self._moved = self._friction.moved(scales)
            self._measured = self._counted(self._moved)
            self._transformed = self._residuals.transform(self._measured)
        self._residual = self._residuals.subtract(self._transformed, self._residuals.transform(self._modelled))
        parts = [self._residual] if self._real else [self._residual.real, self._residual.imag]
        self._total = float(sum(np.vdot(self._weight, part * part) for part in parts))
        self._point = internal.copy()

    def _slopes(self, friction: FrictionMove, scales: FloatArray) -> ComplexArray:
        """Derivatives (n_friction, 2, n_pair, n_line) of the measured response by the friction scales."""
        if self._by_motor is None:
            return np.array([self._pairs(slope) for slope in np.moveaxis(friction.slopes(scales), -1, 0)])
        # Where each scale is of one motor, the derivative by it is an outer product of a column of the moved response
        # and a row that comes with it.
        columns = np.ascontiguousarray(self._moved[..., self._by_motor.motors.argmax(axis=0)].transpose(2, 1, 0))
        rows = np.ascontiguousarray(self._moved_rows.transpose(1, 2, 0))
        found = np.empty((len(columns), *self._weight.shape), complex)
        for side, (outputs, inputs) in enumerate(((self._rows, self._columns), (self._columns, self._rows))):
            np.multiply(columns[:, outputs], rows[:, inputs], out=found[:, side])
        return found

    def _with_friction(
        self, moved: ComplexArray, rows: ComplexArray, hessian: FloatArray, gradient: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Adds the friction scales, which move each measured element (n_friction, 2, n_pair, n_line) on its own."""
        # These move what was measured, not the model: each of a pair's two residuals by itself.
        moved *= -self._weight_root / self._residuals.divisor(self._measured)
        shared = (self._weight_root * moved).sum(axis=1) * self._inverse_root
        cross = _flat(rows, self._real) @ _flat(shared, self._real).T
        own = _gram(moved, self._real)
        slope = _project(moved, self._weight_root * self._residual, self._real)
        return np.block([[hessian, cross], [cross.T, own]]), np.concatenate([gradient, slope])


def _flat(rows: ComplexArray | FloatArray, real: bool) -> FloatArray:
    """Rows of real numbers; the imaginary parts follow or are left out."""
    if real:
        return np.ascontiguousarray(rows.real).reshape(len(rows), -1)
    return np.ascontiguousarray(rows, complex).reshape(len(rows), -1).view(float)


def _gram(rows: ComplexArray, real: bool) -> FloatArray:
    flat = _flat(rows, real)
    if not flat.size:  # no line has a weight
        return np.zeros((len(flat), len(flat)))
    upper = dsyrk(1.0, flat.T, trans=1)
    return np.asarray(upper + np.triu(upper, 1).T)


def _project(rows: ComplexArray, target: ComplexArray | FloatArray, real: bool) -> FloatArray:
    return np.asarray(_flat(rows, real) @ _flat(target[None], real)[0])


@dataclass(frozen=True)
class Problem:
    """Measured against parametric response."""

    frf: Frf  # Measured response
    model: LinearModel  # Linearised robot in the same configurations
    parameters: ParameterMap  # What is estimated
    residual_kind: Residual  # How measured and modelled response are compared
    weight: FloatArray  # (n_conf, n_freq, n_out, n_in) Weight of each squared residual
    model_error: FloatArray  # Relative model error that the weights assume: one number or (n_conf, 1, n_out, n_in)
    # (n_conf, n_freq, n_element, n_element) What multiplies the residuals of a line, rows of the response one after the
    # other, where errors of its elements are correlated; None for `weight` alone
    whitening: ComplexArray | None = None

    @cached_property
    def _symmetric(self) -> SymmetricNormal | None:
        return SymmetricNormal(self) if self.whitening is None and SymmetricNormal.serves(self) else None

    def __getstate__(self) -> dict[str, Any]:
        """Leaves the working memory of `_symmetric` behind."""
        return {name: value for name, value in self.__dict__.items() if name != "_symmetric"}

    @cached_property
    def friction(self) -> FrictionMove:
        """How the measured response follows the friction scales."""
        return friction_move(self.frf)

    def model_response(self, internal: FloatArray) -> ComplexArray:
        """Parametric response (n_conf, n_freq, n_out, n_in)."""
        values = self.parameters.parameters(internal)
        return response(self.model, values, self.frf.frequency_hz, self.frf.hold_period_s).sampled

    def measured(self, internal: FloatArray) -> ComplexArray:
        """Measured response, friction compensation moved by the estimated friction scales."""
        count = self.parameters.n_friction
        return self.friction.moved(internal[-count:]) if count else self.frf.response

    def measured_slopes(self, internal: FloatArray) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in, n_friction) of the measured response by the friction scales."""
        return self.friction.slopes(internal[-self.parameters.n_friction :])

    def residual(self, internal: FloatArray, modelled: ComplexArray) -> ComplexArray:
        """Residual (n_conf, n_freq, n_out, n_in)."""
        return self.residual_kind.compare(self.measured(internal), modelled)

    def weighted(self, values: ComplexArray) -> ComplexArray:
        """Residuals or derivatives (n_conf, n_freq, n_out, n_in, ...) times the root of the weights."""
        trailing = (1,) * (values.ndim - 4)
        if self.whitening is None:
            return np.asarray(np.sqrt(self.weight).reshape(*self.weight.shape, *trailing) * values)
        stacked = values.reshape(*values.shape[:2], self.whitening.shape[-1], -1)
        return np.asarray((self.whitening @ stacked).reshape(values.shape))

    def rows(self, values: ComplexArray) -> FloatArray:
        """The same as real rows (n_conf, n_row, ...) of each configuration."""
        flat = self.weighted(values).reshape(len(values), -1, *values.shape[4:])
        return np.concatenate([flat.real, flat.imag], axis=1)

    def fully_weighted(self, values: ComplexArray) -> ComplexArray:
        """The same times the weights themselves."""
        trailing = (1,) * (values.ndim - 4)
        if self.whitening is None:
            return np.asarray(self.weight.reshape(*self.weight.shape, *trailing) * values)
        adjoint = np.swapaxes(self.whitening.conj(), -1, -2)
        stacked = self.weighted(values).reshape(*values.shape[:2], adjoint.shape[-1], -1)
        return np.asarray((adjoint @ stacked).reshape(values.shape))

    def cost(self, internal: FloatArray) -> float:
        """Weighted cost, eq. 4b or 7b, with half the squared deviations from what is known beforehand."""
        with np.errstate(all="ignore"):
            if self._symmetric is not None:
                total = self._symmetric.cost(internal)
            else:
                total = float(self.configuration_cost(self.model_response(internal), internal).sum())
            total += self._prior_cost(internal)
        return total if np.isfinite(total) else np.inf

    def configuration_cost(self, modelled: ComplexArray, internal: FloatArray) -> FloatArray:
        """Weighted cost of each configuration (n_conf,)."""
        error = self.weighted(self.residual(internal, modelled))
        return np.asarray((np.abs(error) ** 2).sum(axis=(1, 2, 3)))

    def linear(self, internal: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Residual and its negative derivative (n_conf, n_freq, n_out, n_in, n_param)."""
        values = self.parameters.parameters(internal)
        result = response(self.model, values, self.frf.frequency_hz, self.frf.hold_period_s)
        # Of the model by all elements, by the chain to internal parameters, then by the residual's divisor: d log G =
        # dG / G.
        derivative = self.parameters.chained(jacobian(self.model, values, result, self.parameters.kinds), internal)
        derivative /= self.residual_kind.divisor(result.sampled)[..., None]
        if self.parameters.n_friction:
            moved = -self.measured_slopes(internal) / self.residual_kind.divisor(self.measured(internal))[..., None]
            derivative = np.concatenate([derivative, moved], axis=-1)
        return self.residual(internal, result.sampled), self.residual_kind.part(derivative)

    def normal(self, internal: FloatArray) -> Normal:
        """Cost, half gradient and half Gauss-Newton Hessian."""
        if self._symmetric is None:
            return self.stacked_normal(internal)
        with np.errstate(all="ignore"):
            sums = self._symmetric.normal(internal)
        precision = 0.5 / self.parameters.prior_std**2
        return Normal(
            sums.cost + self._prior_cost(internal),
            sums.gradient + precision * internal,
            sums.hessian + np.diag(precision),
        )

    def stacked(self, internal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """All weighted residuals as real numbers, what is known beforehand last, and their derivative."""
        error, derivative = self.linear(internal)
        rows = self.weighted(derivative).reshape(-1, derivative.shape[-1])
        target = self.weighted(error).ravel()
        # What is known beforehand as one more residual each: half its squared deviation is a part of the cost.
        known = np.sqrt(0.5) / self.parameters.prior_std
        residual = np.concatenate([target.real, target.imag, known * internal])
        return residual, np.concatenate([-rows.real, -rows.imag, np.diag(known)])

    def stacked_normal(self, internal: FloatArray) -> Normal:
        """The same as `normal` from all residuals and derivatives, whatever the problem."""
        residual, derivative = self.stacked(internal)
        return Normal(float(residual @ residual), derivative.T @ residual, derivative.T @ derivative)

    def _prior_cost(self, internal: FloatArray) -> float:
        return float((0.5 * (internal / self.parameters.prior_std) ** 2).sum())


def make_problem(
    frf: Frf,
    model: LinearModel,
    parameters: ParameterMap,
    options: ElasticOptions,
    internal: FloatArray | None = None,
    level: FloatArray | None = None,
) -> tuple[Problem, int]:
    """Sets up the problem; where fitted internal values are known, the weights follow the fitted response.

    Weights `estimated` allow for the relative model error `level` (n_conf, n_out, n_in) of each element.

    Returns:
        The problem and the number of elements that the logarithm drops.
    """
    values = parameters.parameters(np.zeros(len(parameters.names)) if internal is None else internal)
    modelled = response(model, values, frf.frequency_hz, frf.hold_period_s).sampled
    fitted = None if internal is None else modelled
    # Errors relative to a fitted model: relative to the measurement, noise would choose its own weight.
    size = None if fitted is None else np.abs(fitted)
    weight, dropped = make_weights(frf, options.weights, options.residual, size, level)
    if options.residual.drops_noise:
        weight[modelled == 0] = 0.0  # no parameter moves what the model cannot have
    whitening = None
    if options.weights.kind == "optimal_full":
        whitening = make_whitening(frf, weight > 0, options.residual, fitted)
    model_error = assumed_error(options.weights, level, known=bool(frf.element_variance().any()))
    return Problem(frf, model, parameters, options.residual, weight, model_error, whitening), dropped


def without_coefficients(frf: Frf) -> Frf:
    """Returns a response whose compensated torques are taken for granted."""
    return replace(
        frf,
        sensitivity=frf.sensitivity[:, :0],
        coefficient_names=(),
        coefficient_relative_std=np.zeros(0),
        coefficient_offset=None,
    )
