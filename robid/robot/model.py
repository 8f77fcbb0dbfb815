"""The elastic robot in MuJoCo: motors, transmissions, bearings, split links, base, payload; its warnings kept quiet."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.errors import DataError
from robid.robot.actuators import (
    MASSLESS_KG,
    add_balance,
    add_elastic_hinge,
    add_motor,
    add_ramps,
    add_shafts,
    add_torque,
    motor_drives,
    quaternion_of,
    set_passive,
    shafts_of,
)
from robid.robot.bodies import Body, bodies_of, splits_of, springs_at
from robid.robot.description import HarmonicBalance, Inertial, Joint, Robot, Sensor, Spring
from robid.robot.friction import FrictionLaw
from robid.robot.spring_laws import VaryingSprings


@contextlib.contextmanager
def quiet_warnings() -> Iterator[list[str]]:
    """Collects MuJoCo's warnings instead of having them printed and written to `MUJOCO_LOG.TXT`."""
    before, told = mujoco.get_mju_user_warning(), []
    mujoco.set_mju_user_warning(lambda message: told.append(str(message)))
    try:
        yield told
    finally:
        mujoco.set_mju_user_warning(before)


@contextlib.contextmanager
def quiet_reading() -> Iterator[list[str]]:
    """Collects what MuJoCo warns of while it reads and compiles a file, which it says through Python, too."""
    with quiet_warnings() as told, warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always", UserWarning)
        try:
            yield told
        finally:
            told += [str(each.message) for each in raised]


_LEAST_KG = 1e-12  # MuJoCo wants some
_WEIGHTLESS = Body(Inertial(MASSLESS_KG, np.zeros(3), MASSLESS_KG * np.eye(3)), np.zeros(3))
_FAR = 1e9  # [rad, or m]: where no spring ever is
HYSTERESIS_SHARE = 0.1  # Stiffness of a transmission's bristles over its own


@dataclass(frozen=True)
class ElasticModel:
    """A compiled elastic robot; all joints are hinges and slides, so positions and velocities share indices."""

    robot: Robot
    mujoco: mujoco.MjModel
    spec: mujoco.MjSpec
    motor: IntArray  # (n_joint,) Indices of coordinates that motors drive: `q_m`, or arm angles of rigid joints
    turns: FloatArray  # (n_joint,) Motor angle per unit of these: 1, or the gear ratio of a rigid joint
    arm: IntArray  # (n_joint,) Indices of the arm positions `q_a`
    # (n_passive,) Indices of elastic joints' arm positions and of elastic angles `q_e`: all that gravity deflects
    passive: IntArray
    deflection: FloatArray  # (n_spring, n_dof) Spring deflection per coordinate: `delta = deflection @ q`

    @cached_property
    def scratch(self) -> mujoco.MjData:
        """MuJoCo's data to evaluate kinematics in, overwritten by whoever does next: to make one takes as long."""
        return mujoco.MjData(self.mujoco)

    @cached_property
    def motor_rows(self) -> FloatArray:
        """Motor angles per coordinate (n_joint, n_dof)."""
        return np.asarray(self.turns[:, None] * np.eye(self.mujoco.nv)[self.motor])

    @cached_property
    def varying(self) -> VaryingSprings:
        """The springs whose stiffness depends on a joint's position."""
        return VaryingSprings(self.robot.springs, self.arm)

    @cached_property
    def carries(self) -> BoolArray:
        """Whether a coordinate moves all that another one moves (n_dof, n_dof), itself included."""
        found = np.eye(self.mujoco.nv, dtype=bool)
        for index, before in enumerate(self.mujoco.dof_parentid.tolist()):
            if before >= 0:
                # A coordinate is carried by all its ancestors in the tree.
                found[:, index] |= found[:, before]
        return found

    @cached_property
    def to_spring(self) -> FloatArray:
        """Coordinates (n_dof, n_dof) per motor angle and spring deflection."""
        return np.asarray(np.linalg.inv(np.vstack([self.motor_rows, self.deflection])))

    def motor_angles(self, position: FloatArray) -> FloatArray:
        """Returns the motor angles (..., n_joint) in some positions (..., n_dof) [rad]."""
        return np.asarray(position[..., self.motor] * self.turns)


