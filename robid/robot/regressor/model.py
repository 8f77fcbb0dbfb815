"""The rigid model of a robot: its standard parameters, and the regressor that makes torques of them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robid.arrays import FloatArray, check_shape
from robid.robot.description import Inertial, Robot
from robid.robot.inertia import combine
from robid.robot.parameters import PARAMETER_KINDS, RigidKind
from robid.robot.regressor.drives import DriveMotion, DriveTerm, drive_terms
from robid.robot.regressor.links import COMPONENTS, INERTIAS, MOMENTS, add_inertial_columns, standard_parameters
from robid.robot.regressor.options import RigidOptions
from robid.robot.regressor.tree import Tree, rigid_tree

_PAYLOAD = "payload"
_BLOCK = 4096


@dataclass(frozen=True)
class StandardParameter:
    """A parameter that the torques are linear in.

    Attributes:
        name: Its name: the joint, loop link or `payload` it belongs to, a dot, and what it is.
        kind: Its kind in `robid.robot.parameters`.
        unit: Its unit.
        nominal: Its value by the robot file.
    """

    name: str
    kind: RigidKind
    unit: str
    nominal: float


@dataclass(frozen=True)
class RigidModel:
    """A rigid robot whose motor torques are linear in its standard parameters; everything on the motor side.

    Attributes:
        robot: The robot; its springs are taken as rigid.
        options: What it has beside its links.
        tree: Its bodies.
        terms: Its motors, coupled gears and counterbalances.
        parameters: All standard parameters, in the order of the columns: links, loop links, rotors that ride on
            links, the payload if it is a body of its own, then the terms.
    """

    robot: Robot
    options: RigidOptions
    tree: Tree
    terms: tuple[DriveTerm, ...]
    parameters: tuple[StandardParameter, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names (n_std) of the standard parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def kinds(self) -> tuple[RigidKind, ...]:
        """Kinds (n_std) of the standard parameters."""
        return tuple(parameter.kind for parameter in self.parameters)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Units (n_std) of the standard parameters."""
        return tuple(parameter.unit for parameter in self.parameters)

    @property
    def nominal(self) -> FloatArray:
        """Values (n_std,) of the standard parameters by the robot file."""
        return np.array([parameter.nominal for parameter in self.parameters])

    @property
    def needs_torque(self) -> bool:
        """Whether the columns ask for the motors' torques."""
        return self.options.friction == "load"

    def columns(
        self,
        position: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        *,
        torque: FloatArray | None = None,
        friction_speed: FloatArray | None = None,
        loaded: bool = True,
    ) -> FloatArray:
        """Computes the regressor `W`: motor torques are `W @ parameters`.

        Args:
            position (n_sample, n_joint): Motor angles [rad].
            velocity (n_sample, n_joint): Motor speeds [rad/s].
            acceleration (n_sample, n_joint): Motor accelerations [rad/s^2].
            torque (n_sample, n_joint): Motor torques that friction grows with, for load-dependent friction [N m].
            friction_speed (n_sample, n_joint): Motor speeds that give Coulomb and asymmetric friction their sign, such
                as those of a model; `velocity` by default [rad/s].
            loaded: Whether a payload with parameters of its own is there.

        Returns:
            Regressor (n_sample, n_joint, n_std), a view of an array with samples last: each column is contiguous.

        Raises:
            ValueError: If shapes differ, or load-dependent friction has no torque.

        Source:
            Janot et al. (2009), eq. 2.
        """
        n_joint, n_sample = len(self.robot.joints), len(position)
        sense = velocity if friction_speed is None else friction_speed
        if self.needs_torque and torque is None:
            message = "load-dependent friction needs the motors' torques"
            raise ValueError(message)
        load = np.zeros((n_sample, n_joint)) if torque is None else torque
        given = {"position": position, "velocity": velocity, "acceleration": acceleration}
        for name, array in (given | {"friction_speed": sense, "torque": load}).items():
            check_shape(name, array, "n_sample n_joint", n_sample=n_sample, n_joint=n_joint)
        motion = [np.ascontiguousarray(array.T, float) for array in (position, velocity, acceleration, sense, load)]
        out = np.zeros((n_joint, len(self.parameters), n_sample))
        add_inertial_columns(self.tree, *motion[:3], out)
        column = len(self.parameters) - len(self.terms)
        if self.options.payload == "body":
            column -= len(COMPONENTS)
            if loaded:
                last = len(COMPONENTS) * (n_joint - 1)
                out[:, column : column + len(COMPONENTS)] = out[:, last : last + len(COMPONENTS)]
            column += len(COMPONENTS)
        for index, term in enumerate(self.terms, start=column):
            _add_term(term, motion, out[:, index])
        return np.moveaxis(out, 2, 0)

    def torques(
        self,
        parameters: FloatArray,
        position: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        *,
        torque: FloatArray | None = None,
        friction_speed: FloatArray | None = None,
        loaded: bool = True,
    ) -> FloatArray:
        """Computes motor torques (n_sample, n_joint) from standard parameters (n_std,), a few samples at a time [N m].

        The other arguments are those of `columns`.
        """
        result = np.empty(position.shape)
        for start in range(0, len(position), _BLOCK):
            rows = slice(start, start + _BLOCK)
            columns = self.columns(
                position[rows],
                velocity[rows],
                acceleration[rows],
                torque=None if torque is None else torque[rows],
                friction_speed=None if friction_speed is None else friction_speed[rows],
                loaded=loaded,
            )
            result[rows] = np.einsum("kfn,f->nk", np.moveaxis(columns, 0, 2), parameters)
        return result


