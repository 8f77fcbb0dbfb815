"""Springs under load: rest deflections, expected slopes, and how both move with the parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray, IntArray

_NEWTON_STEPS = 60
_NEWTON_TOLERANCE = 1e-13


@dataclass(frozen=True)
class Moves:
    """First derivatives of the linearised matrices along the spring deflections, then along spring locations.

    Attributes:
        mass (n_conf, n_move, n, n): Of the whole inertia matrix.
        gravity_stiffness (n_conf, n_move, n, n): Of the symmetrised gradient of gravity.
        output (n_conf, n_move, n_out, n): Of the outputs.
        tilt (n_conf, n_move, n_out, n): Of gravity's part of the outputs.
        torque (n_conf, n_location, n_spring): Of gravity's torque on the springs, deflections held, along locations.
        located (n_location,): Which elements of the flattened locations these are.
    """

    mass: FloatArray
    gravity_stiffness: FloatArray
    output: FloatArray
    tilt: FloatArray
    torque: FloatArray
    located: IntArray


@dataclass(frozen=True)
class Rest:
    """Where the springs rest and what they carry, around which everything is expanded.

    Attributes:
        deflection (n_conf, n_spring): Spring deflections at rest [rad].
        torque (n_conf, n_spring): Torque of gravity on each deflection there [N m].
        gradient (n_conf, n_spring, n_spring): Its derivative with respect to the deflections [N m/rad].
        location (3 n_spring,): Locations of the springs, in their joints' frames [m].
        power (n_conf, n_line, n_spring): Mean square torque that the excitation sends through each spring [(N m)^2].
        omega (n_line,): Angular frequencies of these [rad/s].
        moves: How the linearised matrices move; None where they are taken as constant.
    """

    deflection: FloatArray
    torque: FloatArray
    gradient: FloatArray
    location: FloatArray
    power: FloatArray
    omega: FloatArray
    moves: Moves | None = None


@dataclass(frozen=True)
class Springs:
    """The springs of every configuration as the linear model sees them.

    Attributes:
        stiffness (n_conf, n_spring): Expected slopes [N m/rad].
        deflection (n_conf, n_spring): Mean deflections [rad].
        variance (n_conf, n_spring): Mean square deflections about them [rad^2].
        displacement (n_conf, n_move): Distance from where `Moves` was taken [rad, m]; n_move is 0 without it.
    """

    stiffness: FloatArray
    deflection: FloatArray
    variance: FloatArray
    displacement: FloatArray


@dataclass(frozen=True)
class SpringValues:
    """The parameters that decide where springs rest.

    Attributes:
        stiffness (n_spring,): Linear coefficients [N m/rad].
        cubic (n_spring,): Cubic coefficients [N m/rad^3].
        damping (n_spring,): Dampings [N m s/rad].
        location (3 n_spring,): Locations [m].
    """

    stiffness: FloatArray
    cubic: FloatArray
    damping: FloatArray
    location: FloatArray


@dataclass(frozen=True)
class SpringSlopes:
    """Derivatives of `Springs` with respect to one kind of parameter.

    Attributes:
        stiffness (n_conf, n_spring, n_element): Of the expected slopes.
        displacement (n_conf, n_move, n_element): Of the displacements.
    """

    stiffness: FloatArray
    displacement: FloatArray


def settle_springs(rest: Rest, values: SpringValues) -> Springs:
    """Finds mean deflections and expected slopes under gravity and excitation.

    A cubic spring `k1 d + k3 d^3` that swings about `d0` with the mean square `v` shows the slope
    `k1 + 3 k3 (d0^2 + v)` and the mean torque `k1 d0 + k3 (d0^3 + 3 d0 v)`. The torque through it is measured, so `v`
    is that torque's power over the squared dynamic stiffness of spring and damper. Gravity is linear about the rest
    that it was taken at.

    Args:
        rest: What the springs carry.
        values: Parameter values.

    Returns:
        The springs; not finite where a softening one gives way.

    Source:
        METHODS sec. 1 (Linearisation); the describing function of a cubic for a normal signal.
    """
    deflection, shift = rest.deflection.copy(), _shift(rest, values)
    n = deflection.shape[1]
    variance = np.zeros_like(deflection)
    for _ in range(_NEWTON_STEPS):
        force, spread, matrix = _equations(rest, values, deflection, variance, shift)
        with np.errstate(all="ignore"):
            finite = np.isfinite(matrix).all() and np.isfinite(force).all() and np.isfinite(spread).all()
        if not finite:
            break
        step = np.linalg.solve(matrix, np.concatenate([force, spread], axis=1)[..., None])[..., 0]
        deflection, variance = deflection - step[:, :n], variance - step[:, n:]
        if _small(step[:, :n], deflection, 1e-6) and _small(step[:, n:], variance, 1e-12):
            found = _springs(rest, values, deflection, variance)
            if (found.stiffness > 0).all():
                return found
            break
    lost = np.full_like(deflection, np.nan)
    return _springs(rest, values, lost, lost)


def spring_slopes(rest: Rest, values: SpringValues, springs: Springs) -> dict[str, SpringSlopes]:
    """Derivatives of the springs by kind: `stiffness`, `damping`, `cubic`, `location`.

    Args:
        rest: What the springs carry.
        values: Parameter values.
        springs: What `settle_springs` found for them.
    """
    d, v, k = springs.deflection, springs.variance, springs.stiffness
    n_conf, n = d.shape
    matrix = _equations(rest, values, d, v, _shift(rest, values))[2]
    spread, rate = _spread_slopes(rest, values, k)
    mean_square = d**2 + v
    n_location = values.location.size
    torque = np.zeros((n_conf, n, n_location))
    if rest.moves is not None:
        torque[:, :, rest.moves.located] = np.swapaxes(rest.moves.torque, 1, 2)
    none = np.zeros((n_conf, n, n))
    right = {
        "stiffness": (_diagonal(d), _diagonal(spread), _diagonal(np.ones_like(d))),
        "cubic": (_diagonal(d**3 + 3 * v * d), _diagonal(spread * 3 * mean_square), _diagonal(3 * mean_square)),
        "damping": (none, _diagonal(rate), none),
        "location": (torque, np.zeros_like(torque), np.zeros_like(torque)),
    }
    slopes = {}
    for kind, (force, variance, direct) in right.items():
        moved = -np.linalg.solve(matrix, np.concatenate([force, variance], axis=1))
        by_load = 3 * values.cubic[:, None] * (2 * d[..., None] * moved[:, :n] + moved[:, n:])
        slopes[kind] = SpringSlopes(direct + by_load, _displacement_slopes(rest, moved[:, :n], kind))
    return slopes


def _springs(rest: Rest, values: SpringValues, deflection: FloatArray, variance: FloatArray) -> Springs:
    displacement = np.zeros((len(deflection), 0))
    if rest.moves is not None:
        located = (values.location - rest.location)[rest.moves.located]
        across = np.broadcast_to(located, (len(deflection), located.size))
        displacement = np.concatenate([deflection - rest.deflection, across], axis=1)
    stiffness = values.stiffness + 3 * values.cubic * (deflection**2 + variance)
    return Springs(stiffness, deflection, variance, displacement)


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
    return np.asarray(np.einsum("l,cls->cs", located, rest.moves.torque))


def _equations(
    rest: Rest, values: SpringValues, deflection: FloatArray, variance: FloatArray, shift: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Residuals of mean torque and mean square deflection, and their derivative (n_conf, 2 n, 2 n)."""
    cubic = values.cubic
    slope = values.stiffness + 3 * cubic * (deflection**2 + variance)
    moved = np.einsum("cst,ct->cs", rest.gradient, deflection - rest.deflection)
    own = values.stiffness * deflection + cubic * deflection * (deflection**2 + 3 * variance)
    dynamic = slope[:, None] ** 2 + (rest.omega[:, None] * values.damping) ** 2
    spread, _ = _spread_slopes(rest, values, slope)
    matrix = np.block(
        [
            [_diagonal(slope) + rest.gradient, _diagonal(3 * cubic * deflection)],
            [_diagonal(spread * 6 * cubic * deflection), _diagonal(1 + spread * 3 * cubic)],
        ]
    )
    return own + rest.torque + shift + moved, variance - (rest.power / dynamic).sum(axis=1), matrix


def _spread_slopes(rest: Rest, values: SpringValues, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Derivatives (n_conf, n_spring) of minus the mean square deflection with respect to slope and damping."""
    square = rest.omega[:, None] ** 2
    weighted = rest.power / (slope[:, None] ** 2 + square * values.damping**2) ** 2
    return 2 * slope * weighted.sum(axis=1), 2 * values.damping * (square * weighted).sum(axis=1)


def _diagonal(values: FloatArray) -> FloatArray:
    return np.asarray(values[:, :, None] * np.eye(values.shape[1]))


def _small(step: FloatArray, size: FloatArray, least: float) -> bool:
    return bool(np.abs(step).max() <= _NEWTON_TOLERANCE * max(float(np.abs(size).max()), least))