def build_model(
    robot: Robot,
    *,
    friction: FrictionLaw | None = None,
    ripple: bool = False,
    second_ripple: tuple[float, int] = (0.0, 1),
    backlash: tuple[float, float] = (0.0, 0.0),
    hysteresis: tuple[float, float] = (0.0, 0.0),
    one_sided: float = 0.0,
    bristles: Mapping[str, float] | None = None,
    timestep_s: float = 1e-3,
    sensors: bool = False,
    balanced: bool = False,
) -> ElasticModel:
    """Builds the elastic MuJoCo model of a robot; its controls are the motor torques [N m].

    Args:
        robot: The robot.
        friction: Adds friction to the motors inside the integrator. Polygons of a law without memory come after all
            motors, with controls that stay zero.
        ripple: Adds torque ripple to the motors inside the integrator.
        second_ripple: A further ripple of all motors: amplitude [N m] and periods per motor turn.
        backlash: Dead band of the transmissions, arm side: of revolute [rad] and of prismatic joints [m].
        hysteresis: Bristle load parallel to the transmissions, arm side: the same two [N m, N].
        one_sided: Share by which transmissions are stiffer than stated where they are bent positively, and softer where
            negatively; their cubic coefficients are the same both ways.
        bristles: Hysteresis of single transmissions, by their names.
        timestep_s: Integration step [s].
        sensors: Adds MuJoCo sensors for those of the robot; their sites are always there.
        balanced: Takes counterbalances, which act in statics and linearization; those by harmonics in the engine too,
            those between two points where a simulation applies them.

    Raises:
        ValueError: If rotors ride on the links and a joint is rigid.
        DataError: If the robot has counterbalances that are not taken, closed loops or rigid joints that several motors
            move, which only the rigid model knows.

    Source:
        Zimmermann et al. (2023), eq. 1; Wernholt and Moberg (2008), sec. 3.
    """
    _check_known(robot, balanced=balanced)
    _check_rigid(robot)
    spec = mujoco.MjSpec()
    spec.option.timestep = timestep_s
    # RK4 hardly damps modes that its steps resolve; implicit integrators would damp the stiffest ones.
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.option.gravity = robot.gravity_m_s2
    flags = mujoco.mjtDisableBit
    spec.option.disableflags = int(flags.mjDSBL_CONTACT) | int(flags.mjDSBL_AUTORESET)
    parent, offset = _add_base(spec.worldbody, robot)
    for index, joint in enumerate(robot.joints):
        # Spong's assumption: a rotor's energy is that of its own turn alone, as if it stood in the world.
        carrier = parent if robot.rotor == "on_link" else spec.worldbody
        if not robot.rigid[index]:
            add_shafts(add_motor(carrier, joint, offset, robot.rotor), robot, index)
        parent, offset = _add_link(parent, joint, index, offset, robot)
        _add_sites(parent, robot, index, offset)
    parent, offset = _add_payload(parent, robot, offset)
    _add_sites(parent, robot, None, offset)
    for name, each in bodies_of(robot).items():
        _set_inertial(spec.body(name), each)
    for spring in robot.springs:
        if spring.place == "transmission":
            linear = robot.is_linear(spring)
            own = (bristles or {}).get(spring.name, hysteresis[linear])
            tendon = _add_transmission(spec, robot, spring, backlash[linear], own)
            if one_sided:
                _stiffen_one_way(spec, robot, spring, tendon, one_sided)
    for joint, drive in zip(robot.joints, motor_drives(robot), strict=True):
        add_torque(spec, joint, drive, friction=friction, ripple=ripple, second_ripple=second_ripple)
        if isinstance(joint.counterbalance, HarmonicBalance):
            add_balance(spec, joint, joint.counterbalance)
    if friction is not None:
        for joint, drive in zip(robot.joints, motor_drives(robot), strict=True):
            add_ramps(spec, joint, drive, friction)
    for sensor in robot.sensors if sensors else ():
        kind = mujoco.mjtSensor.mjSENS_FRAMEPOS if sensor.kind == "tracker" else mujoco.mjtSensor.mjSENS_ACCELEROMETER
        spec.add_sensor(name=sensor.name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=site_name(sensor))
    return _compile(spec, robot)


def _check_known(robot: Robot, *, balanced: bool) -> None:
    pairs = list(zip(robot.joints, robot.rigid, strict=True))
    unknown = [
        f"the counterbalance of `{joint.name}`" for joint in robot.joints if joint.counterbalance and not balanced
    ]
    unknown += [
        f"the motors that move the rigid joint `{joint.name}`"
        for joint, is_rigid in pairs
        if is_rigid and joint.couplings
    ]
    unknown += [f"the loop link `{link.name}`" for link in robot.loop_links]
    if unknown:
        raise DataError(
            f"D207 the elastic model does not know {unknown[0]}",
            where=robot.name,
            remedy="use the rigid family, or a robot file without it",
        )


