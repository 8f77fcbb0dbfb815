"""Poles of the frozen models as an estimate: matrices depend on the states' basis, poles do not."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from robid.arrays import ComplexArray, FloatArray
from robid.models.lpv.fit.model import LpvModel
from robid.results.estimate import Estimate

_LEAST_DAMPING = 0.05
_REAL = 1e-9  # of a pole's absolute value, an imaginary part that counts as none


@dataclass(frozen=True)
class _Row:
    name: str
    kind: str
    unit: str
    value: float
    scale: float
    slope: FloatArray


def estimate_poles(
    core: LpvModel,
    covariance: FloatArray,
    points: FloatArray,
    status: str,
    *,
    confidence: float,
    identifiable_relative_std: float,
) -> Estimate:
    """Returns natural frequencies, damping ratios and rates of the frozen models at some positions.

    Poles on the negative real axis of the z plane have no counterpart in continuous time and are left out.

    Args:
        core: The model without integrators.
        covariance (n_param, n_param): Of its parameters; the outputs' units play no part.
        points (n_pos, n_scheduling): Positions.
        status: How the fit ended.
        confidence: Level of the intervals.
        identifiable_relative_std: Relative deviation up to which a parameter counts as identifiable.
    """
    rows = [row for index in range(len(points)) for row in _rows(core, points[index : index + 1], f"p{index + 1}")]
    slopes = np.array([row.slope for row in rows]).reshape(len(rows), core.parameters.size)
    value, scale = (np.array([getattr(row, key) for row in rows], float) for key in ("value", "scale"))
    whole = slopes @ covariance @ slopes.T
    whole = 0.5 * (whole + whole.T)
    std, half = np.sqrt(np.maximum(np.diag(whole), 0)), norm.ppf(0.5 + 0.5 * confidence)
    return Estimate(
        names=tuple(row.name for row in rows),
        kinds=tuple(row.kind for row in rows),
        units=tuple(row.unit for row in rows),
        nominal=np.full(len(rows), np.nan),
        value=value,
        lower=value - half * std,
        upper=value + half * std,
        covariance=whole,
        degrees_of_freedom=np.full(len(rows), np.inf),
        confidence=confidence,
        interval_rule="the covariance of the responses, or the residual where it is larger",
        relative_std=std / scale,
        predicted_relative_std=std / scale,
        prior_relative_std=np.full(len(rows), np.inf),
        relative_half_width=half * std / scale,
        identifiable=std / scale <= identifiable_relative_std,
        identifiable_relative_std=identifiable_relative_std,
        undetermined=(),
        status=status,
        advice="" if status == "converged" else "try another `order` or fewer basis functions",
    )


def continuous_poles(A: FloatArray, sampling_period_s: float) -> ComplexArray:
    """Returns the logarithms of the poles (..., n_state) over the sampling period [rad/s]."""
    return np.asarray(np.log(np.linalg.eigvals(A).astype(complex)) / sampling_period_s)


def _rows(core: LpvModel, point: FloatArray, place: str) -> Iterator[_Row]:
    """Yields the poles at one point, slow ones first, with their slopes by all parameters."""
    A = core.at(point).A[0]
    values, right = np.linalg.eig(A)
    left, parts = np.linalg.inv(right), core.sizes.parts
    s = np.log(values.astype(complex)) / core.sampling_period_s
    number = 0
    for index in np.argsort(np.abs(s)).tolist():
        is_real = abs(values[index].imag) <= _REAL * abs(values[index])
        if (values[index].imag < 0 and not is_real) or (is_real and values[index].real <= 0):
            continue
        number += 1
        local = np.zeros(core.sizes.n_local, complex)
        local[parts[0]] = np.outer(left[index], right[:, index]).ravel()
        moves = np.outer(core.basis.values(point)[0], local).ravel() / (values[index] * core.sampling_period_s)
        yield from _described(f"{place}.pole{number}", complex(s[index]), moves, is_real=is_real)


def _described(name: str, s: complex, moves: ComplexArray, *, is_real: bool) -> Iterator[_Row]:
    """Describes a real pole by its rate, a pair by natural frequency and damping ratio."""
    size = abs(s)
    if is_real:
        yield _Row(name, "pole", "rad/s", -s.real, size, -moves.real)
        return
    along, damping = (np.conj(s) * moves).real / size, -s.real / size
    turned = -(moves.real + damping * along) / size
    yield _Row(f"{name}.frequency", "pole_frequency", "rad/s", size, size, along)
    yield _Row(f"{name}.damping", "pole_damping", "1", damping, max(abs(damping), _LEAST_DAMPING), turned)
