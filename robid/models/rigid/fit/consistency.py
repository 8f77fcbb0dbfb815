"""Standard parameters of real bodies nearest to the nominal ones, and how the estimate compares with these."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray, check_shape
from robid.models.rigid.fit.options import ConsistencyOptions
from robid.models.rigid.fit.regression import Reduction
from robid.models.rigid.fit.solution import NominalTorques
from robid.results.estimate import Estimate
from robid.robot.regressor.base import BaseParameters
from robid.robot.regressor.model import RigidModel

_ROOT2 = np.sqrt(2.0)
_FLAT = 1e-6  # of the largest variance
_UPPER = tuple((row, column) for column in range(4) for row in range(column + 1))


@dataclass(frozen=True)
class Consistent:
    """A physically consistent set of standard parameters."""

    standard: FloatArray  # (n_std,): the parameters
    base: FloatArray  # (n_base,): their base parameters
    moved: FloatArray  # (n_base,): how far these are from the estimate, in standard deviations
    gain: FloatArray  # (n_std, n_base): change of the standard parameters with the estimate, where no constraint binds
    # `estimated` where a real body has the estimated base parameters, `moved` where only the nearest ones could be had,
    # `failed` where the solver found none.
    status: Literal["estimated", "moved", "failed"]


def make_consistent(
    base: FloatArray,
    covariance: FloatArray,
    combination: FloatArray,
    nominal: FloatArray,
    bodies: IntArray,
    nonnegative: Sequence[int] = (),
    options: ConsistencyOptions | None = None,
    scale: FloatArray | None = None,
) -> Consistent:
    """Finds the real bodies nearest to the nominal ones that have the estimated base parameters.

    Where there are none, constrained least squares takes the place of the estimate: the real bodies whose base
    parameters are nearest to it by its own covariance.

    Args:
        base (n_base,): Estimated base parameters.
        covariance (n_base, n_base): Their covariance.
        combination (n_base, n_std): Base parameters of standard ones.
        nominal (n_std,): Nominal standard parameters, of real bodies.
        bodies (n_body, 10): Indices of XX, XY, XZ, YY, YZ, ZZ about the frame's origin, MX, MY, MZ and M of each body.
        nonnegative: Indices of the others that cannot be negative, such as motor inertias and friction.
        options: Margins.
        scale (n_std,): What changes are measured by; `parameter_scale` by default.

    Raises:
        ValueError: If shapes differ.

    Source:
        Wensing, Kim and Slotine (2018): pseudo-inertias that are positive definite; docs/methods, sec. 7.
    """
    check_shape("combination", combination, "n_base n_std", n_base=len(base), n_std=len(nominal))
    check_shape("bodies", bodies, "n_body n_moment", n_moment=10)
    chosen = options or ConsistencyOptions()
    scale = parameter_scale(nominal, bodies) if scale is None else scale
    # Changes are measured by the size of their body, base parameters by their deviations: all numbers near one.
    deviation = np.sqrt(np.diag(covariance))
    short = combination * scale
    inverse = np.linalg.pinv(short)
    # Without bounds the nearest ones; what these change of them is small, and all that is solved for.
    nearest = inverse @ (base - combination @ nominal)
    cone = _real_bodies(nominal + scale * nearest, nominal, scale, bodies, nonnegative, chosen.margin)
    rows = short / deviation[:, None]
    change = _solve(cone, rows)
    status: Literal["estimated", "moved", "failed"] = "estimated"
    if change is None:
        # No real body has the estimate: minimise the distance to it, white by its own covariance, plus a weak pull to
        # the nominal ones.
        white = _whitening(covariance / np.outer(deviation, deviation)) @ rows
        axes = _unit_axes(np.vstack([white, chosen.pull * np.eye(len(nominal))]))
        found = _solve(replace(cone, rows=cone.rows @ axes), None)
        change, status = None if found is None else axes @ found, "moved"
    if change is None:
        change, status = -nearest, "failed"
    gain, change = scale[:, None] * inverse, nearest + change
    standard = nominal + scale * change
    reached = combination @ standard
    return Consistent(standard, reached, (reached - base) / deviation, gain, status)


def pseudo_inertia(moments: FloatArray) -> FloatArray:
    """Returns the pseudo-inertia (4, 4) of XX, XY, XZ, YY, YZ, ZZ, MX, MY, MZ, M (10,)."""
    xx, xy, xz, yy, yz, zz = moments[:6]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    first = moments[6:9]
    # Second moments: the integral of r r^T dm is tr(I)/2 - I. With first moments and mass they are positive definite
    # for a body of positive density anywhere, and only then.
    second = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    return np.block([[second, first[:, None]], [first[None], moments[9:10][None]]])


def parameter_scale(nominal: FloatArray, bodies: IntArray) -> FloatArray:
    """Returns what changes (n_std,) of the parameters are measured by: a body's mass and its radius of gyration."""
    scale = np.maximum(np.abs(nominal), 1e-3)
    for body in bodies:
        mass, radius = _size(nominal[body])
        scale[body] = mass * np.repeat([radius**2, radius, 1.0], [6, 3, 1])
    return np.asarray(scale)


def _size(moments: FloatArray) -> tuple[float, float]:
    mass = max(float(moments[9]), 1e-6)
    return mass, float(np.sqrt(max(np.trace(pseudo_inertia(moments)[:3, :3]) / mass, 1e-8)))