def _check_rigid(robot: Robot) -> None:
    rigid = [joint for joint, is_rigid in zip(robot.joints, robot.rigid, strict=True) if is_rigid]
    if any(robot.rigid[spring.joint] for spring in robot.springs if spring.place == "shaft"):
        message = "a shaft lies between a motor and its transmission, and a rigid joint has none"
        raise ValueError(message)
    if rigid and robot.rotor == "on_link":
        message = "rotors of rigid joints cannot ride on the links: `rotor` must be `spong`"
        raise ValueError(message)


def _add_base(world: mujoco.MjsBody, robot: Robot) -> tuple[mujoco.MjsBody, FloatArray]:
    """Adds what base springs carry beneath the first joint; returns it with its origin."""
    origin: FloatArray = np.zeros(3)
    parent, springs = world, springs_at(robot, "base")
    for spring in springs:
        parent = _add_hinged(parent, spring, spring.point_m - origin)
        origin = spring.point_m
    return parent, origin


def _add_payload(parent: mujoco.MjsBody, robot: Robot, origin: FloatArray) -> tuple[mujoco.MjsBody, FloatArray]:
    """Hangs the payload on its springs, the first one nearest to the arm; returns it with its origin."""
    springs = springs_at(robot, "payload")
    for spring in springs:
        parent = _add_hinged(parent, spring, spring.point_m - origin)
        origin = spring.point_m
    return parent, origin


def site_name(sensor: Sensor) -> str:
    """Returns the name of a sensor's site."""
    return f"sensor_{sensor.name}"


def _add_sites(body: mujoco.MjsBody, robot: Robot, joint: int | None, origin: FloatArray) -> None:
    for sensor in robot.sensors:
        if sensor.joint == joint:
            body.add_site(name=site_name(sensor), pos=sensor.point_m - origin)


def _add_hinged(parent: mujoco.MjsBody, spring: Spring, offset: FloatArray) -> mujoco.MjsBody:
    """Adds a body of no weight on an elastic hinge."""
    body = parent.add_body(name=f"{spring.place}_{spring.name}", pos=offset)
    add_elastic_hinge(body, spring)
    _set_inertial(body, _WEIGHTLESS)
    return body


def _add_link(
    parent: mujoco.MjsBody, joint: Joint, index: int, offset: FloatArray, robot: Robot
) -> tuple[mujoco.MjsBody, FloatArray]:
    """Adds a joint with its link, part by part from the joint outwards; returns the last part with its origin."""
    body = parent.add_body(name=joint.name, pos=joint.position_m - offset, quat=quaternion_of(joint.rotation))
    bearings = [spring for spring in robot.springs if spring.joint == index and spring.place == "bearing"]
    # Bearings stay where a joint turns, and ride on what slides.
    for spring in bearings if joint.type == "revolute" else ():
        add_elastic_hinge(body, spring)
    _add_arm(body, joint, rigid=bool(robot.rigid[index]))
    for spring in bearings if joint.type == "prismatic" else ():
        add_elastic_hinge(body, spring)
    origin: FloatArray = np.zeros(3)
    for spring, _ in splits_of(robot, index):
        body = body.add_body(name=f"{joint.name}_{spring.name}", pos=spring.point_m - origin)
        add_elastic_hinge(body, spring)
        origin = spring.point_m
    return body, origin


def _add_arm(body: mujoco.MjsBody, joint: Joint, *, rigid: bool) -> None:
    kind = mujoco.mjtJoint.mjJNT_SLIDE if joint.type == "prismatic" else mujoco.mjtJoint.mjJNT_HINGE
    arm = body.add_joint(name=f"q_a_{joint.name}", type=kind, axis=[0, 0, 1])
    if rigid:
        motor = joint.motor
        # A rigid gear reflects the rotor as n^2 J, and its viscous friction as n^2 d.
        arm.armature = motor.gear_ratio**2 * motor.inertia_kgm2
    moving = joint.motor.gear_ratio**2 * joint.motor.friction.viscous_nms_rad if rigid else 0.0
    arm.damping = np.array([moving + joint.arm_viscous, 0.0, 0.0])


