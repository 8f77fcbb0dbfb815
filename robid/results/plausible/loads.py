"""What may change the torque with which a robot carries its weight, counterbalances among it, and how it is told."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.results.finding import Finding, two_digits
from robid.robot.description import Joint, Robot
from robid.robot.linearize import gravity_torque, solve_statics
from robid.robot.model import build_model

BALANCE = "counterbalance"
"""The cause, of `robid.results.finding.CAUSES`."""
_TELLING_ANGLES = 4  # of a joint: a sine and a cosine pass through the torques at any two of them
_SAME_RAD = 1e-2


def wave_columns(robot: Robot, joint: int, configurations: FloatArray) -> FloatArray:
    """Change (2, n_conf, n_joint) of the motors' torques at rest by one N m of a joint's sine and cosine.

    Args:
        robot: The robot.
        joint: Index of a joint that turns.
        configurations (n_conf, n_joint): Where it rests [rad].
    """
    angle = configurations[:, joint]
    return np.asarray(-np.stack([np.sin(angle), np.cos(angle)])[..., None] * robot.arm_per_motor[joint])


def likely_joints(robot: Robot, configurations: FloatArray) -> list[int]:
    """Joints that may have a counterbalance that nobody stated, and whose angles would show it."""
    return [
        index
        for index, joint in enumerate(robot.joints)
        if joint.type == "revolute"
        and joint.counterbalance is None
        and np.unique(np.round(configurations[:, index] / _SAME_RAD)).size >= _TELLING_ANGLES
    ]


def balance_message(robot: Robot, name: str, waves: FloatArray, where: str) -> str:
    """Says what a counterbalance of a joint carries, by sine and cosine of its angle (2,), and how a fit takes it.

    Beside counterbalances that the file states, no fit takes any.
    """
    free = f"try `free: [{name}.counterbalance]` in an elastic fit"
    remedy = "correct the robot file" if any(joint.counterbalance is not None for joint in robot.joints) else free
    sine, cosine = (two_digits(wave, "+") for wave in waves.tolist())
    return (
        f"mean torques {where} are those with a counterbalance of {two_digits(float(np.hypot(*waves)))} N m at {name} "
        f"({sine} by the sine and {cosine} by the cosine of its angle; {remedy})"
    )


_GROSS_FACTOR = 0.2
_TILT_RAD = 0.01
_MOST_LEAN_RAD = float(np.deg2rad(15.0))
"""Beyond it gravity is no longer linear in how a base leans, and nobody mounts a robot so by mistake."""

_FELT = 0.05
_LEAST_TORQUE = 1e-9
_MOST_MASS = 2.0  # times a link's stated mass that a file leaves out


@dataclass(frozen=True)
class LoadCause:
    """What may change the mean torques."""

    kind: str  # Of `CAUSES`
    name: str  # Motor or link that it is about; of a base that leans the world's axes about which it does
    columns: FloatArray  # (n_column, n_conf, n_motor) Change of the torque per unit of it [N m]


def load_causes(
    robot: Robot, configurations: FloatArray, motors: IntArray, expected: FloatArray, usable: BoolArray
) -> list[LoadCause]:
    """Lists what may change mean torques, with the change by each, counterbalances last.

    Args:
        robot: The robot file's.
        configurations (n_conf, n_joint): Where it rests.
        motors (n_motor,): Indices of the motors among its joints.
        expected (n_conf, n_motor): The torques that hold it there [N m].
        usable (n_motor,): Motors whose torque can be judged.
    """
    equilibrium = solve_statics(build_model(robot, balanced=True), configurations)

    def held(other: Robot) -> FloatArray:
        model = build_model(other, balanced=True)
        load = gravity_torque(model, equilibrium.position)[:, model.arm] @ other.arm_per_motor
        return np.asarray(load[:, motors])

    own = held(robot)
    payload = replace(robot, payload=replace(robot.payload, mass_kg=robot.payload.mass_kg + 1.0))
    causes = [LoadCause("payload", "", (held(payload) - own)[None])]
    for index, joint in enumerate(robot.joints):
        if joint.link.mass_kg > 0:
            joints = (*robot.joints[:index], _heavier(joint), *robot.joints[index + 1 :])
            causes.append(LoadCause("masses", joint.name, (held(replace(robot, joints=joints)) - own)[None] / 0.01))
    for index in np.flatnonzero(usable).tolist():
        column = np.zeros_like(expected)
        column[:, index] = expected[:, index]
        causes.append(LoadCause("torque_constant", robot.joints[motors[index]].name, column[None]))
    tilted = [replace(robot, gravity_m_s2=_turned(robot.gravity_m_s2, axis)) for axis in (0, 1)]
    leans = np.array([held(other) - own for other in tilted]) / _TILT_RAD
    size = np.sqrt((leans**2).sum(axis=(1, 2)))
    # Out of the plane of a planar arm a lean does nothing to first order: what is left would ask for any angle.
    felt = size >= _FELT * size.max()
    causes.append(LoadCause("model", "".join(np.array(["x", "y"])[felt]), leans[felt]))
    for index in likely_joints(robot, configurations):
        columns = wave_columns(robot, index, configurations)[:, :, motors] * usable
        causes.append(LoadCause(BALANCE, robot.joints[index].name, columns))
    return [cause for cause in causes if np.abs(cause.columns).max() > _LEAST_TORQUE]


def is_possible(robot: Robot, cause: LoadCause, values: FloatArray) -> bool:
    """Whether a cause is as large as it may be: masses are not negative, nor a payload heavier than the arm."""
    own = values[-len(cause.columns) :]
    if cause.kind == "model":
        return float(np.linalg.norm(own)) <= _MOST_LEAN_RAD
    arm_kg = sum(joint.link.mass_kg for joint in robot.joints)
    limits = {"payload": (-robot.payload.mass_kg, max(arm_kg, robot.payload.mass_kg)), "masses": (-1.0, _MOST_MASS)}
    least, most = limits.get(cause.kind, (-np.inf, np.inf))
    return least <= float(own[0]) <= most


def _heavier(joint: Joint) -> Joint:
    """A joint with one per cent more mass in its link."""
    return replace(joint, link=replace(joint.link, mass_kg=1.01 * joint.link.mass_kg))


def _turned(gravity: FloatArray, axis: int) -> FloatArray:
    """Gravity as a base sees it that leans about one of its horizontal axes."""
    return np.asarray(gravity - np.cross(_TILT_RAD * np.eye(3)[axis], gravity))


def finding_of(robot: Robot, cause: LoadCause, values: FloatArray, strength: float, n_conf: int) -> Finding:
    """Says what a cause is that explains mean torques by its values (n_column,)."""
    where = f"in {n_conf} configuration{'s' if n_conf > 1 else ''}"
    value = float(values[0])
    decisive = False
    if cause.kind == "payload":
        stated = robot.payload.mass_kg
        told = f"mean torques {where} carry a payload of {stated + value:.3g} kg, the model has {stated:.3g} kg"
    elif cause.kind == "torque_constant":
        told = f"{cause.name}: its mean torques are {1 + value:.3g} times what balances the arm {where}"
        if value > -1:
            # Torques that are read too large ask for a constant that is smaller.
            told += f" (correct its torque constant by {two_digits(-100 * value / (1 + value), '+')} %)"
        decisive = abs(value) > _GROSS_FACTOR
    elif cause.kind == "masses":
        told = f"mean torques {where} carry {1 + value:.3g} times the mass of {cause.name}'s link"
    elif cause.kind == BALANCE:
        told = balance_message(robot, cause.name, values, where)
    else:
        lean, turns = np.rad2deg(np.linalg.norm(values)), np.rad2deg(values).tolist()
        about = " and ".join(
            f"{two_digits(turn, '+')} deg about the world's {axis}"
            for axis, turn in zip(cause.name, turns, strict=True)
        )
        told = f"mean torques {where} are those of a base that leans by {lean:.2g} deg more than the model's ({about})"
    return Finding(cause.kind, told, decisive=decisive, strength=strength)
