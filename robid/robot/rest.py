"""Springs under load: rest deflections, expected slopes, and how both move with the parameters."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray

_NEWTON_STEPS = 60
_NEWTON_TOLERANCE = 1e-13


@dataclass(frozen=True)
class MatrixSlopes:
    """First derivatives of the linearised matrices along some moves."""

    mass: FloatArray  # (n_conf, n_move, n, n) Of the whole inertia matrix
    gravity_stiffness: FloatArray  # (n_conf, n_move, n, n) Of the symmetrised gradient of gravity
    output: FloatArray  # (n_conf, n_move, n_out, n) Of the outputs
    tilt: FloatArray  # (n_conf, n_move, n_out, n) Of gravity's part of the outputs


@dataclass(frozen=True)
class Moves(MatrixSlopes):
    """Derivatives along the spring deflections, then along spring locations."""

    # (n_conf, n_location, n_spring) Of gravity's torque on the springs, deflections held, along locations
    torque: FloatArray
    located: IntArray  # (n_location,) Which elements of the flattened locations these are


@dataclass(frozen=True)
class Rest:
    """Where the springs rest and what they carry, around which everything is expanded."""

    deflection: FloatArray  # (n_conf, n_spring) Spring deflections at rest [rad]
    torque: FloatArray  # (n_conf, n_spring) Torque of gravity on each deflection there [N m]
    gradient: FloatArray  # (n_conf, n_spring, n_spring) Its derivative with respect to the deflections [N m/rad]
    location: FloatArray  # (3 n_spring,) Locations of the springs, in their joints' frames [m]
    power: FloatArray  # (n_conf, n_line, n_spring) Mean square torque of the excitation through each spring [(N m)^2]
    omega: FloatArray  # (n_line,) Angular frequencies of these [rad/s]
    # (n_conf, n_spring) The swing's effect on the slope over that of a normal signal: `E[x^4] / (3 E[x^2]^2)`, less
    # what mixes back from lines that are not excited
    shape: FloatArray
    factor: FloatArray  # (n_conf, n_spring) What the joints' positions multiply the linear and cubic coefficients by
    moves: Moves | None = None  # How the linearised matrices move; None where they are taken as constant


@dataclass(frozen=True)
class Springs:
    """The springs of every configuration as the linear model sees them."""

    stiffness: FloatArray  # (n_conf, n_spring) Expected slopes [N m/rad]
    deflection: FloatArray  # (n_conf, n_spring) Mean deflections [rad]
    displacement: FloatArray  # (n_conf, n_move) Distance from where `Moves` was taken [rad, m]; n_move is 0 without it


@dataclass(frozen=True)
class SpringValues:
    """The parameters that decide where springs rest."""

    stiffness: FloatArray  # (n_spring,) or (n_conf, n_spring) Linear coefficients [N m/rad]
    cubic: FloatArray  # (n_spring,) or (n_conf, n_spring) Cubic coefficients [N m/rad^3]
    damping: FloatArray  # (n_spring,) Dampings [N m s/rad]
    location: FloatArray  # (3 n_spring,) Locations [m]


@dataclass(frozen=True)
class SpringSlopes:
    """Derivatives of `Springs` with respect to one kind of parameter."""

    stiffness: FloatArray  # (n_conf, n_spring, n_element) Of the expected slopes
    displacement: FloatArray  # (n_conf, n_move, n_element) Of the displacements


@dataclass(frozen=True)
class Swing:
    """Mean square `v` of the deflections about their mean, with derivatives; (n_conf, n_spring) each."""

    variance: FloatArray  # The mean square [rad^2]
    by_stiffness: FloatArray  # Its derivative with respect to the expected slope
    by_damping: FloatArray  # Its derivative with respect to the damping


def settle_springs(rest: Rest, values: SpringValues) -> Springs:
    """Mean deflections and expected slopes under gravity and excitation; not finite where a spring gives way.

    A cubic spring `k1 d + k3 d^3` that swings by `x` about `d0` has the mean torque `k1 d0 + k3 (d0^3 + 3 d0 v)` with
    `v = E[x^2]`, and shows the slope of the regression of its torque on `x`: `k1 + 3 k3 (d0^2 + s v)`, where
    `s = E[x^4] / (3 v^2)` is 1 for a normal signal and less for one of low crest factor or few lines. The torque
    through it is measured, so `v` is its power over the squared dynamic stiffness of spring and damper. Gravity is
    linear about the rest that it was taken at.

    Source:
        docs/methods, sec. 1 (Linearisation), for signals that need not be normal.
    """
    values = _here(rest, values)
    deflection, shift = rest.deflection.copy(), _shift(rest, values)
    n = deflection.shape[1]
    # The unknowns: mean deflection, and expected slope over k1, which starts at that without swing.
    ratio = 1 + 3 * values.cubic / values.stiffness * deflection**2
    for _ in range(_NEWTON_STEPS):
        swing = swing_of(rest, values, ratio * values.stiffness)
        # Newton for both unknowns together: the swing depends on the slope, and the slope on the swing.
        residual, matrix = _equations(rest, values, deflection, ratio, swing, shift)
        if not (np.isfinite(matrix).all() and np.isfinite(residual).all()):
            break
        step = np.linalg.solve(matrix, residual[..., None])[..., 0]
        deflection, ratio = deflection - step[:, :n], ratio - step[:, n:]
        if _small(step[:, :n], deflection, 1e-6) and _small(step[:, n:], ratio, 1.0):
            if (ratio > 0).all():
                return _springs(rest, values, deflection, ratio)
            break
    lost = np.full_like(deflection, np.nan)
    return _springs(rest, values, lost, lost)


def spring_slopes(rest: Rest, values: SpringValues, springs: Springs) -> dict[str, SpringSlopes]:
    """Derivatives of the springs by kind: `stiffness`, `damping`, `cubic`, `location`."""
    values = _here(rest, values)
    d, k1 = springs.deflection, values.stiffness
    n = d.shape[1]
    ratio = springs.stiffness / k1
    swing = swing_of(rest, values, springs.stiffness)
    # Implicit function theorem: d(unknowns) = -(Jacobian)^-1 d(residuals) by each parameter.
    matrix = _equations(rest, values, d, ratio, swing, _shift(rest, values))[1]
    right = _parameter_columns(rest, values, d, ratio, swing)
    slopes = {}
    for kind, (force, own) in right.items():
        moved = -np.linalg.solve(matrix, np.concatenate([force, own], axis=1))
        if kind in ("stiffness", "cubic"):
            moved = moved * rest.factor[:, None]
        stiffness = k1[..., None] * moved[:, n:]
        if kind == "stiffness":
            # k = k1 ratio: the product's own derivative by k1 comes besides.
            stiffness = stiffness + _diagonal(rest.factor * ratio)
        slopes[kind] = SpringSlopes(stiffness, _displacement_slopes(rest, moved[:, :n], kind))
    return slopes


def _parameter_columns(
    rest: Rest, values: SpringValues, d: FloatArray, ratio: FloatArray, swing: Swing
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Derivatives (n_conf, n, n_element) of both of the `_equations`' residuals by each kind of parameter."""
    k1, k3 = values.stiffness, values.cubic
    torque = np.zeros((*d.shape, values.location.size))
    if rest.moves is not None:
        torque[:, :, rest.moves.located] = np.swapaxes(rest.moves.torque, 1, 2)
    mean_square = d**2 + rest.shape * swing.variance
    return {
        # The ratio's own equation holds `k1` below the cubic coefficient and in the slope that it stands for.
        "stiffness": (
            _diagonal(d + 3 * k3 * d * swing.by_stiffness * ratio),
            _diagonal(3 * k3 / k1**2 * mean_square - 3 * k3 / k1 * rest.shape * swing.by_stiffness * ratio),
        ),
        "cubic": (_diagonal(d**3 + 3 * swing.variance * d), _diagonal(-3 / k1 * mean_square)),
        "damping": (_diagonal(3 * k3 * d * swing.by_damping), _diagonal(-3 * k3 / k1 * rest.shape * swing.by_damping)),
        "location": (torque, np.zeros_like(torque)),
    }