def build_rigid_model(robot: Robot, options: RigidOptions | None = None) -> RigidModel:
    """Builds the rigid model of a robot.

    Args:
        robot: The robot; its springs are taken as rigid.
        options: What it has beside its links.
    """
    chosen = options or RigidOptions()
    tree = rigid_tree(robot)
    if not chosen.motor_inertias:
        kept = [index for index, body in enumerate(tree.bodies) if not body.is_rotor]
        bodies = tuple(tree.bodies[index] for index in kept)
        tree = Tree(bodies, tree.turns[kept], tree.offset[kept], tree.gravity_m_s2)
    terms = tuple(drive_terms(robot, chosen))
    parameters = (
        *_body_parameters(robot, tree, chosen),
        *(StandardParameter(term.name, term.kind, term.unit, term.nominal) for term in terms),
    )
    return RigidModel(robot, chosen, tree, terms, parameters)


def arm_columns(robot: Robot, position: FloatArray, velocity: FloatArray, acceleration: FloatArray) -> FloatArray:
    """Computes the arm side's regressor of links and loop links alone.

    Args:
        robot: The robot.
        position (n_sample, n_joint): Arm positions [rad, or m].
        velocity (n_sample, n_joint): Arm speeds.
        acceleration (n_sample, n_joint): Arm accelerations.

    Returns:
        Regressor (n_sample, n_joint, 10 n_body) of the joints' torques and forces, a view with samples last; each
        body's columns are those of `COMPONENTS`.
    """
    tree = rigid_tree(robot, "arm")
    out = np.zeros((len(robot.joints), len(COMPONENTS) * len(tree.bodies), len(position)))
    motion = (np.ascontiguousarray(array.T, float) for array in (position, velocity, acceleration))
    add_inertial_columns(tree, *motion, out)
    return np.moveaxis(out, 2, 0)


def _body_parameters(robot: Robot, tree: Tree, options: RigidOptions) -> list[StandardParameter]:
    links = [joint.link for joint in robot.joints]
    has_payload = robot.payload.mass_kg > 0
    if options.payload == "link" and has_payload:
        links[-1] = combine(links[-1], robot.payload)
    links += [link.link for link in robot.loop_links]
    found: list[StandardParameter] = []
    inertias = {joint.name: joint.motor.inertia_kgm2 for joint in robot.joints}
    for body, link in zip(tree.bodies, links, strict=False):
        found += _components(body.name, link)
    for body in tree.bodies[len(links) :]:
        unit = PARAMETER_KINDS["motor_inertia"].unit
        found.append(StandardParameter(f"{body.name}.motor_inertia", "motor_inertia", unit, inertias[body.name]))
    if options.payload == "body":
        found += _components(_PAYLOAD, robot.payload)
    return found


def _components(owner: str, body: Inertial) -> list[StandardParameter]:
    found = []
    for component, value in zip(COMPONENTS, standard_parameters(body).tolist(), strict=True):
        kind: RigidKind = "mass"
        if component in INERTIAS:
            kind = "inertia"
        elif component in MOMENTS:
            kind = "first_moment"
        found.append(StandardParameter(f"{owner}.{component}", kind, PARAMETER_KINDS[kind].unit, value))
    return found


def _add_term(term: DriveTerm, motion: list[FloatArray], out: FloatArray) -> None:
    """Adds a term to its column (n_joint, n_sample); `motion` has positions, speeds, accelerations, senses, loads."""
    moved = np.flatnonzero(term.row)
    own = [np.tensordot(term.row[moved], array[moved], 1) for array in motion]
    effect = term.effect(DriveMotion(own[0], own[1], own[2], np.sign(own[3]), own[4]))
    for index in moved:
        out[index] += term.row[index] * effect
