"""Equilibrium under gravity and linearization there, in spring coordinates."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.robot.balances import balance_slope, balance_torque
from robid.robot.description import Robot, Sensor
from robid.robot.model import ElasticModel, site_name
from robid.robot.rest import MatrixSlopes, Rest
from robid.robot.spring_laws import GearEffects
from robid.signals.quantities import Rate

_AFTER, _BEFORE = [1, 2, 0], [2, 0, 1]  # of x, y and z
_NEWTON_STEPS = 20
_NEWTON_TOLERANCE_RAD = 1e-12
_STALE = 0.05  # of the step before


@dataclass(frozen=True)
class Equilibrium:
    """Rest positions with the encoders held at their configurations."""

    position: FloatArray  # (n_conf, n_dof) All coordinates [rad, or m]
    motor_torque: FloatArray  # (n_conf, n_joint) Torque that holds the motors [N m]
    deflection: FloatArray  # (n_conf, n_spring) Spring deflections [rad, or m]
    spring_torque: FloatArray  # (n_conf, n_spring) Gravity's torque on each deflection, minus the spring's [N m, or N]


@dataclass(frozen=True)
class Shifts(MatrixSlopes):
    """How the linearised matrices move with nuisance parameters, what a robot file may have wrong, to first order."""

    amounts: FloatArray  # (n_nuisance,) With which the robot was linearised, zero where the file is right
    torque: FloatArray  # (n_nuisance, n_joint) Of the logarithm of the torque that a motor gives per torque recorded
    # (n_nuisance, n_joint) By how much later than the others each motor's torque acts [s]; None for not at all
    late_torque: FloatArray | None = None
    late_output: FloatArray | None = None  # (n_nuisance, n_out) The same of outputs, later than the others [s]
    # (n_conf, n_nuisance, n_joint) Viscous friction that each motor has more in a configuration; None for none
    # [N m s/rad]
    drift: FloatArray | None = None
    # (n_conf, n_nuisance, n_joint) Torque per angle that each motor has more in a configuration; None for none
    # [N m/rad]
    clinging: ComplexArray | None = None


@dataclass(frozen=True)
class LinearModel:
    """What a configuration's dynamic stiffness holds besides springs, dampers and rotors.

    Coordinates are `z = (q_m, spring deflections)`, so that springs, dampers, rotor inertias and motor
    viscosities are diagonal (docs/methods, sec. 1); viscous friction of the arms is not.
    """

    mass: FloatArray  # (n_conf, n, n) Inertia matrix without the rotors' and the links' own axial inertia
    # (n_conf, n, n) Symmetrised gradient of gravity, and of what loaded springs do whose stiffness depends on a joint's
    # position [N m/rad; N/m and N along lines]
    gravity_stiffness: FloatArray
    # (n_conf, n_joint, n, n) Derivative of the inertia matrix with respect to each link's own inertia about its joint
    # axis direction, or mass where its joint slides
    link_inertia: FloatArray
    output: FloatArray  # (n_conf, n_out, n) Angles and positions in these coordinates; accelerometers' positions
    tilt: FloatArray  # (n_conf, n_out, n) How gravity enters an accelerometer as it turns [m/s^2]; zero for the others
    arm: FloatArray  # (n_joint, n) Arm-side positions in these coordinates
    rotor: FloatArray  # (n_joint,) Rotor inertias of the robot file [kg m^2]
    axial: FloatArray  # (n_joint,) Links' own inertia about the joint axis, or mass, with payload [kg m^2, or kg]
    rest: Rest
    shifts: Shifts | None = None  # How all this moves with nuisance parameters that a fit estimates; None without any
    effects: GearEffects | None = None  # What gears do beside springs and dampers by such parameters; None without any
    # (n_conf, n_freq, n_spring) What springs have at each frequency of a response beyond their stiffness, over it; None
    # for nothing
    added: ComplexArray | None = None
    # (n_conf, n_motor) Torques that follow the motors' angles, as complex stiffnesses [N m/rad]; None for none
    clinging: ComplexArray | None = None
    # (n_out,) How many times each output is differentiated before it is sampled; empty where that is unknown: positions
    rates: tuple[Rate, ...] = ()

    @property
    def n_motor(self) -> int:
        """Number of motors."""
        return int(self.rotor.size)


def solve_statics(
    model: ElasticModel,
    configurations: FloatArray,
    stiffness: FloatArray | None = None,
    cubic: FloatArray | None = None,
    variance: FloatArray | None = None,
) -> Equilibrium:
    """Solves the statics of every configuration with the motor angles held by the encoders.

    Args:
        model: The elastic model.
        configurations (n_conf, n_joint): Arm-side positions that the encoders show [rad, or m].
        stiffness (n_spring,): Linear stiffness to use instead of the robot's own [N m/rad].
        cubic (n_spring,): Cubic coefficients to use instead of the robot's own [N m/rad^3].
        variance (n_conf, n_spring): Mean square deflections of swinging springs, whose cubic part then carries more
            of the mean torque; none by default [rad^2].

    Raises:
        DataError: If a configuration has no equilibrium within reach.
    """
    springs = model.robot.springs
    linear = np.array([s.stiffness for s in springs]) if stiffness is None else stiffness
    third = np.array([s.cubic for s in springs]) if cubic is None else cubic
    swing = np.zeros((len(configurations), len(springs))) if variance is None else variance
    # A swing v adds 3 k3 v to the slope that the mean deflection feels (docs/methods, sec. 1).
    slope = linear + 3 * third * swing
    data = model.scratch
    pairs = zip(configurations, slope, strict=True)
    position = np.array([_settle(model, data, own, third, configuration) for configuration, own in pairs])
    deflection = position @ model.deflection.T
    torque = model.varying.factors(position) * (slope * deflection + third * deflection**3)
    # E' tau: what the springs do to each coordinate; motors must hold it.
    load = torque @ model.deflection
    besides = gravity_torque(model, position)
    if model.varying:
        energy = 0.5 * slope * deflection**2 + 0.25 * third * deflection**4
        besides = besides + [model.varying.load(*each) for each in zip(position, energy, strict=True)]
    # A rigid arm is its motor's coordinate: gravity acts on the motor directly.
    load[:, model.arm] += np.where(model.robot.rigid, besides[:, model.arm], 0.0)
    return Equilibrium(position, load[:, model.motor] / model.turns, deflection, -torque)


def linearize(
    model: ElasticModel, equilibrium: Equilibrium, output_names: tuple[str, ...] | None = None
) -> LinearModel:
    """Linearises the elastic model at rest.

    Args:
        model: The elastic model.
        equilibrium: Where to linearise.
        output_names: Joints for their motors, `<joint>.arm` for their arms, names of sensors; all motors by default.

    Source:
        Wernholt and Moberg (2008), sec. 5; docs/methods, sec. 1.
    """
    data, to_spring, axial = model.scratch, model.to_spring, axial_inertia(model)
    masses, gravities, links, outputs = [], [], [], []
    names = output_names or tuple(joint.name for joint in model.robot.joints)
    factor = model.varying.factors(equilibrium.position)
    for row, position in enumerate(equilibrium.position):
        load = gravity_gradient(model, data, position)
        if model.varying:
            load = load + _varying_gradient(model, equilibrium, row, factor[row])
        # Congruence with z = T^-1 q keeps the gradient symmetric: T' (dg/dq) T.
        gravities.append(to_spring.T @ load @ to_spring)
        mass, moves = _inertia(model, data, position, to_spring)
        # Sum over directions of t t': the derivative of the inertia matrix by the link's own inertia.
        links.append((moves[..., :, None] * moves[..., None, :]).sum(axis=1))
        outputs.append(_in_springs(model, names, _outputs(model, data, names), to_spring))
        # What parameters add again is taken out: the links' own axial inertia, and the rotors in `_inertia`.
        masses.append(to_spring.T @ mass @ to_spring - np.einsum("l,lij->ij", axial, links[-1]))
    return LinearModel(
        mass=np.array(masses),
        gravity_stiffness=np.array(gravities),
        link_inertia=np.array(links),
        output=np.array(outputs)[:, 0],
        tilt=np.array(outputs)[:, 1],
        arm=to_spring[model.arm],
        rotor=model.robot.motor_inertia_kgm2,
        axial=axial,
        rest=_rest(model, equilibrium, np.array(gravities), factor),
    )


def _rest(model: ElasticModel, equilibrium: Equilibrium, gravity: FloatArray, factor: FloatArray) -> Rest:
    """Where the springs rest, without any excitation that lets them swing."""
    n_motor = len(model.motor)
    return Rest(
        deflection=equilibrium.deflection,
        torque=equilibrium.spring_torque,
        gradient=gravity[:, n_motor:, n_motor:],
        location=model.robot.spring_points_m,
        power=np.zeros((len(gravity), 0, len(model.robot.springs))),
        omega=np.zeros(0),
        shape=np.ones((len(gravity), len(model.robot.springs))),
        factor=factor,
    )


def _varying_gradient(model: ElasticModel, equilibrium: Equilibrium, row: int, factor: FloatArray) -> FloatArray:
    """What loaded springs add to gravity's gradient as their stiffness moves; their loads are gravity's."""
    deflection, torque = equilibrium.deflection[row], -equilibrium.spring_torque[row] / factor
    # The cubic part's share of the energy is of second order here.
    energy = 0.5 * torque * deflection
    return model.varying.gradient(equilibrium.position[row], energy, torque, model.deflection)


def gravity_torque(model: ElasticModel, positions: FloatArray) -> FloatArray:
    """Gravity's torque (n_conf, n_dof) on every coordinate at some positions, counterbalances included [N m]."""
    data = model.scratch
    return np.array([_gravity(model, data, position) for position in positions])


