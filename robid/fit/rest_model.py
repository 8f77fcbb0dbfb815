"""The linearised robot where its springs rest under gravity and the excitation of a measurement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.fit.names import element_names
from robid.fit.options import ElasticOptions
from robid.frf.frf import Frf
from robid.robot.description import Robot
from robid.robot.expand import expand, with_springs_at
from robid.robot.linearize import LinearModel, linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import ElasticParameters, hold_factor
from robid.robot.rest import SpringValues, settle_springs

_PASSES = 3


def rest_model(
    robot: Robot, frf: Frf, options: ElasticOptions, delay_s: float, values: ElasticParameters | None = None
) -> LinearModel:
    """Linearises a robot in a response's configurations.

    Args:
        robot: The robot file.
        frf: The response; where transmissions are cubic, its torque decides how far they swing.
        options: Options of the fit.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
        values: Values in place of the robot file's.

    Raises:
        DataError: If a configuration has no equilibrium, or the response lacks what cubic springs need.
    """
    springs = _nominal_springs(robot) if values is None else values.springs
    points = springs.location.reshape(-1, 3)
    placed = with_springs_at(robot, {s.name: point for s, point in zip(robot.springs, points, strict=True)})
    elastic = build_model(placed)
    names = frf.output_names
    equilibrium = solve_statics(elastic, frf.configurations, springs.stiffness, springs.cubic)
    model = linearize(elastic, equilibrium, names)
    if springs.cubic.any() or "cubic" in options.free:
        power = spring_power(robot, frf, delay_s, values)
        for _ in range(_PASSES if springs.cubic.any() else 0):
            swing = settle_springs(_loaded(model, frf, power).rest, springs).variance
            equilibrium = solve_statics(elastic, frf.configurations, springs.stiffness, springs.cubic, swing)
            model = linearize(elastic, equilibrium, names)
        model = _loaded(model, frf, power)
    movable = element_names(robot, "location") if "location" in options.free else []
    located = np.array([index for index, name in enumerate(movable) if name is not None], int)
    if options.statics == "updates" and located.size == 0:
        return model
    return expand(elastic, equilibrium, model, names, located)


def spring_power(robot: Robot, frf: Frf, delay_s: float, values: ElasticParameters | None = None) -> FloatArray:
    """Mean square torque (n_conf, n_freq, n_spring) through each transmission, per excited line [(N m)^2].

    What a motor's torque does not spend on its own rotor and viscous friction goes through the transmissions; both
    are measured, so no elastic model is needed. Springs that are no transmissions get none.

    Args:
        robot: The robot file.
        frf: The response with the power of its torques.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
        values: Values in place of the robot file's.

    Raises:
        DataError: If the response lacks its torque, or a motor's angle is not among its outputs.
    """
    missing = [name for name in frf.input_names if name not in frf.output_names]
    if frf.torque_power is None or missing:
        lack = f"the angle of motor {', '.join(missing)}" if missing else "the power of its torques"
        message = f"cubic stiffness needs {lack}, which the response lacks"
        remedy = "estimate the response again, all motors among its outputs, or leave `cubic` out of `free`"
        raise DataError(message, where=robot.name, remedy=remedy)
    motors = [joint.motor for joint in robot.joints]
    inertia = np.array([m.inertia_kgm2 for m in motors]) if values is None else values.motor_inertia
    viscous = np.array([m.friction.viscous_nms_rad for m in motors]) if values is None else values.viscous
    omega = 2 * np.pi * frf.frequency_hz
    spent = inertia + viscous / (1j * omega[:, None])
    rows = [frf.output_names.index(name) for name in frf.input_names]
    held = hold_factor(omega, delay_s, frf.hold_period_s)
    left = held[:, None, None] * np.eye(len(motors)) - spent[:, :, None] * frf.response[:, :, rows]
    through = np.linalg.inv(robot.arm_per_motor.T) @ left
    each = np.real(np.einsum("cfoi,cfij,cfoj->cfo", through, frf.torque_power, through.conj(), optimize=True))
    power = np.zeros((*each.shape[:2], len(robot.springs)))
    for index, spring in enumerate(robot.springs):
        if spring.place == "transmission":
            power[:, :, index] = each[:, :, spring.joint]
    return power


def _loaded(model: LinearModel, frf: Frf, power: FloatArray) -> LinearModel:
    return replace(model, rest=replace(model.rest, power=power, omega=2 * np.pi * frf.frequency_hz))


def _nominal_springs(robot: Robot) -> SpringValues:
    return SpringValues(
        stiffness=np.array([spring.stiffness_nm_rad for spring in robot.springs]),
        cubic=np.array([spring.cubic_nm_rad3 for spring in robot.springs]),
        damping=np.array([spring.damping_nms_rad for spring in robot.springs]),
        location=np.concatenate([spring.point_m for spring in robot.springs]),
    )
