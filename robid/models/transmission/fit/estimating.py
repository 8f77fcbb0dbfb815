"""The most probable parameters of a gear, how far they may be off, and what each motion says by itself."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import chi2

from robid.arrays import BoolArray, FloatArray
from robid.models.transmission.fit.gear import RISE, GearModel
from robid.models.transmission.fit.load import correlation_rows

_STEPS = 40
_HALVINGS = 8
_SMALL = 1e-3  # deviations
_LEAST = 1e-9  # rad: what no encoder shows
_BETWEEN = 0.25  # of the assumed model error, between motions of one robot
_POSITIVE = ("stiffening", "slip", "backlash")
_SLIP = 0.03  # of the largest torque: where hysteresis begins
_REACHES = (0.0, -1.0, -2.0, -3.0, -4.0, 1.0)  # from what is most probable, logarithms
_FIRST_STEPS = 5


@dataclass(frozen=True)
class GearEstimate:
    """What was found of a gear."""

    value: FloatArray  # (n_param,)
    covariance: FloatArray  # (n_param, n_param) Of all, the doubts of what loads the gear with them
    effective: FloatArray  # (n_param, n_param) Of what this robot's motions would agree on: these doubts left out
    measured: FloatArray  # (n_row,) Difference of the encoders, their lag taken out [rad, or m]
    model: FloatArray  # (n_row,)
    converged: bool
    motions: FloatArray  # (n_motion,) Logarithm of the stiffness that each motion gives by itself
    motions_std: FloatArray  # (n_motion,) Their deviations, without what they share
    agreement: float  # Probability of differences as large as theirs; 1 for a single motion
    between: float  # Deviation of the stiffness's logarithm between motions


def estimate_gear(model: GearModel) -> GearEstimate:
    """Estimates the parameters of a gear by Gauss-Newton steps; each motion weighs by what its residual is like."""
    free = model.std > 0
    value = _start(model, free)
    variance, converged = np.full(len(model.data.rows), np.nan), False
    point = model.predict(value)
    for step in range(_STEPS):
        if step < 5 or converged:
            variance = _variances(model, point)
        information, slope = _normal(model, value, point, variance, free)
        moved = _step(model, value, information, slope, free)
        value, point, size = _descend(model, value, point, variance, moved)
        done = size * np.sqrt(moved[free] @ information @ moved[free]) < _SMALL * np.sqrt(free.sum())
        if converged:
            break
        converged = bool(done and step >= 5)
    return _concluded(model, value, point, free, converged=converged)


def _start(model: GearModel, free: BoolArray) -> FloatArray:
    """Where the estimate begins (n_param,): at the reach of hysteresis that explains most of what it leaves without.

    Over a reach of another size hysteresis is of another shape, and a descent ends without any.
    """
    slip, reach = model.place("slip"), model.place("reach")
    value, rest = model.centre.copy(), free.copy()
    if not free[slip]:
        return value
    rest[[slip, reach]] = False
    point = model.predict(value)
    for _ in range(_FIRST_STEPS):
        variance = _variances(model, point)
        moved = _step(model, value, *_normal(model, value, point, variance, rest), rest)
        value, point, _ = _descend(model, value, point, variance, moved)
    variance, found = _variances(model, point), []
    for away in _REACHES:
        tried = value.copy()
        tried[slip], tried[reach] = _SLIP, model.centre[reach] + away
        point = model.predict(tried)
        information, slope = _normal(model, tried, point, variance, free)
        moved = _step(model, tried, information, slope, free)[free]
        cost = _cost(model, tried, point, variance) - (2 * slope - information @ moved) @ moved
        found.append((float(cost), tried))
    return min(found, key=lambda each: each[0])[1]


def _step(
    model: GearModel, value: FloatArray, information: FloatArray, slope: FloatArray, free: BoolArray
) -> FloatArray:
    """Gauss-Newton step (n_param,) that keeps stiffening of either kind, slip torque and backlash positive.

    What is at zero stays there, and the others follow.
    """
    moved = np.zeros(len(value))
    places, fixed = np.flatnonzero(free), np.zeros(int(free.sum()), bool)
    positive = [at for at, name in enumerate(model.names) if name in _POSITIVE or name.startswith(RISE)]
    for _ in range(1 + len(positive)):
        rest = ~fixed
        own = slope[rest] - information[np.ix_(rest, fixed)] @ moved[places[fixed]]
        moved[places[rest]] = np.linalg.solve(information[np.ix_(rest, rest)], own)
        below = np.isin(places, positive) & rest & (value[places] + moved[places] < 0)
        if not below.any():
            break
        fixed |= below
        moved[places[fixed]] = -value[places[fixed]]
    return moved


def _variances(model: GearModel, point: tuple[FloatArray, FloatArray, FloatArray], assumed: float = 1.0) -> FloatArray:
    """Variance of each motion's residual times the rows over which it is correlated (n_motion,).

    Beside the residual counts so much of the assumed model error.
    """
    left, share = point[0] - point[1], assumed * model.options.prior.model_error
    found = []
    for rows in model.data.rows:
        own, size = left[rows], float(np.std(point[0][rows]))
        found.append((np.mean(own**2) + (share * size) ** 2) * correlation_rows(own) + _LEAST**2)
    return np.array(found)


def _weights(model: GearModel, variance: FloatArray) -> FloatArray:
    found = np.empty(model.data.rows[-1].stop)
    for rows, own in zip(model.data.rows, variance.tolist(), strict=True):
        found[rows] = 1 / own
    return found


def _normal(
    model: GearModel,
    value: FloatArray,
    point: tuple[FloatArray, FloatArray, FloatArray],
    variance: FloatArray,
    free: BoolArray,
) -> tuple[FloatArray, FloatArray]:
    """Information (n_free, n_free) and slope (n_free,) of the data and of what is known beforehand."""
    weights, slopes = _weights(model, variance), point[2][:, free]
    precision = 1 / model.std[free] ** 2
    information = slopes.T @ (weights[:, None] * slopes) + np.diag(precision)
    slope = slopes.T @ (weights * (point[0] - point[1])) - precision * (value - model.centre)[free]
    return information, slope


def _cost(model: GearModel, value: FloatArray, point: tuple[FloatArray, ...], variance: FloatArray) -> float:
    free = model.std > 0
    away = (value - model.centre)[free] / model.std[free]
    return float(np.sum(_weights(model, variance) * (point[0] - point[1]) ** 2) + away @ away)


def _descend(
    model: GearModel,
    value: FloatArray,
    point: tuple[FloatArray, FloatArray, FloatArray],
    variance: FloatArray,
    moved: FloatArray,
) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray], float]:
    """Goes along a step as far as the cost falls; returns where that is and the share of the step."""
    before, size = _cost(model, value, point, variance), 1.0
    for _ in range(_HALVINGS):
        tried = value + size * moved
        there = model.predict(tried)
        if np.isfinite(there[1]).all() and _cost(model, tried, there, variance) <= before:
            return tried, there, size
        size *= 0.5
    return value, point, 0.0


def _concluded(
    model: GearModel,
    value: FloatArray,
    point: tuple[FloatArray, FloatArray, FloatArray],
    free: BoolArray,
    *,
    converged: bool,
) -> GearEstimate:
    variance = _variances(model, point)
    information, _ = _normal(model, value, point, variance, free)
    covariance, effective = np.zeros((len(value), len(value))), np.zeros((len(value), len(value)))
    covariance[np.ix_(free, free)] = np.linalg.inv(information)
    known = ~model.is_doubt[free]
    of_data = np.flatnonzero(free)[known]
    effective[np.ix_(of_data, of_data)] = np.linalg.inv(information[np.ix_(known, known)])
    motions, std = motion_by_motion(model, value, point)
    agreement, between = _agreement(motions, std)
    place = model.place("stiffness")
    spread = between**2 / len(motions)
    covariance[place, place] += spread
    effective[place, place] += spread
    return GearEstimate(
        value=value,
        covariance=covariance,
        effective=effective,
        measured=point[0],
        model=point[1],
        converged=converged,
        motions=motions,
        motions_std=std,
        agreement=agreement,
        between=between,
    )


def motion_by_motion(
    model: GearModel, value: FloatArray, point: tuple[FloatArray, FloatArray, FloatArray]
) -> tuple[FloatArray, FloatArray]:
    """Logarithm of the stiffness by each motion alone about some values (n_param,), and its deviation (n_motion,).

    What the law lacks is alike in similar motions: between them counts a part of the assumed model error.
    """
    variance = _variances(model, point, _BETWEEN)
    return _by_motion(model, value, point, variance, (model.std > 0) & ~model.is_doubt)


def _by_motion(
    model: GearModel,
    value: FloatArray,
    point: tuple[FloatArray, FloatArray, FloatArray],
    variance: FloatArray,
    free: BoolArray,
) -> tuple[FloatArray, FloatArray]:
    """Logarithm of the stiffness by each motion alone, and its deviation (n_motion,) each.

    One step from the estimate of all, with all else of the gear each motion's own but for what is known beforehand of
    it; deviations are those of the data alone, for what is known is the same for all.
    """
    names = np.array(model.names)[free]
    place = int(np.flatnonzero(names == "stiffness")[0])
    precision = 1 / model.std[free] ** 2
    precision[place] = 0.0
    found, std = [], []
    for rows, own in zip(model.data.rows, variance.tolist(), strict=True):
        slopes, left = point[2][rows][:, free], (point[0] - point[1])[rows]
        data = slopes.T @ slopes / own
        inverse = np.linalg.pinv(data + np.diag(precision), hermitian=True)
        step = inverse @ (slopes.T @ left / own - precision * (value - model.centre)[free])
        found.append(value[model.place("stiffness")] + step[place])
        std.append(np.sqrt(max((inverse @ data @ inverse)[place, place], np.finfo(float).tiny)))
    return np.array(found), np.array(std)


def _agreement(values: FloatArray, std: FloatArray) -> tuple[float, float]:
    """Probability of such differences between motions, and the deviation beyond them (DerSimonian and Laird)."""
    if len(values) < 2:
        return 1.0, 0.0
    weights = 1 / std**2
    mean = weights @ values / weights.sum()
    spread = float(weights @ (values - mean) ** 2)
    excess = spread - (len(values) - 1)
    size = weights.sum() - (weights**2).sum() / weights.sum()
    return float(chi2.sf(spread, len(values) - 1)), float(np.sqrt(max(excess, 0.0) / size))
