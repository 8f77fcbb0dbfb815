"""What is known beforehand of what loads the gears: the robot file's bodies and drives, and how far off they may be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.arrays import FloatArray
from robid.robot.description import Inertial, Robot
from robid.robot.nuisance import NuisanceStd
from robid.robot.regressor.links import COMPONENTS, standard_parameters
from robid.robot.regressor.model import RigidModel

DRIVES = ("motor_inertia", "viscous", "coulomb", "torque_offset")
"""Kinds of parameters of the motors, before the gears."""
_WIDE = 2.0  # of what a robot file states of friction
_LEAST_NM, _LEAST_NMS_RAD = 0.02, 1e-3  # over the motor's largest torque; over that at 1 rad/s
_BALANCE = 0.1  # relative, of counterbalances


def doubts_of(robot: Robot, model: RigidModel) -> FloatArray:
    """Returns what one standard deviation of each independent doubt moves the parameters by (n_std, n_doubt).

    Of each body its mass with its inertia, the coordinates of its centre of mass, and its inertia about that; friction
    and offsets of motors are as good as unknown.
    """
    places = {name: index for index, name in enumerate(model.names)}
    columns = [*_of_bodies(robot, places), *_of_drives(robot, model)]
    return np.stack(columns, axis=1)


def _of_bodies(robot: Robot, places: dict[str, int]) -> Iterator[FloatArray]:
    loaded = robot.payload.mass_kg > 0
    for index, joint in enumerate(robot.joints):
        carried = robot.payload if loaded and index == len(robot.joints) - 1 else None
        for moved in _moves(joint.link, joint.nuisance_std):
            yield _column(joint.name, moved, places)
        if carried is not None:
            std = robot.nuisance_std
            own = NuisanceStd(
                mass_relative_std=std.payload_relative_std,
                com_m=std.payload_com_m,
                inertia_relative_std=std.payload_inertia_relative_std,
            )
            for moved in _moves(carried, own):
                yield _column(joint.name, moved, places)
    for link in robot.loop_links:
        for moved in _moves(link.link, NuisanceStd()):
            yield _column(link.name, moved, places)


def _moves(body: Inertial, std: NuisanceStd) -> Iterator[FloatArray]:
    """Yields by how much the ten parameters of a body change with each of its doubts."""
    if body.mass_kg <= 0:
        return
    base = standard_parameters(body)
    yield std.mass_relative_std * base
    for axis in np.eye(3):
        yield standard_parameters(Inertial(body.mass_kg, body.com_m + std.com_m * axis, body.inertia_kgm2)) - base
    wider = (1 + std.inertia_relative_std) * body.inertia_kgm2
    yield standard_parameters(Inertial(body.mass_kg, body.com_m, wider)) - base


def _column(owner: str, moved: FloatArray, places: dict[str, int]) -> FloatArray:
    column = np.zeros(len(places))
    for component, value in zip(COMPONENTS, moved.tolist(), strict=True):
        if f"{owner}.{component}" in places:
            column[places[f"{owner}.{component}"]] = value
    return column


def _of_drives(robot: Robot, model: RigidModel) -> Iterator[FloatArray]:
    joints = {joint.name: joint for joint in robot.joints}
    for index, parameter in enumerate(model.parameters):
        size = abs(parameter.nominal)
        if parameter.kind not in DRIVES:
            if not parameter.kind.startswith("counterbalance"):
                continue
            std = _BALANCE * size
        else:
            motor = joints[parameter.name.partition(".")[0]].motor
            most = motor.max_torque_nm if np.isfinite(motor.max_torque_nm) else 1.0
            std = {
                "motor_inertia": motor.inertia_relative_std * size,
                "viscous": max(_WIDE * size, _LEAST_NMS_RAD * most),
                "coulomb": max(_WIDE * size, _LEAST_NM * most),
                "torque_offset": _LEAST_NM * most,
            }[str(parameter.kind)]
        column = np.zeros(len(model.names))
        column[index] = std
        yield column