def unload(model: ElasticModel, position: FloatArray, torque: FloatArray) -> None:
    """Takes what counterbalances carry at a position (n_dof,) off the torques (n_dof,) that it asks for, in place."""
    for joint, arm in zip(model.robot.joints, model.arm, strict=True):
        if joint.counterbalance is not None:
            slides = joint.type == "prismatic"
            torque[arm] -= balance_torque(joint.counterbalance, position[arm], slides=slides)


def _settle(
    model: ElasticModel, data: mujoco.MjData, linear: FloatArray, cubic: FloatArray, configuration: FloatArray
) -> FloatArray:
    position = np.zeros(model.mujoco.nv)
    # Encoders fix the motors; arms start where rigid gears would have them.
    position[model.motor] = model.robot.motor_per_arm @ configuration / model.turns
    position[model.arm] = configuration
    free = model.passive
    gravity: FloatArray = np.zeros((0, 0))
    before = 0.0
    for _ in range(_NEWTON_STEPS):
        deflection = model.deflection @ position
        slope = linear + 3 * cubic * deflection**2
        torque = linear * deflection + cubic * deflection**3
        besides = _gravity(model, data, position)
        if not gravity.size:
            gravity = gravity_gradient(model, data, position)
        gradient = gravity
        if model.varying:
            energy = 0.5 * linear * deflection**2 + 0.25 * cubic * deflection**4
            besides = besides + model.varying.load(position, energy)
            gradient = gradient + model.varying.gradient(position, energy, torque, model.deflection)
            factor = model.varying.factors(position)
            torque, slope = factor * torque, factor * slope
        # g(q) = E' tau_s(d) on the free coordinates; Newton's matrix has springs, gravity and varying stiffness.
        residual = (model.deflection.T @ torque + besides)[free]
        hessian = model.deflection.T @ (slope[:, None] * model.deflection)
        jacobian = (hessian + gradient)[np.ix_(free, free)]
        step = np.linalg.solve(jacobian, residual)
        position[free] -= step
        size = float(np.abs(step).max(initial=0.0))
        if size < _NEWTON_TOLERANCE_RAD:
            return position
        if size > _STALE * before:  # gravity's gradient, dear and nearly the same, is kept while steps shrink fast
            gravity = np.zeros((0, 0))
        before = size
    raise gives_way(model.robot, configuration)


