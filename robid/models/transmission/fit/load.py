"""What loads the gears: torques of the links along the motions, how far they may be off, and the motors' friction.

The torque behind a gear is not measured. Motor torques less what the motors themselves take tell it with the error of
the torque constants, masses of the robot file with theirs. Both are put together here: bodies with their doubts are
fitted to the motors' torques, each with an unknown gain. The result is a smooth function of the motion, so that noise,
ripple and friction of another law do not pull the stiffness down (errors in variables).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.transmission.fit.prior import DRIVES, doubts_of
from robid.models.transmission.fit.tracks import Course, Track
from robid.robot.description import Robot
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import RigidModel, build_rigid_model

_ROUNDS = 6
_UNCORRELATED = 0.1
_TELLING = 1e-4  # of the largest effect of a direction
_LEAST_RESIDUAL = 1e-4  # of a motor's torque


@dataclass(frozen=True)
class KnownBodies:
    """Standard parameters of a rigid fit."""

    names: tuple[str, ...]
    value: FloatArray  # (n_std,)
    directions: FloatArray  # (n_std, n_dir) Independent errors of one standard deviation each


@dataclass(frozen=True)
class Load:
    """Torques behind the gears along each motion."""

    torque: tuple[FloatArray, ...]  # Of each motion (n_row, n_gear) [N m, or N]
    # Of each motion (n_row, n_gear, n_doubt): what each independent doubt moves them by, one standard deviation each
    doubts: tuple[FloatArray, ...]
    coulomb: FloatArray  # (n_gear,) Coulomb friction of the gears' motors, motor side [N m]
    viscous: FloatArray  # (n_gear,) Their viscous friction, motor side [N m s/rad]
    gain: FloatArray  # (n_joint,) What recorded torques are multiplied by to be true ones
    gain_std: FloatArray  # (n_joint,)
    unexplained: FloatArray  # (n_joint,) What is left of the motors' torques over their size, root mean squares
    ratio: FloatArray  # (n_joint,) Recorded motor torques over those of the robot file, the straight line's slope
    bodies: KnownBodies  # What the torques were computed with


def load_of(robot: Robot, gears: Sequence[int], tracks: Sequence[Track], known: KnownBodies | None = None) -> Load:
    """Finds what loads the gears along some motions.

    Args:
        robot: The robot file's robot with its payload.
        gears: Indices of the joints with encoders on both sides (n_gear).
        tracks: The motions.
        known: Bodies and friction of a rigid fit; those of the robot file, corrected by the motors' torques, when None.
    """
    model = build_rigid_model(robot, RigidOptions(couplings=False))
    of_motors = np.array([kind in DRIVES for kind in model.kinds])
    columns = [_regressor(model, of_motors, track, robot) for track in tracks]
    torque = np.concatenate([track.torque for track in tracks])
    whole = np.concatenate([own for own, _ in columns])
    std = np.array([joint.nuisance_std.torque_relative_std for joint in robot.joints])
    if known is None:
        value, root, gain = _fitted(whole, torque, model.nominal, doubts_of(robot, model), std)
        gain_root = root[len(value) :]
    else:
        value, moved = _placed(model, known)
        root, gain = np.concatenate([moved, np.zeros((len(model.names), len(std)))], axis=1), np.zeros(len(std))
        gain_root = np.diag(std)
    left = torque * (1 + gain) - whole @ value
    at = {name: index for index, name in enumerate(model.names)}
    names = [robot.joints[gear].name for gear in gears]
    scaled = gain_root if known is not None else None
    pairs = [
        _behind(robot, gears, track, links, value[~of_motors], root[: len(value)][~of_motors], scaled)
        for track, (_, links) in zip(tracks, columns, strict=True)
    ]
    return Load(
        torque=tuple(own for own, _ in pairs),
        doubts=_telling([doubt for _, doubt in pairs]),
        coulomb=np.array([abs(value[at[f"{name}.coulomb"]]) for name in names]),
        viscous=np.array([max(value[at[f"{name}.viscous"]], 0.0) for name in names]),
        gain=1 + gain,
        gain_std=np.sqrt(np.sum(gain_root**2, axis=1)),
        unexplained=np.sqrt(np.mean(left**2, axis=0) / np.mean(torque**2, axis=0)),
        ratio=_slopes(whole @ model.nominal, torque),
        bodies=KnownBodies(model.names, value, root[: len(value)]),
    )


def _regressor(model: RigidModel, of_motors: BoolArray, track: Track, robot: Robot) -> tuple[FloatArray, FloatArray]:
    """Columns of all parameters in the motors' torques, and those of the links in the torques behind the gears."""
    arm, motor = track.arm, track.motor
    turned = [each @ robot.motor_per_arm.T for each in (arm.position, arm.speed, arm.acceleration)]
    links = model.columns(*turned)
    drives = model.columns(motor.position, motor.speed, motor.acceleration)
    whole = np.where(of_motors, drives, links)
    for index, kind in enumerate(model.kinds):
        if kind == "coulomb":
            joint = [one.name for one in robot.joints].index(model.names[index].partition(".")[0])
            whole[:, joint, index] = track.sense[:, joint]
    # Motors do the work of the arm: their torques are A^T of those behind the gears, with A the gears.
    behind = np.einsum("ji,njp->nip", robot.motor_per_arm, links[:, :, ~of_motors])
    return whole, behind


