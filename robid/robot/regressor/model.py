"""The rigid model of a robot: its standard parameters, and the regressor that makes torques of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robid.arrays import FloatArray, check_shape
from robid.robot.description import Inertial, Robot
from robid.robot.inertia import combine
from robid.robot.parameters import PARAMETER_KINDS, RigidKind
from robid.robot.regressor.drives import DriveMotion, DriveTerm, RigidOptions, drive_terms
from robid.robot.regressor.links import (
    COMPONENTS,
    INERTIAS,
    MOMENTS,
    PAYLOAD,
    Tree,
    add_inertial_columns,
    rigid_tree,
    standard_parameters,
)

_BLOCK = 4096


@dataclass(frozen=True)
class StandardParameter:
    """A parameter that the torques are linear in."""

    name: str  # Its name: the joint, loop link or `payload` it belongs to, a dot, and what it is
    kind: RigidKind
    unit: str
    nominal: float


@dataclass(frozen=True)
class RigidModel:
    """A rigid robot whose motor torques are linear in its standard parameters; everything on the motor side."""

    robot: Robot
    options: RigidOptions
    tree: Tree
    # For each body which of its ten standard parameters are among the columns, ascending; of a rotor that rides on a
    # link its inertia, 0
    components: tuple[tuple[int, ...], ...]
    terms: tuple[DriveTerm, ...]  # Its motors, coupled gears and counterbalances
    # The parameters of the columns: links, loop links, rotors that ride on links, the payload if it is a body of its
    # own, then the terms
    parameters: tuple[StandardParameter, ...]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names (n_std) of the parameters."""
        return tuple(parameter.name for parameter in self.parameters)

    @cached_property
    def kinds(self) -> tuple[RigidKind, ...]:
        """Kinds (n_std) of the parameters."""
        return tuple(parameter.kind for parameter in self.parameters)

    @cached_property
    def units(self) -> tuple[str, ...]:
        """Units (n_std) of the parameters."""
        return tuple(parameter.unit for parameter in self.parameters)

    @property
    def nominal(self) -> FloatArray:
        """Values (n_std,) of the parameters by the robot file."""
        return np.array([parameter.nominal for parameter in self.parameters])

    @property
    def needs_torque(self) -> bool:
        """Whether the columns ask for the motors' torques."""
        return any(term.kind == "load_friction" for term in self.terms)

    def only(self, columns: Sequence[int]) -> RigidModel:
        """Returns the model with some of its columns alone, such as those of base parameters.

        Args:
            columns: Their indices, ascending.

        Raises:
            ValueError: If they are not ascending.
        """
        if list(columns) != sorted(set(columns)):
            message = f"Argument `columns` must be ascending, but is {tuple(columns)}."
            raise ValueError(message)
        kept, components, start = set(columns), [], 0
        for own in self.components:
            components.append(tuple(component for index, component in enumerate(own, start=start) if index in kept))
            start += len(own)
        terms = tuple(term for index, term in enumerate(self.terms, start=start) if index in kept)
        parameters = tuple(self.parameters[index] for index in columns)
        return replace(self, components=tuple(components), terms=terms, parameters=parameters)

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
            Some ten thousand samples at a time are fastest.

        Raises:
            ValueError: If shapes differ, or load-dependent friction has no torque.

        Source:
            Janot et al. (2009), eq. 2.
        """
        motion = self._motion(position, velocity, acceleration, friction_speed, torque)
        out = np.zeros((len(self.robot.joints), len(self.parameters), len(position)))
        pairs = zip(self.tree.bodies, self.components, strict=True)
        components = [() if body.is_payload and not loaded else own for body, own in pairs]
        add_inertial_columns(self.tree, motion[0], motion[1], motion[2], components, out)
        for index, term in enumerate(self.terms, start=len(self.parameters) - len(self.terms)):
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
        """Computes motor torques (n_sample, n_joint) from parameters (n_std,), a few samples at a time [N m].

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

    def _motion(
        self,
        position: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        friction_speed: FloatArray | None,
        torque: FloatArray | None,
    ) -> list[FloatArray]:
        """Positions, speeds, accelerations, speeds for the signs and torques, samples last."""
        if self.needs_torque and torque is None:
            message = "load-dependent friction needs the motors' torques"
            raise ValueError(message)
        given = {
            "position": position,
            "velocity": velocity,
            "acceleration": acceleration,
            "friction_speed": velocity if friction_speed is None else friction_speed,
            "torque": np.zeros_like(position) if torque is None else torque,
        }
        for name, array in given.items():
            check_shape(name, array, "n_sample n_joint", n_sample=len(position), n_joint=len(self.robot.joints))
        return [np.ascontiguousarray(array.T, float) for array in given.values()]


def build_rigid_model(robot: Robot, options: RigidOptions | None = None) -> RigidModel:
    """Builds the rigid model of a robot.

    Args:
        robot: The robot; its springs are taken as rigid.
        options: What it has beside its links.
    """
    chosen = options or RigidOptions()
    tree = rigid_tree(robot, rotors=chosen.motor_inertias, payload=chosen.payload == "body")
    inertials = _inertials(robot, chosen)
    drives = robot.motor_inertia_kgm2 + robot.shaft_inertia_kgm2
    rotors = {joint.name: float(inertia) for joint, inertia in zip(robot.joints, drives, strict=True)}
    parameters: list[StandardParameter] = []
    for body in tree.bodies:
        if body.is_rotor:
            parameters.append(_parameter(body.name, "motor_inertia", "motor_inertia", rotors[body.name]))
        else:
            values = standard_parameters(inertials[body.name]).tolist()
            pairs = zip(COMPONENTS, values, strict=True)
            parameters += [_parameter(body.name, name, _kind(name), value) for name, value in pairs]
    terms = tuple(drive_terms(robot, chosen))
    parameters += [StandardParameter(term.name, term.kind, term.unit, term.nominal) for term in terms]
    components = tuple((0,) if body.is_rotor else tuple(range(len(COMPONENTS))) for body in tree.bodies)
    return RigidModel(robot, chosen, tree, components, terms, tuple(parameters))


def _inertials(robot: Robot, options: RigidOptions) -> dict[str, Inertial]:
    """Mass properties of all bodies but rotors by name."""
    found = {joint.name: joint.link for joint in robot.joints} | {link.name: link.link for link in robot.loop_links}
    if options.payload == "body":
        return found | {PAYLOAD: robot.payload}
    if robot.payload.mass_kg > 0:
        last = robot.joints[-1]
        found[last.name] = combine(last.link, robot.payload)
    return found


def _kind(component: str) -> RigidKind:
    if component in INERTIAS:
        return "inertia"
    return "first_moment" if component in MOMENTS else "mass"


def _parameter(owner: str, component: str, kind: RigidKind, nominal: float) -> StandardParameter:
    return StandardParameter(f"{owner}.{component}", kind, PARAMETER_KINDS[kind].unit, nominal)


def _add_term(term: DriveTerm, motion: Sequence[FloatArray], out: FloatArray) -> None:
    """Adds a term to its column (n_joint, n_sample); `motion` has positions, speeds, accelerations, senses, torques."""
    moved = np.flatnonzero(term.row)
    if moved.size == 1 and term.row[moved[0]] == 1:
        own = [array[moved[0]] for array in motion]
    else:
        own = [np.tensordot(term.row[moved], array[moved], 1) for array in motion]
    effect = term.effect(DriveMotion(own[0], own[1], own[2], np.sign(own[3]), own[4]))
    for index in moved:
        out[index] += term.row[index] * effect