def _whitening(correlation: FloatArray) -> FloatArray:
    """What makes errors of this correlation (n, n) white; few blocks of a record leave some of it without variance."""
    variance, axes = np.linalg.eigh(correlation)
    return np.asarray((axes / np.sqrt(np.maximum(variance, _FLAT * variance[-1]))).T)


@dataclass(frozen=True)
class _Cone:
    """Conic constraints `offset + rows @ change`: first nonnegative numbers, then triangles of matrices."""

    rows: FloatArray
    offset: FloatArray
    n_number: int
    n_matrix: int


def _real_bodies(
    start: FloatArray,
    nominal: FloatArray,
    scale: FloatArray,
    bodies: IntArray,
    nonnegative: Sequence[int],
    margin: float,
) -> _Cone:
    """What changes of the start make of it: numbers and pseudo-inertias, these over the nominal body's size."""
    numbers = list(nonnegative)
    rows: list[FloatArray] = [np.eye(len(nominal))[numbers]]
    offset: list[FloatArray] = [start[numbers] / scale[numbers]]
    for body in bodies:
        mass, radius = _size(nominal[body])
        # In units of the nominal mass and radius of gyration eigenvalues are near one, and the margin is relative.
        unit = np.diag([1 / radius] * 3 + [1.0]) / np.sqrt(mass)
        parts = np.stack([_triangle(unit @ pseudo_inertia(part) @ unit) for part in np.diag(scale[body])], axis=1)
        own = np.zeros((10, len(nominal)))
        own[:, body] = parts
        rows.append(own)
        offset.append(_triangle(unit @ pseudo_inertia(start[body]) @ unit - margin * np.eye(4)))
    return _Cone(np.vstack(rows), np.concatenate(offset), len(numbers), len(bodies))


def _triangle(matrix: FloatArray) -> FloatArray:
    """Stacks the upper triangle by columns, so that inner products are those of the matrices."""
    return np.array([matrix[row, column] * (1.0 if row == column else _ROOT2) for row, column in _UPPER])


def _unit_axes(rows: FloatArray) -> FloatArray:
    """Changes (n, n) that are independent and each as far as 1 by the sum of the squares of these rows."""
    _, size, axes = np.linalg.svd(rows, full_matrices=False)
    return np.asarray(axes.T / size)


def _solve(cone: _Cone, still: FloatArray | None) -> FloatArray | None:
    """Finds the smallest change within the cone that leaves some combinations still; None if it cannot."""
    import clarabel
    from scipy.sparse import csc_matrix, identity

    cones = [clarabel.NonnegativeConeT(cone.n_number)] if cone.n_number else []
    cones += [clarabel.PSDTriangleConeT(4)] * cone.n_matrix
    rows, offset = -cone.rows, cone.offset
    if still is not None:
        cones.insert(0, clarabel.ZeroConeT(len(still)))
        rows, offset = np.vstack([still, rows]), np.append(np.zeros(len(still)), offset)
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    n_change = rows.shape[1]
    square, linear = identity(n_change, format="csc"), np.zeros(n_change)
    answer = clarabel.DefaultSolver(square, linear, csc_matrix(rows), offset, cones, settings).solve()
    if str(answer.status) not in {"Solved", "AlmostSolved"}:
        return None
    return np.asarray(answer.x)


_LINKS = ("inertia", "first_moment", "mass")
_ROTORS = ("motor_inertia", "coupling_inertia")
_NOTHING = 1e-9  # of a joint's torque


def against_nominal(
    model: RigidModel, base: BaseParameters, estimate: Estimate, reduction: Reduction
) -> NominalTorques:
    """Compares the torques of the links with those of the robot file's, from reduced rows alone.

    The rotors that are grouped with links are taken as the robot file has them. What other parameters can give along
    this motion is left out of both, since an estimate shares it out as it pleases.
    """
    # Rotors that are grouped with links count as the file has them: they are known better than what drives them.
    rotors = base.combination @ np.where(np.isin(np.array(model.kinds), _ROTORS), model.nominal, 0.0)
    both, kinds = np.stack([estimate.value, estimate.nominal], axis=1), np.array(estimate.kinds)
    links, bodies = np.isin(kinds, _LINKS), np.isin(kinds, (*_LINKS, *_ROTORS))
    rows = [_compare(factor, links, both - rotors[:, None]) for factor in reduction.factors]
    share, ratio, likeness = np.array(rows).T
    whole = np.array([_compare(factor, bodies, both)[1] for factor in reduction.factors])
    return NominalTorques(share, ratio, likeness, whole)


def _compare(factor: FloatArray, chosen: BoolArray, values: FloatArray) -> tuple[float, float, float]:
    """Share, ratio and likeness of what some parameters (n_param, 2), estimated and nominal, do to one joint."""
    both, others = factor[:, :-1][:, chosen] @ values[chosen], factor[:, :-1][:, ~chosen]
    size = np.linalg.norm(others, axis=0)
    others = others / np.where(size > 0, size, 1.0)
    both = both - others @ np.linalg.lstsq(others, both, rcond=None)[0]
    estimated, stated = np.linalg.norm(both, axis=0).tolist()
    whole = float(np.linalg.norm(factor[:, -1]))
    if min(estimated, stated) <= _NOTHING * whole:
        return estimated / whole, float("nan"), float("nan")
    return estimated / whole, estimated / stated, float(both[:, 0] @ both[:, 1]) / (estimated * stated)
