"""Mean motor torques against the torque with which the robot file's arm carries its weight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from robid.arrays import BoolArray, FloatArray
from robid.results.finding import Finding
from robid.results.plausible.evidence import Carrier, Evidence, Fitted
from robid.results.plausible.loads import BALANCE, LoadCause, finding_of, is_possible, load_causes
from robid.robot.description import Robot

_SIGMAS = 5.0
_LEAST_EFFECT = 0.03
"""Share of the mean torques' RMS that a cause must explain: masses in robot files are no better."""

_MASS_STD = 0.01
_UNKNOWN_FRICTION = 0.05  # of what a motor can give
_UNKNOWN_SHARE = 0.2  # of the largest torque that carries weight, where nobody says what it can give
_PRESLIDING_SHARE = 0.15
"""Share of its friction that a motor bears for long when it swings by its presliding; it falls with the square."""

_LEAST_FRICTION_SHARE = 0.05
_LEAST_TORQUE = 1e-9
_ROUNDS = 3
_FLIP_GAIN = 0.8
_FLIP_WIDTH = 0.3
_SWAP_GAIN = 0.9
_BALANCE_LEAVES = 0.1  # of what other causes leave together


@dataclass(frozen=True)
class GravityTorques:
    """Mean torques under gravity."""

    measured: FloatArray  # (n_conf, n_motor) Mean torques, true ones as far as their scale is known [N m]
    expected: FloatArray  # (n_conf, n_motor) The robot's [N m]
    root: FloatArray  # (n_motor, n_conf, n_conf) What whitens a motor's residual over configurations
    names: tuple[str, ...]  # The motors
    usable: BoolArray  # (n_motor,) Motors whose torque can be judged

    def whitened(self, torque: FloatArray) -> FloatArray:
        """Torques (..., n_conf, n_motor) over what they scatter by, as vectors."""
        white = np.einsum("mcd,...dm->...mc", self.root, torque)[..., self.usable, :]
        return np.asarray(white.reshape(*torque.shape[:-2], -1))


def weigh(robot: Robot, evidence: Evidence, usable: BoolArray, fitted: Fitted | None = None) -> GravityTorques | None:
    """Prepares the comparison of mean torques with gravity; None where there is nothing to compare.

    Friction holds a part of the weight, which depends on how the motor came to rest: all of the Coulomb level for a
    motor that sticks, hardly any for one that slides to and fro, alike in all configurations or not. What a fit found
    takes the place of the robot file, as far as it is known.
    """
    if evidence.mean_torque is None or evidence.torque_unit != "N m":
        return None
    motors = evidence.joints(robot)
    carrier = Carrier(robot, np.ones(len(robot.joints))) if fitted is None else fitted.found
    expected = carrier.holds(evidence.configurations, motors)
    usable = usable & (np.abs(expected).max(axis=0, initial=0.0) > _LEAST_TORQUE)
    if not usable.any():
        return None
    friction, root = _friction(robot, evidence, expected), np.zeros((len(usable), len(expected), len(expected)))
    unsure = np.zeros_like(root) if fitted is None else fitted.scatter(evidence.configurations, motors)
    for motor in range(len(usable)):
        own = friction[:, motor]
        scatter = np.diag(own**2 + (_MASS_STD * expected[:, motor]) ** 2) + np.outer(own, own)
        scatter += unsure[motor]
        root[motor] = np.linalg.inv(np.linalg.cholesky(scatter + _LEAST_TORQUE**2 * np.eye(len(own))))
    measured = evidence.mean_torque / carrier.torque_factor[motors]
    return GravityTorques(measured, expected, root, evidence.names, usable)


def gravity_signs(weights: GravityTorques) -> FloatArray:
    """Signs (n_motor,) of the torques as gravity shows them, 0 where it does not."""
    signs = np.zeros(len(weights.names))
    for motor in np.flatnonzero(weights.usable):
        g = weights.root[motor] @ weights.expected[:, motor]
        measured = weights.root[motor] @ weights.measured[:, motor]
        size = float(g @ g)
        slope, wrong = float(g @ measured) / size, [float(((measured - s * g) ** 2).sum()) for s in (1, -1)]
        for sign, own, other in ((1.0, *wrong), (-1.0, *wrong[::-1])):
            clear = other - own > _SIGMAS**2 * max(1.0, own / len(g)) and own < (1 - _FLIP_GAIN) * other
            if clear and abs(slope - sign) < (1.0 if sign > 0 else _FLIP_WIDTH):
                signs[motor] = sign
    return signs


def judge_places(weights: GravityTorques) -> Finding | None:
    """Finds other stated configurations that fit the mean torques far better than those of the logs do."""
    square = np.array([np.linalg.inv(root.T @ root).diagonal() for root in weights.root])[weights.usable].T
    away = (weights.measured[:, None] - weights.expected)[..., weights.usable]
    cost = (away**2 / square[:, None]).sum(axis=-1)
    _, order = linear_sum_assignment(cost)
    own, best = float(np.trace(cost)), float(cost[np.arange(len(order)), order].sum())
    if best > (1 - _SWAP_GAIN) * own or best > away[0].size * len(order) or own - best < _SIGMAS**2 * len(order):
        return None
    moved = ", of ".join(f"{log + 1} fits {place + 1}" for log, place in enumerate(order.tolist()) if log != place)
    told = f"the mean torques carry the weight of other configurations; the log of configuration {moved}"
    return Finding("configurations", told, decisive=True, strength=float(np.sqrt((own - best) / len(order))) / _SIGMAS)


