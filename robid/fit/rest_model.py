"""The linearised robot where its springs rest under gravity and the excitation of a measurement."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.fft

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.fit.options import ElasticOptions
from robid.frf.frf import Frf
from robid.robot.derivatives import jacobian
from robid.robot.description import Robot
from robid.robot.expand import expand, with_springs_at
from robid.robot.linearize import LinearModel, linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.names import element_names
from robid.robot.response import ElasticParameters, hold_factor, nominal_parameters, response
from robid.robot.rest import SpringValues, settle_springs, swing_of

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
        nominal = nominal_parameters(placed, model, delay_s) if values is None else values
        load = spring_load(robot, frf, model, nominal)
        for _ in range(_PASSES if springs.cubic.any() else 0):
            rest = _loaded(model, frf, load).rest
            swing = swing_of(rest, springs, settle_springs(rest, springs).stiffness)
            equilibrium = solve_statics(elastic, frf.configurations, springs.stiffness, springs.cubic, swing.variance)
            model = linearize(elastic, equilibrium, names)
        model = _loaded(model, frf, load)
    movable = element_names(robot, "location") if "location" in options.free else []
    located = np.array([index for index, name in enumerate(movable) if name is not None], int)
    if options.statics == "updates" and located.size == 0:
        return model
    return expand(elastic, equilibrium, model, names, located)


@dataclass(frozen=True)
class SpringLoad:
    """What an excitation sends through each transmission; other springs get none.

    Attributes:
        power (n_conf, n_freq, n_spring): Mean square torque per excited line [(N m)^2].
        shape (n_conf, n_spring): See `Rest.shape`.
    """

    power: FloatArray
    shape: FloatArray


def spring_load(robot: Robot, frf: Frf, model: LinearModel, values: ElasticParameters) -> SpringLoad:
    """Finds the torque through each transmission from the motors' torques and motion.

    What a motor's torque does not spend on its own rotor and viscous friction goes through the transmissions; both
    are measured, so the elastic model only says at which lines the response depends on a spring.

    Args:
        robot: The robot file.
        frf: The response with the torques of its experiments.
        model: Linearised robot.
        values: Parameter values.

    Raises:
        DataError: If the response lacks its torque, or a motor's angle is not among its outputs.
    """
    missing = [name for name in frf.input_names if name not in frf.output_names]
    if frf.torque_amplitude is None or missing:
        lack = f"the angle of motor {', '.join(missing)}" if missing else "the torques of its experiments"
        message = f"cubic stiffness needs {lack}, which the response lacks"
        remedy = "estimate the response again, all motors among its outputs, or leave `cubic` out of `free`"
        raise DataError(message, where=robot.name, remedy=remedy)
    omega = 2 * np.pi * frf.frequency_hz
    spent = values.motor_inertia + values.viscous / (1j * omega[:, None])
    rows = [frf.output_names.index(name) for name in frf.input_names]
    held = hold_factor(omega, values.delay[0], frf.hold_period_s)
    left = held[:, None, None] * np.eye(len(robot.joints)) - spent[:, :, None] * frf.response[:, :, rows]
    through = np.linalg.inv(robot.arm_per_motor.T) @ left @ frf.torque_amplitude
    gears = [index for index, spring in enumerate(robot.springs) if spring.place == "transmission"]
    through = through[:, :, [robot.springs[index].joint for index in gears]]
    load = SpringLoad(np.zeros((*through.shape[:2], len(robot.springs))), np.ones(model.rest.deflection.shape))
    load.power[:, :, gears] = np.nanmean(2 * np.abs(through) ** 2, axis=-1)
    dynamic = values.stiffness[gears] + 1j * omega[:, None] * values.damping[gears]
    told = _sensitivity(frf, model, values)[:, :, gears]
    load.shape[:, gears] = [_shape(x, frf.lines, w) for x, w in zip(through / dynamic[..., None], told, strict=True)]
    return load


def _sensitivity(frf: Frf, model: LinearModel, values: ElasticParameters) -> FloatArray:
    """How much each line of the response says of each spring (n_conf, n_freq, n_spring), for relative errors."""
    found = response(model, values, frf.frequency_hz, frf.hold_period_s)
    slopes = jacobian(model, values, found, ("stiffness",), frf.hold_period_s)
    return np.asarray((np.abs(slopes / found.sampled[..., None]) ** 2).sum(axis=(2, 3)))


def _shape(amplitude: ComplexArray, lines: IntArray, weight: FloatArray) -> FloatArray:
    """Shape (n_spring,) of deflections (n_freq, n_spring, n_block), a mean over the lines with weights.

    At one line, the cube of a deflection regressed on the deflection, over three times its mean square.
    """
    known = amplitude[:, :, np.isfinite(amplitude).all(axis=(0, 1))]
    count = scipy.fft.next_fast_len(4 * int(lines.max()) + 1, real=True)
    spectrum = np.zeros((count // 2 + 1, *known.shape[1:]), complex)
    spectrum[lines] = known
    signal = scipy.fft.irfft(spectrum, count, axis=0) * count
    cube = scipy.fft.rfft(signal**3, axis=0)[lines] / count
    slope = np.real(cube * known.conj()).sum(axis=-1) / (np.abs(known) ** 2).sum(axis=-1)
    return np.asarray((weight * slope).sum(axis=0) / weight.sum(axis=0) / (3 * (signal**2).mean(axis=(0, 2))))


def _loaded(model: LinearModel, frf: Frf, load: SpringLoad) -> LinearModel:
    rest = replace(model.rest, power=load.power, shape=load.shape, omega=2 * np.pi * frf.frequency_hz)
    return replace(model, rest=rest)


def _nominal_springs(robot: Robot) -> SpringValues:
    return SpringValues(
        stiffness=np.array([spring.stiffness_nm_rad for spring in robot.springs]),
        cubic=np.array([spring.cubic_nm_rad3 for spring in robot.springs]),
        damping=np.array([spring.damping_nms_rad for spring in robot.springs]),
        location=np.concatenate([spring.point_m for spring in robot.springs]),
    )