def gives_way(robot: Robot, configuration: FloatArray | None = None) -> DataError:
    """Returns the refusal of a robot whose springs do not bear it in a configuration (n_joint,), or in some."""
    where = "" if configuration is None else f" in configuration {robot.shown(configuration)}"
    message = f"D205 no equilibrium under gravity{where}; the springs give way"
    return DataError(message, where=robot.name, remedy="check stiffness values and payload of the robot file")


def _gravity(model: ElasticModel, data: mujoco.MjData, position: FloatArray) -> FloatArray:
    data.qpos[:] = position
    data.qvel[:] = 0.0
    mujoco.mj_kinematics(model.mujoco, data)
    mujoco.mj_comPos(model.mujoco, data)
    torque = np.zeros(model.mujoco.nv)
    mujoco.mj_rne(model.mujoco, data, 0, torque)
    unload(model, position, torque)
    return torque


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    """Cross products (n, 3), a fifth of the time that numpy takes for few."""
    return np.asarray(first[..., _AFTER] * second[..., _BEFORE] - first[..., _BEFORE] * second[..., _AFTER])


def gravity_gradient(model: ElasticModel, data: mujoco.MjData, position: FloatArray) -> FloatArray:
    """Returns the gradient (n_dof, n_dof) of gravity's torque on all coordinates, counterbalances included [N m/rad].

    What turns about an axis turns the moment of mass of all that comes after it.

    Args:
        model: The elastic model.
        data: MuJoCo's, overwritten.
        position (n_dof,): Where.
    """
    data.qpos[:] = position
    mujoco.mj_kinematics(model.mujoco, data)
    mujoco.mj_comPos(model.mujoco, data)
    body, joint = model.mujoco.dof_bodyid, model.mujoco.dof_jntid
    turns = (model.mujoco.jnt_type[joint] == mujoco.mjtJoint.mjJNT_HINGE)[:, None]
    # Gravity's torque about an axis is that of the mass carried: its moment turns with every axis before it.
    mass, axis = model.mujoco.body_subtreemass[body, None], data.xaxis[joint]
    # m axis x (c - o) is how the first moment moves with a turn; m axis with a slide.
    moment = mass * np.where(turns, _cross(axis, data.subtree_com[body] - data.xanchor[joint]), axis)
    # -(g x a_i) . moment_j for j at or after i in the chain; the matrix is symmetric.
    later = -(_cross(model.mujoco.opt.gravity, axis) * turns) @ moment.T * model.carries
    gradient = later + np.triu(later, 1).T
    for own, arm in zip(model.robot.joints, model.arm, strict=True):
        if own.counterbalance is not None:
            slides = own.type == "prismatic"
            gradient[arm, arm] -= balance_slope(own.counterbalance, position[arm], slides=slides)
    return np.asarray(gradient)