def swing_of(rest: Rest, values: SpringValues, stiffness: FloatArray) -> Swing:
    """How far springs of some expected slope (n_conf, n_spring) swing under the power that goes through them."""
    square = rest.omega[:, None] ** 2
    # |k + j w d|^2 turns the power of the torque into that of the deflection.
    dynamic = stiffness[:, None] ** 2 + square * values.damping**2
    lines = rest.power / dynamic
    # d(P / |Z|^2) / d(k) = -2 k P / |Z|^4, and likewise by the damper with w^2 d.
    by_dynamic = -2 * lines / dynamic
    by_damping = (square * by_dynamic).sum(axis=1) * values.damping
    return Swing(lines.sum(axis=1), stiffness * by_dynamic.sum(axis=1), by_damping)


def _here(rest: Rest, values: SpringValues) -> SpringValues:
    """Returns the coefficients (n_conf, n_spring) in each configuration."""
    return replace(values, stiffness=rest.factor * values.stiffness, cubic=rest.factor * values.cubic)


def _springs(rest: Rest, values: SpringValues, deflection: FloatArray, ratio: FloatArray) -> Springs:
    displacement = np.zeros((len(deflection), 0))
    if rest.moves is not None:
        located = (values.location - rest.location)[rest.moves.located]
        across = np.broadcast_to(located, (len(deflection), located.size))
        displacement = np.concatenate([deflection - rest.deflection, across], axis=1)
    return Springs(values.stiffness * ratio, deflection, displacement)


