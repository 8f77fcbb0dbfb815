"""Cost and normal equations of symmetric responses: each pair of elements once, one matrix product for all lines."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg.blas import dsyrk

from robid.arrays import ComplexArray, FloatArray
from robid.frf.friction import FrictionMove, motor_friction_move
from robid.results.levenberg import Normal
from robid.robot.collocated import Collocated, has_plain_inertias, is_collocated
from robid.robot.parameters import DIRECT

if TYPE_CHECKING:
    from robid.models.elastic.fit.problem import Problem


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
        scale = self._root / self._residuals.divisor(self._modelled)
        rows = self._collocated.derivatives(parameters.kinds, parameters.masks, scale)
        weighted = (self._weight * self._residual).sum(axis=0) * self._inverse_root
        hessian, gradient = _gram(rows, self._real), _project(rows, weighted, self._real)
        if self._friction is not None:
            scales = internal[-parameters.n_friction :]
            hessian, gradient = self._with_friction(self._slopes(self._friction, scales), rows, hessian, gradient)
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
        moved *= -self._weight_root / self._residuals.divisor(self._measured)
        shared = (self._weight_root * moved).sum(axis=1) * self._inverse_root
        cross = _cross(rows, shared, self._real)
        own = _gram(moved, self._real)
        slope = _project(moved, self._weight_root * self._residual, self._real)
        return np.block([[hessian, cross], [cross.T, own]]), np.concatenate([gradient, slope])


def _flat(rows: ComplexArray | FloatArray, real: bool) -> FloatArray:
    """Rows of real numbers; the imaginary parts follow or are left out."""
    if real:
        return np.ascontiguousarray(rows.real).reshape(len(rows), -1)
    return np.ascontiguousarray(rows, complex).reshape(len(rows), -1).view(float)


def _gram(rows: ComplexArray, real: bool) -> FloatArray:
    upper = dsyrk(1.0, _flat(rows, real).T, trans=1)
    return np.asarray(upper + np.triu(upper, 1).T)


def _cross(rows: ComplexArray, others: ComplexArray, real: bool) -> FloatArray:
    return np.asarray(_flat(rows, real) @ _flat(others, real).T)


def _project(rows: ComplexArray, target: ComplexArray | FloatArray, real: bool) -> FloatArray:
    return np.asarray(_flat(rows, real) @ _flat(target[None], real)[0])
