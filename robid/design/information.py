"""D-optimal choice of configurations from their information matrices, with a certificate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray, check_shape
from robid.design.options import DesignOptions
from robid.errors import DataError, SettingsError

_UNSEEN = 1e-12
"""Smallest eigenvalue of the scaled total information, relative to the largest, that counts as seen."""


@dataclass(frozen=True)
class ConfigurationDesign:
    """The chosen configurations with what they promise.

    Attributes:
        weights (n_conf,): Relaxed D-optimal weights of the candidates, sum 1.
        chosen (count,): Indices of the chosen candidates, rising; equal effort each.
        gap: Certificate of the weights, `max_i tr(M^-1 H_i) - n`, 0 at the optimum.
        efficiency: D-efficiency of the chosen candidates against the certified bound on the optimum, 0 to 1; what
            is missing is also the price of few configurations with equal effort.
        information (n_conf, n_param, n_param): Information of each candidate about the log-parameters.
        predicted_relative_std (n_param,): Relative standard deviations that the chosen candidates promise together.
        parameter_names: Names of the parameters.
        configurations (n_conf, n_joint): The candidates' arm-side joint angles [rad].
    """

    weights: FloatArray
    chosen: IntArray
    gap: float
    efficiency: float
    information: FloatArray
    predicted_relative_std: FloatArray
    parameter_names: tuple[str, ...]
    configurations: FloatArray


def information(jacobian: FloatArray | ComplexArray, variance: FloatArray) -> FloatArray:
    """Sums the information of independent residuals per candidate.

    Args:
        jacobian (n_conf, ..., n_param): Derivative of each residual with respect to the log-parameters.
        variance: Variance of each residual, `E|r|^2` for circular complex ones; broadcast to (n_conf, ...).

    Returns:
        Information (n_conf, n_param, n_param): `J' V^-1 J` for real, `2 Re(J^H V^-1 J)` for complex residuals.

    Source:
        Zimmermann et al. (2023), eq. 4.
    """
    scaled = jacobian / np.sqrt(np.broadcast_to(variance, jacobian.shape[:-1]))[..., None]
    rows = scaled.reshape(len(scaled), -1, scaled.shape[-1])
    if np.iscomplexobj(rows):
        rows = np.sqrt(2) * np.concatenate([rows.real, rows.imag], axis=1)
    return np.asarray(rows.swapaxes(1, 2) @ rows)


def design_configurations(
    matrices: FloatArray, configurations: FloatArray, parameter_names: tuple[str, ...], options: DesignOptions
) -> ConfigurationDesign:
    """Chooses configurations by D-optimality.

    Args:
        matrices (n_conf, n_param, n_param): Information of each candidate about the log-parameters.
        configurations (n_conf, n_joint): The candidates' arm-side joint angles [rad].
        parameter_names: Names of the parameters.
        options: Number of configurations, iteration limit and gap.

    Raises:
        SettingsError: If there are fewer candidates than configurations to choose.
        DataError: If all candidates together, or the best `count` of them, leave a combination of parameters unseen.

    Source:
        METHODS sec. 6; Zimmermann et al. (2023), eq. 5-6.
    """
    n_conf, n_param = len(configurations), len(parameter_names)
    check_shape("matrices", matrices, "n_conf n_param n_param", n_conf=n_conf, n_param=n_param)
    if options.count > n_conf:
        raise SettingsError(
            f"{options.count} configurations cannot be chosen from {n_conf} candidates.",
            where="design.count",
            remedy="Lower count, or give the campaign more candidates.",
        )
    scale = _checked_scale(matrices.mean(axis=0), parameter_names)
    scaled = matrices / (scale[:, None] * scale)
    weights, gap = relaxed_design(scaled, iterations=options.iterations, gap=options.gap)
    chosen = choose(scaled, options.count, weights)
    total = scaled[chosen].sum(axis=0)
    _checked_scale(total, parameter_names, count=options.count)
    relaxed = np.einsum("i,ijk->jk", weights, scaled)
    ratio = np.exp((np.linalg.slogdet(total / options.count)[1] - np.linalg.slogdet(relaxed)[1]) / n_param)
    return ConfigurationDesign(
        weights=weights,
        chosen=chosen,
        gap=gap,
        efficiency=float(ratio * n_param / (n_param + gap)),
        information=matrices,
        predicted_relative_std=np.sqrt(np.diag(np.linalg.inv(total))) / scale,
        parameter_names=parameter_names,
        configurations=configurations,
    )


def relaxed_design(matrices: FloatArray, *, iterations: int, gap: float) -> tuple[FloatArray, float]:
    """Maximises `log det(sum_i w_i H_i)` over weights on the simplex by multiplicative updates.

    Args:
        matrices (n_conf, n_param, n_param): Information of each candidate; their sum is regular.
        iterations: Limit on the updates.
        gap: Relative gap `max_i tr(M^-1 H_i)/n - 1` at which they stop.

    Returns:
        Weights (n_conf,) and the certificate `max_i tr(M^-1 H_i) - n`: by the equivalence theorem it is 0 at the
        optimum, and the D-efficiency of the weights is at least `n / (n + certificate)`.

    Source:
        Multiplicative algorithm: Silvey, Titterington and Torsney (1978); bound: Atwood (1969).
    """
    n_conf, n_param = matrices.shape[:2]
    flat = matrices.reshape(n_conf, -1)
    weights = np.full(n_conf, 1 / n_conf)
    for iteration in range(iterations + 1):
        inverse = np.linalg.inv((weights @ flat).reshape(n_param, n_param))
        traces = flat @ inverse.ravel()
        certificate = float(traces.max()) - n_param
        if certificate <= gap * n_param or iteration == iterations:
            break
        weights = weights * traces / n_param
        weights /= weights.sum()
    return weights, max(certificate, 0.0)


def choose(matrices: FloatArray, count: int, weights: FloatArray) -> IntArray:
    """Chooses distinct candidates of equal effort: greedily, then by exchange while the determinant grows.

    Exchange starts from the greedy choice and from the largest relaxed weights; the better end wins.

    Args:
        matrices (n_conf, n_param, n_param): Information of each candidate.
        count: Number of candidates to choose.
        weights (n_conf,): Relaxed weights.

    Returns:
        Indices (count,), rising.
    """
    # A trace of the relaxed information keeps the determinant of few candidates finite.
    floor = 1e-9 * np.einsum("i,ijk->jk", weights, matrices)
    starts = [_greedy(matrices, count, floor), np.argsort(-weights, kind="stable")[:count]]
    ends = [_exchange(matrices, start, floor) for start in starts]
    values = [_log_determinant(matrices[end].sum(axis=0) + floor) for end in ends]
    return np.sort(ends[int(np.argmax(values))])


def _greedy(matrices: FloatArray, count: int, floor: FloatArray) -> IntArray:
    chosen: list[int] = []
    total = floor
    for _ in range(count):
        values = _log_determinant(total + matrices)
        values[chosen] = -np.inf
        chosen.append(int(np.argmax(values)))
        total = total + matrices[chosen[-1]]
    return np.array(chosen)


def _exchange(matrices: FloatArray, start: IntArray, floor: FloatArray) -> IntArray:
    """Replaces one candidate at a time by the best other one until nothing gains."""
    chosen = start.copy()
    total = matrices[chosen].sum(axis=0) + floor
    current = float(_log_determinant(total))
    improved = True
    while improved:
        improved = False
        for position in range(len(chosen)):
            without = total - matrices[chosen[position]]
            values = _log_determinant(without + matrices)
            values[chosen] = -np.inf
            best = int(np.argmax(values))
            if values[best] > current + 1e-10:
                chosen[position] = best
                total = matrices[chosen].sum(axis=0) + floor
                current = float(_log_determinant(total))
                improved = True
    return chosen


def _log_determinant(matrices: FloatArray) -> FloatArray:
    sign, value = np.linalg.slogdet(matrices)
    return np.asarray(np.where(sign > 0, value, -np.inf))


def _checked_scale(total: FloatArray, names: tuple[str, ...], count: int | None = None) -> FloatArray:
    """Returns the root of the diagonal, or names the combinations of parameters that a total does not see."""
    by = "the candidates" if count is None else f"the best {count} configurations"
    diagonal = np.diag(total)
    finite = bool(np.all(np.isfinite(total)))
    unseen = [name for name, value in zip(names, diagonal, strict=True) if not value > 0] if finite else []
    if finite and not unseen:
        scale = np.sqrt(diagonal)
        values, vectors = np.linalg.eigh(total / (scale[:, None] * scale))
        unseen = [_combination(vector / scale, names) for vector in vectors.T[values <= _UNSEEN * values[-1]]]
        if not unseen:
            return np.asarray(scale)
    raise DataError(
        f"The responses of {by} do not depend on: {'; '.join(unseen)}."
        if finite
        else f"The information of {by} is not finite.",
        where="design",
        remedy="Fix or tie one of the named parameters in each combination, or offer configurations that excite it."
        if count is None
        else "Raise count.",
    )


def _combination(vector: FloatArray, names: tuple[str, ...]) -> str:
    """Writes a direction in log-parameters with its larger terms."""
    scaled = vector / vector[np.argmax(np.abs(vector))]
    order = [index for index in np.argsort(-np.abs(scaled), kind="stable") if abs(scaled[index]) > 0.05]
    return " ".join(f"{scaled[index]:+.2g} log({names[index]})" for index in order)
