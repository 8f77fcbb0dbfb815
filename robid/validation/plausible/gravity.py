"""Mean motor torques against the torque with which the robot file's arm carries its weight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import linear_sum_assignment

from robid.arrays import BoolArray, FloatArray
from robid.robot.description import Joint, Robot
from robid.robot.linearize import gravity_torque, solve_statics
from robid.robot.model import build_model
from robid.validation.doubt import Doubt
from robid.validation.plausible.evidence import Evidence

_SIGMAS = 5.0
_GROSS_FACTOR = 0.2
_LEAST_EFFECT = 0.03
"""Share of the mean torques' RMS that a cause must explain: masses in robot files are no better."""

_MASS_STD = 0.01
_UNKNOWN_FRICTION = 0.05
_PRESLIDING_SHARE = 0.15
"""Share of its friction that a motor holds for long when it swings by its presliding; it falls with the square."""

_LEAST_FRICTION_SHARE = 0.05
_LEAST_TORQUE = 1e-9
_ROUNDS = 3
_FLIP_GAIN = 0.8
_FLIP_WIDTH = 0.3
_TILT_RAD = 0.01
_SWAP_GAIN = 0.9
_MOST_LEAN_RAD = float(np.deg2rad(15.0))
"""Beyond it gravity is no longer linear in how a base leans, and nobody mounts a robot so by mistake."""

_FELT = 0.05
_MOST_MASS = 2.0  # times a link's stated mass that a file leaves out


@dataclass(frozen=True)
class _Cause:
    """What may change the mean torques.

    Attributes:
        kind: Of `CAUSES`.
        name: Motor or link that it is about.
        columns (n_column, n_conf, n_motor): Change of the torque per unit of it [N m].
    """

    kind: str
    name: str
    columns: FloatArray


@dataclass(frozen=True)
class GravityTorques:
    """Mean torques under gravity.

    Attributes:
        measured (n_conf, n_motor): Mean torques [N m].
        expected (n_conf, n_motor): The robot file's [N m].
        root (n_motor, n_conf, n_conf): What whitens a motor's residual over configurations.
        names: The motors.
        usable (n_motor,): Motors whose torque can be judged.
    """

    measured: FloatArray
    expected: FloatArray
    root: FloatArray
    names: tuple[str, ...]
    usable: BoolArray

    def whitened(self, torque: FloatArray) -> FloatArray:
        """Torques (..., n_conf, n_motor) over what they scatter by, as vectors."""
        white = np.einsum("mcd,...dm->...mc", self.root, torque)[..., self.usable, :]
        return np.asarray(white.reshape(*torque.shape[:-2], -1))


def weigh(robot: Robot, evidence: Evidence, usable: BoolArray) -> GravityTorques | None:
    """Prepares the comparison of mean torques with gravity; None where there is nothing to compare.

    Friction holds a part of the weight, which depends on how the motor came to rest: all of the Coulomb level for a
    motor that sticks, hardly any for one that slides to and fro, alike in all configurations or not.
    """
    if evidence.mean_torque is None or evidence.torque_unit != "N m":
        return None
    model = build_model(robot)
    expected = solve_statics(model, evidence.configurations).motor_torque[:, evidence.joints(robot)]
    usable = usable & (np.abs(expected).max(axis=0, initial=0.0) > _LEAST_TORQUE)
    if not usable.any():
        return None
    friction = _friction(robot, evidence)
    root = np.zeros((len(usable), len(expected), len(expected)))
    for motor in range(len(usable)):
        own = friction[:, motor]
        scatter = np.diag(own**2 + (_MASS_STD * expected[:, motor]) ** 2) + np.outer(own, own)
        root[motor] = np.linalg.inv(np.linalg.cholesky(scatter + _LEAST_TORQUE**2 * np.eye(len(own))))
    return GravityTorques(evidence.mean_torque, expected, root, evidence.names, usable)


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


def judge_places(weights: GravityTorques) -> Doubt | None:
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
    return Doubt("configurations", told, decisive=True, strength=float(np.sqrt((own - best) / len(order))) / _SIGMAS)


