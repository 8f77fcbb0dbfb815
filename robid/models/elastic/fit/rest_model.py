"""The linearised robot where its springs rest under gravity and the excitation of a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.gear_motion import (
    Swinging,
    gear_effects,
    line_frequencies,
    spring_compliance,
    swing_shape,
    swings_known,
)
from robid.models.elastic.fit.nuisance.effects import (
    Drift,
    LoadDamping,
    LoadFriction,
    Nuisance,
    OneSided,
    RobotMove,
    SlipTorque,
    late_slopes,
    moved_robot,
    torque_slopes,
)
from robid.models.elastic.fit.nuisance.listing import estimated_nuisances
from robid.models.elastic.fit.nuisance.moves import PERCENT
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.weights import make_weights
from robid.robot.derivatives import expand, jacobian, shifts_between, with_springs_at
from robid.robot.description import Robot
from robid.robot.linearize import Equilibrium, LinearModel, linearize, solve_statics
from robid.robot.model import ElasticModel, build_model
from robid.robot.parameters import element_names
from robid.robot.response import ElasticParameters, motion_matrices, nominal_parameters, response
from robid.robot.rest import SpringValues, settle_springs, swing_of
from robid.robot.sampling import hold_factor
from robid.robot.spring_laws import GearEffects

_PASSES = 3
TURN_10_HZ = 20 * np.pi
"""Angular frequency of 10 Hz [rad/s]."""
NO_LOAD_RAD = 1e-9
_MILLI = 1e3
_HARDLY = 0.01  # mrad: upright axes carry nothing, bearings that give way turn them by less
"""Deflections, or differences of them, below which loads are none, or alike [rad]."""
_NUISANCE_STEP = 0.01  # of its deviation


def rest_model(
    robot: Robot, frf: Frf, options: ElasticOptions, delay_s: float, values: ElasticParameters | None = None
) -> LinearModel:
    """Linearises a robot in a response's configurations.

    Nuisances that the options free are as the values say, and the model moves with them to first order.

    Args:
        robot: The robot file.
        frf: The response; where transmissions are cubic, its torque decides how far they swing.
        options: Options of the fit.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
        values: Values in place of the robot file's.

    Raises:
        DataError: If a configuration has no equilibrium, or the response lacks what cubic springs need.
    """
    estimated = estimated_nuisances(robot, options)
    if not estimated:
        return _rested(robot, frf, options, delay_s, values)
    amounts = np.zeros(len(estimated)) if values is None else values.doubt
    balanced = all(joint.counterbalance is None for joint in robot.joints)
    model = _rested(moved_robot(robot, estimated, amounts), frf, options, delay_s, values, balanced=balanced)
    stiffness = np.array([s.stiffness for s in robot.springs]) if values is None else values.stiffness
    for each, amount in zip(estimated, amounts.tolist(), strict=True):
        model = _one_sided(model, each.effect.spring, stiffness, amount) if isinstance(each.effect, OneSided) else model
    # Central differences of the whole linearised robot, at rest anew on each side; what acts beside its matrices moves
    # none of them.
    still, pairs = replace(options, statics="updates", free=()), []
    for each, step in zip(estimated, _NUISANCE_STEP * np.diag([each.common_std for each in estimated]), strict=True):
        if isinstance(each.effect, RobotMove):
            sides = (moved_robot(robot, estimated, amounts + side * step) for side in (-1, 1))
            behind, ahead = (_rested(side, frf, still, delay_s, values, balanced=balanced) for side in sides)
            pairs.append((behind, ahead))
        elif isinstance(each.effect, OneSided):
            wide = _NUISANCE_STEP * each.common_std
            pairs.append(
                (
                    _one_sided(model, each.effect.spring, stiffness, -wide),
                    _one_sided(model, each.effect.spring, stiffness, wide),
                )
            )
        else:
            pairs.append((model, model))
    width = np.array([2 * _NUISANCE_STEP * each.common_std for each in estimated])
    late = late_slopes(estimated, frf.input_names, frf.output_names)
    torque, friction = torque_slopes(estimated, len(robot.joints)), _frictions(estimated, robot, model)
    shifts = shifts_between(pairs, width, amounts, torque, late, friction)
    if not any(isinstance(each.effect, LoadDamping | SlipTorque) for each in estimated):
        return replace(model, shifts=shifts)
    now = replace(nominal_parameters(robot, model, delay_s), doubt=amounts) if values is None else values
    return replace(model, shifts=shifts, effects=_effects(robot, frf, now, model, estimated))


def campaign_course(count: int) -> FloatArray:
    """How far each configuration (count,) lies along a campaign: from -1 at the first to 1 at the last; 0 of one."""
    return np.linspace(-1.0, 1.0, count) if count > 1 else np.zeros(count)


def friction_of_one(inertia: float) -> float:
    """Viscous friction of a percent of what an inertia asks for at 10 Hz."""
    return TURN_10_HZ * inertia / PERCENT


def load_course(model: LinearModel, spring: int) -> FloatArray:
    """How far a spring is bent by what it carries at rest (n_conf,), in thousandths of its unit; 0 where hardly."""
    load = _MILLI * np.abs(model.rest.deflection[:, spring])
    return np.asarray(np.where(load > _HARDLY, load, 0.0))


def clinging_of_one(inertia: float, phase: complex) -> complex:
    """Torque per angle of a percent of what an inertia asks for at 10 Hz [N m/rad]."""
    return phase * inertia * TURN_10_HZ**2 / PERCENT


def _frictions(
    estimated: Sequence[Nuisance], robot: Robot, model: LinearModel
) -> tuple[FloatArray | None, ComplexArray | None]:
    """What an amount of each adds to the motors' viscous friction, and to their torque per angle; None for nothing.

    Both (n_conf, n_nuisance, n_joint).
    """
    count = len(model.mass)
    viscous = np.zeros((count, len(estimated), len(robot.joints)))
    clinging = np.zeros(viscous.shape, complex)
    for row, each in enumerate(estimated):
        effect = each.effect
        if not isinstance(effect, Drift | LoadFriction):
            continue
        inertia = robot.joints[effect.joint].motor.inertia_kgm2
        if isinstance(effect, Drift):
            viscous[:, row, effect.joint] = friction_of_one(inertia) * campaign_course(count)
        elif effect.phase is None:
            viscous[:, row, effect.joint] = friction_of_one(inertia) * load_course(model, effect.spring)
        else:
            clinging[:, row, effect.joint] = clinging_of_one(inertia, effect.phase) * load_course(model, effect.spring)
    return (viscous if viscous.any() else None), (clinging if clinging.any() else None)


def bent_ways(model: LinearModel, spring: int) -> FloatArray:
    """Which way a spring is bent at rest (n_conf,), 1 or -1; 0 where it carries nothing."""
    deflection = model.rest.deflection[:, spring]
    return np.asarray(np.where(np.abs(deflection) > NO_LOAD_RAD, np.sign(deflection), 0.0))


def _one_sided(model: LinearModel, spring: int, stiffness: FloatArray, percent: float) -> LinearModel:
    """The model one of whose springs is stiffer the way it is bent, as gravity's gradient beside the spring's own."""
    added = model.gravity_stiffness.copy()
    at = model.n_motor + spring
    added[:, at, at] += percent / PERCENT * float(stiffness[spring]) * bent_ways(model, spring)
    return replace(model, gravity_stiffness=added)


def _effects(
    robot: Robot, frf: Frf, values: ElasticParameters, model: LinearModel, estimated: Sequence[Nuisance]
) -> GearEffects | None:
    """What estimated nuisances of gears do as the measurement moves them."""
    power, moved = np.zeros_like(model.rest.deflection), None
    gears = np.array([index for index, spring in enumerate(robot.springs) if spring.place == "transmission"])
    if not swings_known(frf):
        return gear_effects(estimated, frf, values.stiffness, model.rest.deflection, power, moved, gears)
    load, omega = spring_load(robot, frf, values), 2 * np.pi * frf.frequency_hz
    dynamic = (model.rest.factor * values.stiffness)[:, None] + 1j * omega[:, None] * values.damping
    found = None
    # How bristles act depends on the swing, and the swing on them: a few passes do, for they are a tenth as stiff.
    for _ in range(_PASSES):
        power = (np.nan_to_num(load.power) / np.abs(dynamic) ** 2).sum(axis=1)
        moved = load.through / dynamic[:, :, gears, None]
        found = gear_effects(estimated, frf, values.stiffness, model.rest.deflection, power, moved, gears)
        if found is None or not (values.doubt.any() or any(each.known for each in found.bristles)):
            break
        # What bristles carry does not bend the gear.
        grown = (found.growth(values.doubt) * values.damping)[:, None]
        dynamic = (model.rest.factor * values.stiffness)[:, None] + 1j * omega[:, None] * grown
        dynamic = dynamic + found.stiffness(values.doubt, omega)
    return found


def _rested(
    robot: Robot,
    frf: Frf,
    options: ElasticOptions,
    delay_s: float,
    values: ElasticParameters | None,
    *,
    balanced: bool = False,
) -> LinearModel:
    """The same of a robot as it is, all nuisances aside; its counterbalances are taken where its file has none."""
    springs = _nominal_springs(robot) if values is None else values.springs
    names = frf.output_names
    elastic, equilibrium = settle(robot, frf.configurations, springs, balanced=balanced)
    model = replace(linearize(elastic, equilibrium, names), rates=frf.output_rates)
    if springs.cubic.any() or "cubic" in options.kinds:
        nominal = nominal_parameters(elastic.robot, model, delay_s) if values is None else values
        load = spring_load(robot, frf, nominal)
        # A cubic spring is as stiff as its deflection at rest and the mean square of its swing make it, and both follow
        # its stiffness: statics and linearisation are found again with each other.
        for _ in range(_PASSES if springs.cubic.any() else 0):
            rest = replace(model.rest, power=load.power, omega=2 * np.pi * frf.frequency_hz)
            swing = swing_of(rest, springs, settle_springs(rest, springs).stiffness)
            equilibrium = solve_statics(elastic, frf.configurations, springs.stiffness, springs.cubic, swing.variance)
            model = replace(linearize(elastic, equilibrium, names), rates=frf.output_rates)
        model = _loaded(model, frf, load, nominal, options)
    movable = element_names(robot, "location") if "location" in options.kinds else []
    located = np.array([index for index, name in enumerate(movable) if name is not None], int)
    if options.statics == "updates" and located.size == 0:
        return model
    return expand(elastic, equilibrium, model, names, located)


def settle(
    robot: Robot, configurations: FloatArray, springs: SpringValues, *, balanced: bool = False
) -> tuple[ElasticModel, Equilibrium]:
    """Builds a robot with some values of its springs and finds where it rests.

    Args:
        robot: The robot.
        configurations (n_conf, n_joint): Arm-side positions that the encoders show [rad, or m].
        springs: The values.
        balanced: As in `build_model`.

    Raises:
        DataError: If a configuration has no equilibrium.
    """
    elastic = build_model(placed_robot(robot, springs), balanced=balanced)
    return elastic, solve_statics(elastic, configurations, springs.stiffness, springs.cubic)


def placed_robot(robot: Robot, springs: SpringValues) -> Robot:
    """Returns the robot with its springs where the values have them."""
    points = springs.location.reshape(-1, 3)
    return with_springs_at(robot, {s.name: point for s, point in zip(robot.springs, points, strict=True)})


@dataclass(frozen=True)
class SpringLoad:
    """What an excitation sends through each transmission; other springs get none."""

    power: FloatArray  # (n_conf, n_freq, n_spring) Mean square torque per excited line [(N m)^2]
    through: ComplexArray  # (n_conf, n_freq, n_gear, n_block) Torque through transmissions, DFT sums over samples [N m]
    gears: IntArray  # (n_gear,) Indices of the transmissions


def spring_load(robot: Robot, frf: Frf, values: ElasticParameters) -> SpringLoad:
    """Finds the torque through each transmission from the motors' torques and motion.

    What a motor's torque does not spend on its own rotor and viscous friction goes through the transmissions; both
    are measured, so the elastic model is not asked.

    Args:
        robot: The robot file.
        frf: The response with the torques of its experiments.
        values: Parameter values.

    Raises:
        DataError: If the response lacks its torque, or a motor's angle is not among its outputs.
    """
    missing = [name for name in frf.input_names if name not in frf.output_names]
    if frf.input_amplitude is None or missing:
        lack = f"the angle of motor {', '.join(missing)}" if missing else "the torques of its experiments"
        message = f"D133 cubic stiffness needs {lack}, which the response lacks"
        remedy = "estimate the response again, all motors among its outputs, or leave `cubic` out of `free`"
        raise DataError(message, where=robot.name, remedy=remedy)
    # An acceleration a takes the torque (J + v / jw) a of rotor and viscous friction. What a motor's torque, held and
    # late, has beyond that goes through the transmissions.
    omega = 2 * np.pi * frf.frequency_hz
    spent = values.motor_inertia + values.viscous / (1j * omega[:, None])
    rows = [frf.output_names.index(name) for name in frf.input_names]
    held = hold_factor(omega, values.delay[0], frf.hold_period_s)
    left = held[:, None, None] * np.eye(len(robot.joints)) - spent[:, :, None] * frf.response[:, :, rows]
    through = np.linalg.inv(robot.arm_per_motor.T) @ left @ frf.input_amplitude
    gears = [index for index, spring in enumerate(robot.springs) if spring.place == "transmission"]
    through = through[:, :, [robot.springs[index].joint for index in gears]]
    power = np.zeros((*through.shape[:2], len(robot.springs)))
    # Of a sinusoid with the half-complex amplitude c, the mean square is 2 |c|^2.
    power[:, :, gears] = np.nanmean(2 * np.abs(through) ** 2, axis=-1)
    return SpringLoad(power, through, np.array(gears))


def _sensitivity(frf: Frf, model: LinearModel, values: ElasticParameters, options: ElasticOptions) -> FloatArray:
    """How much each line of the response tells a fit of each spring (n_conf, n_freq, n_spring)."""
    found = response(model, values, frf.frequency_hz, frf.hold_period_s)
    moved = jacobian(model, values, found, ("stiffness",))
    slopes = np.abs(moved / options.residual.divisor(found.sampled)[..., None]) ** 2
    weight, _ = make_weights(frf, options.weights, options.residual, np.abs(found.sampled))
    sensitivity = (weight[..., None] * slopes).sum(axis=(2, 3))
    return np.asarray(np.where(sensitivity.any(axis=1, keepdims=True), sensitivity, slopes.sum(axis=(2, 3))))


def _loaded(
    model: LinearModel, frf: Frf, load: SpringLoad, values: ElasticParameters, options: ElasticOptions
) -> LinearModel:
    """The model with what the excitation does to its springs.

    Stiffening moves the resonances, and with them the lines that tell of a spring, so shapes are found more than once.
    """
    omega = 2 * np.pi * frf.frequency_hz
    model = replace(model, rest=replace(model.rest, power=load.power, omega=omega))
    for _ in range(_PASSES if values.springs.cubic.any() else 1):
        shape = _shapes(model, frf, load, values, options)
        # Where a softening spring gives way, later iterates may hold.
        shape = np.where(np.isfinite(shape), shape, 1.0)
        model = replace(model, rest=replace(model.rest, shape=shape))
    return model


def _shapes(
    model: LinearModel, frf: Frf, load: SpringLoad, values: ElasticParameters, options: ElasticOptions
) -> FloatArray:
    """`Rest.shape` (n_conf, n_spring) of the transmissions as they swing with the model's present shapes."""
    springs, omega = settle_springs(model.rest, values.springs), model.rest.omega
    sensitivity = _sensitivity(frf, model, values, options)
    every = line_frequencies(frf.frequency_hz, frf.lines)
    shape = np.ones(springs.stiffness.shape)
    for c in range(len(shape)):
        compliance = spring_compliance(motion_matrices(model, values, c), model.n_motor + load.gears, every)
        for gear, spring in enumerate(load.gears.tolist()):
            dynamic = springs.stiffness[c, spring] + 1j * omega * values.damping[spring]
            amplitude = load.through[c, :, gear] / dynamic[:, None]
            swinging = Swinging(
                rest=springs.deflection[c, spring],
                cubic=values.cubic[spring],
                amplitude=amplitude[:, np.isfinite(amplitude).all(axis=0)],
                lines=frf.lines,
                compliance=compliance[:, gear],
            )
            shape[c, spring] = swing_shape(swinging, sensitivity[c, :, spring])
    return shape


def _nominal_springs(robot: Robot) -> SpringValues:
    return SpringValues(
        stiffness=np.array([spring.stiffness for spring in robot.springs]),
        cubic=np.array([spring.cubic for spring in robot.springs]),
        damping=np.array([spring.damping for spring in robot.springs]),
        location=robot.spring_points_m,
    )