def _set_inertial(body: mujoco.MjsBody, own: Body) -> None:
    tensor = own.inertial.inertia_kgm2
    body.explicitinertial = True
    body.mass = max(own.inertial.mass_kg, _LEAST_KG)
    body.ipos = own.inertial.com_m - own.origin
    body.fullinertia = [tensor[0, 0], tensor[1, 1], tensor[2, 2], tensor[0, 1], tensor[0, 2], tensor[1, 2]]


def _add_transmission(
    spec: mujoco.MjSpec, robot: Robot, spring: Spring, backlash: float, hysteresis: float
) -> mujoco.MjsTendon:
    tendon = _add_gear_tendon(spec, robot, spring, spring.name)
    tendon.stiffness = np.array([spring.stiffness, 0.0, spring.cubic])
    tendon.damping = np.array([spring.damping, 0.0, 0.0])
    tendon.springlength = [-0.5 * backlash, 0.5 * backlash]
    if hysteresis > 0:
        bristle = HYSTERESIS_SHARE * spring.stiffness
        # Equal Coulomb and breakaway levels without bristle damping: LuGre is then Dahl's element.
        law = [bristle, 0.0, hysteresis, hysteresis, 1.0]
        bristles = spec.add_actuator(
            name=f"hysteresis_{robot.joints[spring.joint].name}",
            trntype=mujoco.mjtTrn.mjTRN_TENDON,
            target=spring.name,
        )
        set_passive(bristles, lugre=law)
    return tendon


def _add_gear_tendon(spec: mujoco.MjSpec, robot: Robot, spring: Spring, name: str) -> mujoco.MjsTendon:
    """Adds a tendon whose length is a gear's deflection: arm motion per motor turns, less the arm."""
    tendon = spec.add_tendon(name=name)
    for index, (drive, turns) in enumerate(motor_drives(robot)):
        arm = float(robot.arm_per_motor[spring.joint, index])
        if arm != 0:
            tendon.wrap_joint(drive, arm * turns)
            for shaft in shafts_of(robot, index):
                tendon.wrap_joint(f"q_e_{shaft.name}", arm)
    tendon.wrap_joint(f"q_a_{robot.joints[spring.joint].name}", -1.0)
    return tendon


def _stiffen_one_way(spec: mujoco.MjSpec, robot: Robot, spring: Spring, tendon: mujoco.MjsTendon, share: float) -> None:
    """Makes a gear softer by a share both ways, and adds a spring that only pulls the stiffer way, by twice of it."""
    slack = tendon.springlength[1] * np.array([-1.0, 1.0])
    slack[0 if share > 0 else 1] = -np.sign(share) * _FAR
    further = _add_gear_tendon(spec, robot, spring, f"{spring.name}_one_sided")
    further.springlength = slack
    further.stiffness = np.array([2 * abs(share) * spring.stiffness, 0.0, 0.0])
    tendon.stiffness = np.array([(1 - abs(share)) * spring.stiffness, 0.0, spring.cubic])


def _compile(spec: mujoco.MjSpec, robot: Robot) -> ElasticModel:
    try:
        model = spec.compile()
    except ValueError as error:
        message = f"D208 there is no such robot: {' '.join(str(error).split())}"
        raise DataError(message, remedy="correct the masses and inertias of the robot file") from error
    names = [joint.name for joint in robot.joints]
    drives = motor_drives(robot)
    motor = np.array([model.joint(name).dofadr[0] for name, _ in drives])
    turns = np.array([turn for _, turn in drives])
    arm = np.array([model.joint(f"q_a_{name}").dofadr[0] for name in names])
    deflection = np.zeros((len(robot.springs), model.nv))
    for row, spring in enumerate(robot.springs):
        if spring.place == "transmission":
            deflection[row, motor] = robot.arm_per_motor[spring.joint] * turns
            deflection[row, arm[spring.joint]] = -1.0
            for shaft in (each for each in robot.springs if each.place == "shaft"):
                twist = model.joint(f"q_e_{shaft.name}").dofadr[0]
                deflection[row, twist] = robot.arm_per_motor[spring.joint, shaft.joint]
        else:
            deflection[row, model.joint(f"q_e_{spring.name}").dofadr[0]] = 1.0
    # What motors do not drive is free to settle: arms behind elastic gears, and all elastic angles.
    passive = np.setdiff1d(np.arange(model.nv), motor)
    return ElasticModel(robot, model, spec, motor, turns, arm, passive, deflection)