def judge_gravity(
    robot: Robot, evidence: Evidence, weights: GravityTorques, torque_sign: FloatArray
) -> tuple[Doubt, ...]:
    """Finds what explains mean torques that are not gravity's: payload, a motor's torque constant, masses.

    The causes compete: the one that explains most is taken, then what is left is explained again.

    Args:
        robot: The robot file's.
        evidence: What the campaign shows.
        weights: From `weigh`.
        torque_sign (n_motor,): -1 where a torque is known to be reversed.
    """
    weights = replace(weights, measured=weights.measured * torque_sign)
    white = weights.whitened
    left = white(weights.measured - weights.expected)
    if left @ left < _SIGMAS**2:
        return ()
    causes, doubts = _causes(robot, evidence, weights), []
    chosen: list[_Cause] = []
    for _ in range(_ROUNDS):
        tried = [(*_explained(left, [*chosen, cause], white), cause) for cause in causes if cause not in chosen]
        tried = [one for one in tried if _possible(robot, one[-1], one[1])]
        if not tried:
            break
        gain, values, rest, cause = max(tried, key=lambda one: one[0])
        scale = max(1.0, rest / max(left.size - len(values), 1))
        before = _explained(left, chosen, white)[0] if chosen else 0.0
        sigmas = float(np.sqrt(max(gain - before, 0.0) / scale))
        own = values[-len(cause.columns) :]
        if sigmas < _SIGMAS or _effect(weights, cause, own) < _LEAST_EFFECT:
            break
        chosen.append(cause)
        doubts.append(_doubt(robot, cause, own, sigmas / _SIGMAS, len(weights.expected)))
    return tuple(doubts) or _unexplained(weights, float(left @ left) / left.size)


def _unexplained(weights: GravityTorques, square: float) -> tuple[Doubt, ...]:
    """What to say where no single cause explains mean torques that are not gravity's."""
    if square < _SIGMAS**2:
        return ()
    away = np.where(weights.usable, np.abs(weights.measured - weights.expected), 0.0)
    place, motor = np.unravel_index(int(np.argmax(away)), away.shape)
    told = f"mean torques are not gravity's, by up to {away[place, motor]:.3g} N m ({weights.names[motor]})"
    return (Doubt("masses", told, decisive=False, strength=float(np.sqrt(square)) / _SIGMAS),)


def _possible(robot: Robot, cause: _Cause, values: FloatArray) -> bool:
    """Whether a cause is as large as it may be: masses are not negative, nor a payload heavier than the arm."""
    own = values[-len(cause.columns) :]
    if cause.kind == "model":
        return float(np.linalg.norm(own)) <= _MOST_LEAN_RAD
    arm_kg = sum(joint.link.mass_kg for joint in robot.joints)
    limits = {"payload": (-robot.payload.mass_kg, max(arm_kg, robot.payload.mass_kg)), "masses": (-1.0, _MOST_MASS)}
    least, most = limits.get(cause.kind, (-np.inf, np.inf))
    return least <= float(own[0]) <= most


def _effect(weights: GravityTorques, cause: _Cause, values: FloatArray) -> float:
    """Largest change of a motor's mean torque over its usual size, both RMS."""
    change = np.einsum("k,kcm->cm", values, cause.columns)[:, weights.usable]
    usual = np.sqrt((weights.expected[:, weights.usable] ** 2).mean(axis=0))
    return float((np.sqrt((change**2).mean(axis=0)) / usual).max())


def _friction(robot: Robot, evidence: Evidence) -> FloatArray:
    """How much of a mean torque friction may hold (n_conf, n_motor), standard deviation [N m]."""
    motors = [robot.joints[index].motor for index in evidence.joints(robot)]
    laws = [motor.friction for motor in motors]
    stated = [max(law.coulomb_nm, law.static_nm) * (1 + law.relative_std) for law in laws]
    level = np.array([
        own or _UNKNOWN_FRICTION * motor.max_torque_nm for own, motor in zip(stated, motors, strict=True)
    ])  # fmt: skip
    if evidence.motion_rms is None:
        return np.asarray(np.broadcast_to(level, (len(evidence.configurations), len(motors))))
    presliding = np.array([law.presliding_rad for law in laws])
    swings = np.maximum(evidence.motion_rms / presliding, np.finfo(float).tiny)
    return np.asarray(level * np.clip(_PRESLIDING_SHARE / swings**2, _LEAST_FRICTION_SHARE, 1.0))