def judge_gravity(
    robot: Robot, evidence: Evidence, weights: GravityTorques, torque_sign: FloatArray
) -> tuple[Finding, ...]:
    """Finds what explains mean torques that are not gravity's: payload, torque constant, masses, counterbalance.

    The causes compete: the one that explains most is taken, then what is left is explained again. A counterbalance,
    which can do what many of them do, is taken only where it comes first and leaves a tenth of what they leave.

    Args:
        robot: The robot file's.
        evidence: What the campaign shows.
        weights: From `weigh`.
        torque_sign (n_motor,): -1 where a torque is known to be reversed.
    """
    weights = replace(weights, measured=weights.measured * torque_sign)
    left = weights.whitened(weights.measured - weights.expected)
    if left @ left < _SIGMAS**2:
        return ()
    motors = evidence.joints(robot)
    causes = load_causes(robot, evidence.configurations, motors, weights.expected, weights.usable)
    common = [cause for cause in causes if cause.kind != BALANCE]
    found = _compete(robot, weights, common)
    balances = [_compete(robot, weights, common, cause) for cause in causes if cause.kind == BALANCE]
    best = min(balances, key=lambda each: each.rest, default=found)
    if best.rest < _BALANCE_LEAVES * found.rest and found.rest - best.rest > _SIGMAS**2:
        found = best
    return found.findings or _unexplained(weights, float(left @ left) / left.size)


@dataclass(frozen=True)
class _Explained:
    """Findings that explain mean torques together, and the squares that they leave."""

    findings: tuple[Finding, ...]
    rest: float


def _compete(
    robot: Robot, weights: GravityTorques, causes: Sequence[LoadCause], first: LoadCause | None = None
) -> _Explained:
    """Takes the cause that explains most, one after the other, all after the first where that is given."""
    white, findings = weights.whitened, []
    left = white(weights.measured - weights.expected)
    chosen: list[LoadCause] = []
    explained, remains = 0.0, float(left @ left)
    for number in range(_ROUNDS):
        likely = [first] if first is not None and number == 0 else [each for each in causes if each not in chosen]
        tried = [(*_explained(left, [*chosen, cause], white), cause) for cause in likely]
        tried = [one for one in tried if is_possible(robot, one[-1], one[1])]
        if not tried:
            break
        gain, values, rest, cause = max(tried, key=lambda one: one[0])
        scale = max(1.0, rest / max(left.size - len(values), 1))
        sigmas = float(np.sqrt(max(gain - explained, 0.0) / scale))
        own = values[-len(cause.columns) :]
        if sigmas < _SIGMAS or _effect(weights, cause, own) < _LEAST_EFFECT:
            break
        explained, remains = gain, rest
        chosen.append(cause)
        findings.append(finding_of(robot, cause, own, sigmas / _SIGMAS, len(weights.expected)))
    return _Explained(tuple(findings), remains)


def _unexplained(weights: GravityTorques, square: float) -> tuple[Finding, ...]:
    """What to say where no single cause explains mean torques that are not gravity's."""
    if square < _SIGMAS**2:
        return ()
    away = np.where(weights.usable, np.abs(weights.measured - weights.expected), 0.0)
    place, motor = np.unravel_index(int(np.argmax(away)), away.shape)
    told = f"mean torques are not gravity's, by up to {away[place, motor]:.3g} N m ({weights.names[motor]})"
    return (Finding("masses", told, decisive=False, strength=float(np.sqrt(square)) / _SIGMAS),)


def _effect(weights: GravityTorques, cause: LoadCause, values: FloatArray) -> float:
    """Largest change of a motor's mean torque over its usual size, both RMS."""
    change = np.einsum("k,kcm->cm", values, cause.columns)[:, weights.usable]
    usual = np.sqrt((weights.expected[:, weights.usable] ** 2).mean(axis=0))
    return float((np.sqrt((change**2).mean(axis=0)) / usual).max())


def _friction(robot: Robot, evidence: Evidence, expected: FloatArray) -> FloatArray:
    """How much of a mean torque friction may hold (n_conf, n_motor), standard deviation [N m]."""
    motors = [robot.joints[index].motor for index in evidence.joints(robot)]
    laws = [motor.friction for motor in motors]
    stated = [max(law.coulomb_nm, law.static_nm) * (1 + law.relative_std) for law in laws]
    limits = np.array([motor.max_torque_nm for motor in motors])
    likely = np.where(np.isfinite(limits), _UNKNOWN_FRICTION * limits, _UNKNOWN_SHARE * np.abs(expected).max(axis=0))
    level = np.where(np.array(stated) > 0, stated, likely)
    if evidence.motion_rms is None:
        return np.asarray(np.broadcast_to(level, (len(evidence.configurations), len(motors))))
    presliding = np.array([law.presliding_rad for law in laws])
    swings = np.maximum(evidence.motion_rms / presliding, np.finfo(float).tiny)
    return np.asarray(level * np.clip(_PRESLIDING_SHARE / swings**2, _LEAST_FRICTION_SHARE, 1.0))


def _explained(
    left: FloatArray, causes: list[LoadCause], white: Callable[[FloatArray], FloatArray]
) -> tuple[float, FloatArray, float]:
    """Squares that causes explain together, their values, and what is left."""
    matrix = white(np.concatenate([cause.columns for cause in causes])).T
    values = np.linalg.lstsq(matrix, left, rcond=None)[0]
    rest = left - matrix @ values
    return float(left @ left - rest @ rest), values, float(rest @ rest)
