"""Forward dynamics of a rigid model: the accelerations that motor torques give."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.robot.regressor.drives import DriveMotion, DriveTerm
from robid.robot.regressor.links import COMPONENTS, ROTOR, BodyMotion, Tree, body_motions, empty_states
from robid.robot.regressor.model import RigidModel

_INERTIAL = ("motor_inertia", "coupling_inertia")


@dataclass(frozen=True)
class RigidDynamics:
    """A rigid robot with given parameters, or one of its kind for each sample; everything on the motor side."""

    tree: Tree
    # Of each body the matrix (6, 6, 1 or n_sample) that makes a momentum, first the angular one about its frame's
    # origin, of angular velocity and velocity of that origin
    inertias: tuple[FloatArray, ...]
    motor: FloatArray  # (n_joint, n_joint, 1 or n_sample) Inertia of what turns with motors and coupled gears [kg m^2]
    terms: tuple[tuple[DriveTerm, FloatArray], ...]  # Terms without inertia, each with its parameter (1 or n_sample,)
    smoothing_rad_s: float = 0.0  # Speed over which Coulomb friction changes its sign, as tanh; 0 for a jump

    def inertia_and_bias(
        self, position: FloatArray, velocity: FloatArray, torque: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Computes the inertia matrix and the torque that holds the speed.

        Args:
            position (n_sample, n_joint): Motor angles [rad].
            velocity (n_sample, n_joint): Motor speeds [rad/s].
            torque (n_sample, n_joint): Motor torques, for load-dependent friction [N m].

        Returns:
            Inertia matrices (n_sample, n_joint, n_joint) [kg m^2], and torques (n_sample, n_joint) of gravity,
            Coriolis forces, friction, offsets and counterbalances [N m].
        """
        q, v = np.ascontiguousarray(position.T), np.ascontiguousarray(velocity.T)
        inertia = np.zeros((*self.motor.shape[:2], len(position)))
        inertia += self.motor
        bias = np.zeros_like(q)
        states = empty_states(self.tree, len(position))
        motions = body_motions(self.tree, q, v, np.zeros_like(q), states)
        for state, body, motion in zip(states, self.inertias, motions, strict=True):
            reach = len(motion.turn)
            screws = state[2:].reshape(reach, 6, -1)
            # M = sum over bodies of S' I S, with S the screws of the coordinates that move it.
            inertia[:reach, :reach] += np.einsum("kcn,lcn->kln", screws, _act(body, screws))
            # The same screws project what gravity, centrifugal and Coriolis forces ask for at zero acceleration.
            bias[:reach] += np.einsum("kcn,cn->kn", screws, _wrench(motion, body))
        load = np.zeros_like(q) if torque is None else torque.T
        for term, parameter in self.terms:
            effect = parameter * term.effect(self._felt(term, q, v, load))
            bias += term.row[:, None] * effect
        return np.moveaxis(inertia, 2, 0), bias.T

    def acceleration(self, position: FloatArray, velocity: FloatArray, torque: FloatArray) -> FloatArray:
        """Computes motor accelerations (n_sample, n_joint) under motor torques (n_sample, n_joint) [rad/s^2]."""
        inertia, bias = self.inertia_and_bias(position, velocity, torque)
        return np.asarray(np.linalg.solve(inertia, (torque - bias)[..., None])[..., 0])

    def _felt(self, term: DriveTerm, position: FloatArray, velocity: FloatArray, torque: FloatArray) -> DriveMotion:
        speed = term.row @ velocity
        sense = np.tanh(speed / self.smoothing_rad_s) if self.smoothing_rad_s > 0 else np.sign(speed)
        return DriveMotion(term.row @ position, speed, np.zeros_like(speed), sense, term.row @ torque)


def build_dynamics(
    model: RigidModel, parameters: FloatArray | None = None, *, loaded: bool = True, smoothing_rad_s: float = 0.0
) -> RigidDynamics:
    """Builds the dynamics of a rigid model.

    Args:
        model: The model; of one with the columns of base parameters alone, these are enough.
        parameters (n_std,) or (n_sample, n_std): Values of its parameters, the same for all samples or one row for
            each; those of the robot file by default.
        loaded: Whether a payload with parameters of its own is there.
        smoothing_rad_s: Motor speed over which Coulomb friction changes its sign [rad/s].
    """
    values = np.atleast_2d(model.nominal if parameters is None else parameters).T
    inertias: list[FloatArray] = []
    start = 0
    for body, components in zip(model.tree.bodies, model.components, strict=True):
        own = np.zeros((len(COMPONENTS), values.shape[1]))
        if body.is_rotor and components:
            own = np.outer(ROTOR, values[start])
        elif loaded or not body.is_payload:
            own[list(components)] = values[start : start + len(components)]
        inertias.append(_momentum(own))
        start += len(components)
    motor = np.zeros((*(len(model.robot.joints),) * 2, values.shape[1]))
    terms: list[tuple[DriveTerm, FloatArray]] = []
    for term, value in zip(model.terms, values[start:], strict=True):
        if term.kind in _INERTIAL:
            # A term's torque on the motors is row' (I row q'').
            motor += np.outer(term.row, term.row)[..., None] * value
        else:
            terms.append((term, value))
    return RigidDynamics(model.tree, tuple(inertias), motor, tuple(terms), smoothing_rad_s)


def _momentum(parameters: FloatArray) -> FloatArray:
    """Momentum matrices (6, 6, n) of bodies' standard parameters (10, n)."""
    xx, xy, xz, yy, yz, zz, x, y, z, mass = parameters
    nothing = np.zeros_like(mass)
    # Momentum about the frame's origin: [[I_o, m c x], [-m c x, m 1]] of angular and linear velocity.
    moment = np.array([[nothing, -z, y], [z, nothing, -x], [-y, x, nothing]])
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    masses = np.eye(3)[..., None] * mass
    return np.concatenate(
        [np.concatenate([inertia, moment], axis=1), np.concatenate([-moment, masses], axis=1)], axis=0
    )


def _act(body: FloatArray, screws: FloatArray) -> FloatArray:
    """Momenta (..., 6, n_sample) of motions (..., c, n_sample) under a body's matrix (6, c, 1 or n_sample)."""
    if body.shape[2] == 1:
        return np.asarray(body[:, :, 0] @ screws)
    return np.asarray(np.einsum("cdn,...dn->...cn", body, screws))


def _wrench(motion: BodyMotion, body: FloatArray) -> FloatArray:
    """Torque about the origin and force (6, n_sample) that a body's motion takes."""
    # f = I a + v x* (I v), where the origin's own velocity has no part.
    wrench = _act(body, np.concatenate([motion.angular, motion.linear]))
    # Of the angular velocity alone: that of the origin is in its acceleration.
    momentum = _act(body[:, :3], motion.rate)
    wrench[:3] += _cross(motion.rate, momentum[:3])
    wrench[3:] += _cross(motion.rate, momentum[3:])
    return np.asarray(wrench)


def _cross(first: FloatArray, second: FloatArray) -> FloatArray:
    (a, b, c), (x, y, z) = first, second
    return np.array([b * z - c * y, c * x - a * z, a * y - b * x])