def _causes(robot: Robot, evidence: Evidence, weights: GravityTorques) -> list[_Cause]:
    """Everything that may change mean torques, with the change by each."""
    equilibrium = solve_statics(build_model(robot), evidence.configurations)

    def held(other: Robot) -> FloatArray:
        model = build_model(other)
        load = gravity_torque(model, equilibrium.position)[:, model.arm] @ other.arm_per_motor
        return np.asarray(load[:, evidence.joints(robot)])

    own = held(robot)
    payload = replace(robot, payload=replace(robot.payload, mass_kg=robot.payload.mass_kg + 1.0))
    causes = [_Cause("payload", "", (held(payload) - own)[None])]
    for index, joint in enumerate(robot.joints):
        if joint.link.mass_kg > 0:
            joints = (*robot.joints[:index], _heavier(joint), *robot.joints[index + 1 :])
            causes.append(_Cause("masses", joint.name, (held(replace(robot, joints=joints)) - own)[None] / 0.01))
    for index in np.flatnonzero(weights.usable).tolist():
        column = np.zeros_like(weights.expected)
        column[:, index] = weights.expected[:, index]
        causes.append(_Cause("torque_constant", weights.names[index], column[None]))
    tilted = [replace(robot, gravity_m_s2=_turned(robot.gravity_m_s2, axis)) for axis in (0, 1)]
    leans = np.array([held(other) - own for other in tilted]) / _TILT_RAD
    size = np.sqrt((leans**2).sum(axis=(1, 2)))
    # Out of the plane of a planar arm a lean does nothing to first order: what is left would ask for any angle.
    causes.append(_Cause("model", "", leans[size >= _FELT * size.max()]))
    return [cause for cause in causes if np.abs(cause.columns).max() > _LEAST_TORQUE]


def _heavier(joint: Joint) -> Joint:
    """A joint with one per cent more mass in its link."""
    return replace(joint, link=replace(joint.link, mass_kg=1.01 * joint.link.mass_kg))


def _turned(gravity: FloatArray, axis: int) -> FloatArray:
    """Gravity as a base sees it that leans about one of its horizontal axes."""
    return np.asarray(gravity - np.cross(_TILT_RAD * np.eye(3)[axis], gravity))


def _explained(
    left: FloatArray, causes: list[_Cause], white: Callable[[FloatArray], FloatArray]
) -> tuple[float, FloatArray, float]:
    """Squares that causes explain together, their values, and what is left."""
    matrix = white(np.concatenate([cause.columns for cause in causes])).T
    values = np.linalg.lstsq(matrix, left, rcond=None)[0]
    rest = left - matrix @ values
    return float(left @ left - rest @ rest), values, float(rest @ rest)


def _doubt(robot: Robot, cause: _Cause, values: FloatArray, strength: float, n_conf: int) -> Doubt:
    where = f"in {n_conf} configuration{'s' if n_conf > 1 else ''}"
    value = float(values[0])
    decisive = False
    if cause.kind == "payload":
        stated = robot.payload.mass_kg
        told = f"mean torques {where} carry a payload of {stated + value:.3g} kg, the model has {stated:.3g} kg"
    elif cause.kind == "torque_constant":
        told = f"{cause.name}: its mean torques are {1 + value:.3g} times what holds the arm {where}"
        decisive = abs(value) > _GROSS_FACTOR
    elif cause.kind == "masses":
        told = f"mean torques {where} carry {1 + value:.3g} times the mass of {cause.name}'s link"
    else:
        lean = np.rad2deg(np.linalg.norm(values))
        told = f"mean torques {where} are those of a base that leans by {lean:.2g} deg more than the model's"
    return Doubt(cause.kind, told, decisive=decisive, strength=strength)