def _fitted(
    columns: FloatArray, torque: FloatArray, nominal: FloatArray, doubts: FloatArray, gain_std: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Most probable parameters (n_std,), a root (n_std + n_joint, n) of their and the gains' covariance, the gains.

    Each motor's rows weigh by its residual's variance times the time over which that is correlated. Gains multiply what
    the model says: on the measured torque they would shrink all to make the residual small.
    """
    n_joint, value = len(gain_std), nominal
    variance: FloatArray = 1e-4 * np.mean(torque**2, axis=0)
    moves = np.einsum("njp,pd->jnd", columns, doubts)
    target = np.moveaxis(torque - columns @ nominal, 1, 0)
    for _ in range(_ROUNDS):
        said = np.moveaxis(columns @ value, 1, 0)
        gains = -said[:, :, None] * (np.eye(n_joint) * gain_std)[:, None]
        rows = np.concatenate([moves, gains], axis=2)
        information = np.eye(rows.shape[2])
        slope = np.zeros(rows.shape[2])
        for own, right, spread in zip(rows, target, variance.tolist(), strict=True):
            information += own.T @ own / spread
            slope += own.T @ right / spread
        found = np.linalg.solve(information, slope)
        value = nominal + doubts @ found[:-n_joint]
        left = target - rows @ found
        least = (_LEAST_RESIDUAL**2) * np.mean(torque**2, axis=0)
        variance = np.array([np.mean(each**2) * correlation_rows(each) for each in left]) + least
    inverse_root = np.linalg.inv(np.linalg.cholesky(information)).T
    to_values = np.zeros((len(nominal) + n_joint, rows.shape[2]))
    to_values[: len(nominal), :-n_joint] = doubts
    to_values[len(nominal) :, -n_joint:] = np.diag(gain_std)
    return value, to_values @ inverse_root, gain_std * found[-n_joint:]


def correlation_rows(residual: FloatArray) -> float:
    """Number of successive rows (n_row,) that are worth one independent one: the integrated autocorrelation."""
    n_row = len(residual)
    spectrum = np.abs(np.fft.rfft(residual, 2 * n_row)) ** 2
    along = np.fft.irfft(spectrum)[: n_row // 4]
    if along[0] <= 0:
        return 1.0
    along = along / along[0]
    low = np.flatnonzero(along < _UNCORRELATED)
    end = int(low[0]) if low.size else len(along)
    return float(max(1.0, 1 + 2 * np.sum(along[1:end])))


def _slopes(said: FloatArray, measured: FloatArray) -> FloatArray:
    """Slopes (n_joint,) of what is measured over what is said (n_row, n_joint), each about its mean."""
    said, measured = said - said.mean(axis=0), measured - measured.mean(axis=0)
    return np.asarray(np.sum(said * measured, axis=0) / np.maximum(np.sum(said**2, axis=0), np.finfo(float).tiny))


def _placed(model: RigidModel, known: KnownBodies) -> tuple[FloatArray, FloatArray]:
    """Values (n_std,) and directions (n_std, n_dir) of a rigid fit at the model's parameters."""
    value, moved = model.nominal.copy(), np.zeros((len(model.names), known.directions.shape[1]))
    places = {name: index for index, name in enumerate(known.names)}
    for index, name in enumerate(model.names):
        if name in places:
            value[index], moved[index] = known.value[places[name]], known.directions[places[name]]
    return value, moved


def _behind(
    robot: Robot,
    gears: Sequence[int],
    track: Track,
    links: FloatArray,
    value: FloatArray,
    root: FloatArray,
    scaled: FloatArray | None,
) -> tuple[FloatArray, FloatArray]:
    """Torques (n_row, n_gear) behind the gears of a motion, and what doubts move them by (n_row, n_gear, n_doubt).

    Friction that the robot file states behind them is part of it. Torques of a rigid fit are as right as the motors'
    torque constants, `scaled` (n_joint, n_joint).
    """
    chosen = list(gears)
    torque = links[:, chosen] @ value
    doubts = links[:, chosen] @ root
    if scaled is not None:
        doubts[..., -len(scaled) :] = torque[..., None] * scaled[chosen]
    return torque + robot.arm_viscous[chosen] * _of_gears(track.arm, chosen), doubts


def _of_gears(course: Course, gears: Sequence[int]) -> FloatArray:
    return course.speed[:, list(gears)]


def _telling(doubts: Sequence[FloatArray]) -> tuple[FloatArray, ...]:
    """Turns doubts so that few of them say it all: the same covariance of the torques of all motions together."""
    whole = np.concatenate([each.reshape(-1, each.shape[2]) for each in doubts])
    values, axes = np.linalg.eigh(whole.T @ whole)
    kept = axes[:, values > (_TELLING**2) * values.max(initial=0.0)][:, ::-1]
    return tuple(each @ kept for each in doubts)