def _inertia(
    model: ElasticModel, data: mujoco.MjData, position: FloatArray, to_spring: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Inertia matrix without rotors, and the rates (n_joint, 3, n) whose squares each link's inertia multiplies.

    These are its rotation rate about its joint axis, and two zeros; where it slides, the speed of its centre of mass.
    """
    data.qpos[:] = position
    mujoco.mj_forward(model.mujoco, data)
    mass = np.zeros((position.size, position.size))
    mujoco.mj_fullM(model.mujoco, data, mass)
    # MuJoCo has the rotors as inertia or armature; as parameters they are added in `mass_matrix`.
    mass[model.motor, model.motor] -= model.turns**2 * model.robot.motor_inertia_kgm2
    rates = np.zeros((len(model.robot.joints), 3, position.size))
    rotation = np.zeros((3, position.size))
    for row, joint in enumerate(model.robot.joints):
        body = model.mujoco.body(joint.name).id
        frame = data.xmat[body].reshape(3, 3)
        if joint.type == "prismatic":
            centre = data.xpos[body] + frame @ joint.link.com_m
            mujoco.mj_jac(model.mujoco, data, rates[row], None, centre, body)
            continue
        mujoco.mj_jacBody(model.mujoco, data, None, rotation, body)
        rates[row, 0] = frame[:, 2] @ rotation
    return mass, rates @ to_spring


def axial_inertia(model: ElasticModel) -> FloatArray:
    """Returns the links' own inertia (n_joint,) about their joint's direction, payload included [kg m^2]."""
    axial = []
    for joint in model.robot.joints:
        body = model.mujoco.body(joint.name)
        if joint.type == "prismatic":
            axial.append(float(body.mass[0]))
            continue
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, body.iquat)
        axial.append(float(rotation.reshape(3, 3)[2] ** 2 @ body.inertia))
    return np.array(axial)


def _outputs(model: ElasticModel, data: mujoco.MjData, names: tuple[str, ...]) -> FloatArray:
    """Outputs and gravity's part of them (2, n_out, n_dof) where `data` stands."""
    identity = np.eye(model.mujoco.nv)
    joints = [joint.name for joint in model.robot.joints]
    known = model.robot.output_names
    rows = np.zeros((2, len(names), model.mujoco.nv))
    for row, name in enumerate(names):
        if name not in known:
            message = f"D206 output `{name}` is nothing that the robot measures (known: {', '.join(known)})"
            remedy = "name the log's outputs after the robot's joints and sensors"
            raise DataError(message, where=model.robot.name, remedy=remedy)
        joint, _, side = name.partition(".")
        if joint in joints:
            index = joints.index(joint)
            rows[0, row] = identity[model.arm[index]] if side else model.motor_rows[index]
        else:
            rows[:, row] = _sensed(model, data, next(s for s in model.robot.sensors if s.name == name))
    return rows


def _in_springs(model: ElasticModel, names: tuple[str, ...], rows: FloatArray, to_spring: FloatArray) -> FloatArray:
    """Outputs in spring coordinates; a motor's own angle is a coordinate, whatever rounding says."""
    found = np.asarray(rows @ to_spring)
    joints = [joint.name for joint in model.robot.joints]
    for row, name in enumerate(names):
        if name in joints:
            found[:, row] = 0.0
            found[0, row, joints.index(name)] = 1.0
    return found


def _sensed(model: ElasticModel, data: mujoco.MjData, sensor: Sensor) -> FloatArray:
    """A sensor's rows (2, n_dof): its position along its axis, and its turn out of gravity's way."""
    moving, turning = np.zeros((3, model.mujoco.nv)), np.zeros((3, model.mujoco.nv))
    site = model.mujoco.site(site_name(sensor)).id
    mujoco.mj_jacSite(model.mujoco, data, moving, turning, site)
    if sensor.kind == "tracker":
        return np.stack([sensor.axis @ moving, np.zeros(model.mujoco.nv)])
    # An accelerometer's axis turns with the link: gravity along it changes by (axis x g) . turn.
    axis = data.site_xmat[site].reshape(3, 3) @ sensor.axis
    return np.stack([axis @ moving, np.cross(axis, model.mujoco.opt.gravity) @ turning])