def _displacement_slopes(rest: Rest, deflection: FloatArray, kind: str) -> FloatArray:
    if rest.moves is None:
        return np.zeros((len(deflection), 0, deflection.shape[2]))
    own = np.zeros((len(deflection), rest.moves.located.size, deflection.shape[2]))
    if kind == "location":
        own[:, np.arange(rest.moves.located.size), rest.moves.located] = 1.0
    return np.concatenate([deflection, own], axis=1)


def _shift(rest: Rest, values: SpringValues) -> FloatArray:
    """Gravity's torque (n_conf, n_spring) that changed because springs sit elsewhere."""
    if rest.moves is None:
        return np.zeros_like(rest.torque)
    located = (values.location - rest.location)[rest.moves.located]
    # To first order in where the springs sit.
    return np.asarray(np.einsum("l,cls->cs", located, rest.moves.torque))


def _equations(
    rest: Rest, values: SpringValues, deflection: FloatArray, ratio: FloatArray, swing: Swing, shift: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Residuals (n_conf, 2 n) of mean torque and of slope over linear stiffness, and their derivative."""
    k1, k3, d = values.stiffness, values.cubic, deflection
    moved = np.einsum("cst,ct->cs", rest.gradient, d - rest.deflection)
    # E[tau] = k1 d + k3 (d^3 + 3 d v), in balance with gravity linearised about the rest.
    torque = k1 * d + k3 * d * (d**2 + 3 * swing.variance) + rest.torque + shift + moved
    # Slope over k1: 1 + 3 k3 / k1 (d^2 + s v), s for signals that are not normal.
    slope = ratio - 1 - 3 * k3 / k1 * (d**2 + rest.shape * swing.variance)
    matrix = np.block(
        [
            [
                _diagonal(k1 + 3 * k3 * (d**2 + swing.variance)) + rest.gradient,
                _diagonal(3 * k3 * d * k1 * swing.by_stiffness),
            ],
            [_diagonal(-6 * k3 / k1 * d), _diagonal(1 - 3 * k3 * rest.shape * swing.by_stiffness)],
        ]
    )
    return np.concatenate([torque, slope], axis=1), matrix


def _diagonal(values: FloatArray) -> FloatArray:
    return np.asarray(values[:, :, None] * np.eye(values.shape[1]))


def _small(step: FloatArray, size: FloatArray, least: float) -> bool:
    return bool(np.abs(step).max() <= _NEWTON_TOLERANCE * max(float(np.abs(size).max()), least))
