"""What every closed-loop simulation does with the engine: true robot, what follows its motion, quiet, explosions."""

from __future__ import annotations

import contextlib
import ctypes
from collections.abc import Iterator
from pathlib import Path

import mujoco
import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.robot.actuators import friction_rows
from robid.robot.balances import PointBalance, balance_torque
from robid.robot.description import Robot
from robid.robot.friction import LAWS, SIGN_SHARE, FrictionLaw, Ramps
from robid.robot.linearize import Equilibrium, solve_statics
from robid.robot.model import ElasticModel, build_model, quiet_warnings
from robid.simulate.gear_error import GearErrors, with_gear_error
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from robid.simulate.truth import warmed, with_imperfections


def true_model(
    robot: Robot, controller: Controller, options: SimulateOptions, index: int = 0, *, sensors: bool
) -> ElasticModel:
    """Builds the robot with the imperfections that act inside the integrator; the number of steps is settled.

    It is as it is in a configuration of an index, for its friction may drift from one to the next.
    """
    flaws = options.imperfections
    if options.steps_per_sample is None:
        message = "the number of steps per sample must be settled first"
        raise ValueError(message)
    return build_model(
        warmed(with_imperfections(robot, flaws), flaws, index),
        friction=LAWS.get(flaws.friction),
        ripple=flaws.ripple,
        second_ripple=(flaws.second_ripple_nm, flaws.second_ripple_order),
        backlash=(flaws.backlash_rad, flaws.backlash_m),
        hysteresis=(flaws.hysteresis_nm, flaws.hysteresis_n),
        one_sided=flaws.one_sided,
        timestep_s=controller.sampling_period_s / options.steps_per_sample,
        sensors=sensors,
        balanced=True,
    )


def rest_of(model: ElasticModel, configuration: FloatArray, flaws: Imperfections) -> Equilibrium:
    """Returns where a robot rests whose encoders show a configuration (n_joint,), its gears stiffer one way.

    Raises:
        DataError: If the configuration has no equilibrium within reach.
    """
    rest = solve_statics(model, configuration[None])
    if not flaws.one_sided:
        return with_gear_error(rest, model, flaws)
    # Softer or stiffer, a gear stays bent the way in which gravity bends it.
    share = [flaws.one_sided * (spring.place == "transmission") for spring in model.robot.springs]
    stiffness = np.array([spring.stiffness for spring in model.robot.springs])
    rest = solve_statics(model, configuration[None], stiffness * (1 + share * np.sign(rest.deflection[0])))
    return with_gear_error(rest, model, flaws)


def refuse_explosion(batch: Batch, robot: Robot, configuration: FloatArray, index: int, when: str) -> None:
    """Raises a DataError that names the configuration if any simulation of it is no longer sound."""
    if not batch.warning.any() and np.isfinite(batch.qpos).all():
        return
    raise DataError(
        f"D217 the simulation blew up in {when}",
        where=f"configuration {index + 1} at {robot.shown(configuration)}",
        remedy="lower the speed loop's bandwidth or the excitation, raise steps_per_sample, check springs and inertias",
    )


@contextlib.contextmanager
def quiet_mujoco() -> Iterator[None]:
    """Keeps MuJoCo's warnings off screen and log files, where the batch counts them, and its clock off."""
    with quiet_warnings(), _unclocked():
        yield


@contextlib.contextmanager
def _unclocked() -> Iterator[None]:
    """Takes away the clock that the Python package gives the engine, which asks it several times in every step.

    The package's own setter knows clocks in Python only; where the library is not found, the clock stays.
    """
    library = next(Path(mujoco.__file__).parent.glob("libmujoco.*"), None)
    if library is None:
        yield
        return
    clock = ctypes.c_void_p.in_dll(ctypes.CDLL(str(library)), "mjcb_time")
    before = clock.value
    clock.value = None
    try:
        yield
    finally:
        clock.value = before


class VaryingStiffness:
    """Rewrites the stiffness of each simulation before the steps of a sample.

    A stiffness is held over the sample at its value in the sample's middle, where the speed carries the joint: what is
    left is of second order in the sampling period. The joint feels how the spring's energy changes with its position.
    """

    def __init__(self, model: ElasticModel, batch: Batch, period_s: float) -> None:
        varying = model.varying
        self._laws, self._places, self._half_s = varying.laws, varying.scheduled.tolist(), 0.5 * period_s
        if not self._laws:
            return
        springs = [model.robot.springs[index] for index in varying.indices]
        self._linear, self._cubic = (np.array([getattr(s, kind) for s in springs]) for kind in ("stiffness", "cubic"))
        self._deflection = np.ascontiguousarray(model.deflection[varying.indices].T)
        self._factor, self._slope = np.empty((2, batch.nsim, len(springs)))
        self._qpos, self._qvel, self._load = batch.qpos, batch.qvel, batch.qfrc_applied
        engine, self._stiffness, self._polynomial = model.mujoco, [], []
        self._dead_band = np.zeros(len(springs))
        for column, spring in enumerate(springs):
            kind, row = "jnt", -1
            if spring.place == "transmission":
                kind, row = "tendon", engine.tendon(spring.name).id
                self._dead_band[column] = engine.tendon_lengthspring[row, 1]
            else:
                row = engine.joint(f"q_e_{spring.name}").id
            self._stiffness.append(batch.expand(f"{kind}_stiffness")[:, row])
            self._polynomial.append(batch.expand(f"{kind}_stiffnesspoly")[:, row, 1])

    def follow(self) -> None:
        """Moves every stiffness on to the middle of the coming sample."""
        if not self._laws:
            return
        ahead = self._qpos + self._half_s * self._qvel
        for column, (place, law) in enumerate(zip(self._places, self._laws, strict=True)):
            self._factor[:, column], self._slope[:, column] = law.rise(ahead[:, place])
        stiffness = self._factor * self._linear
        push = self._slope * self._energy()
        for column, target in enumerate(self._stiffness):
            target[:] = stiffness[:, column]
        if self._cubic.any():
            cubic = self._factor * self._cubic
            for column, target in enumerate(self._polynomial):
                target[:] = cubic[:, column]
        self._load[:, self._places] = 0.0
        for column, place in enumerate(self._places):
            self._load[:, place] -= push[:, column]

    def _energy(self) -> FloatArray:
        """Energy (n_sim, n_varying) of each spring without its factor [J]."""
        deflection = self._qpos @ self._deflection
        if self._dead_band.any():
            deflection -= np.clip(deflection, -self._dead_band, self._dead_band)
        square = deflection * deflection
        return np.asarray((0.5 * self._linear + 0.25 * self._cubic * square) * square)


class PointBalances:
    """Applies springs and gas cylinders that serve as counterbalances before the steps of a sample.

    Their torques are held over the sample at their values in its middle, where the speed carries the joint, as varying
    stiffness is; harmonics act inside the integrator.
    """

    def __init__(self, model: ElasticModel, batch: Batch, period_s: float) -> None:
        self._qpos, self._qvel, self._load, self._half_s = batch.qpos, batch.qvel, batch.qfrc_applied, 0.5 * period_s
        self._balances = [
            (arm, joint.counterbalance, joint.type == "prismatic")
            for joint, arm in zip(model.robot.joints, model.arm.tolist(), strict=True)
            if isinstance(joint.counterbalance, PointBalance)
        ]

    def follow(self) -> None:
        """Moves every torque on to the middle of the coming sample."""
        for arm, balance, slides in self._balances:
            ahead = self._qpos[:, arm] + self._half_s * self._qvel[:, arm]
            self._load[:, arm] += balance_torque(balance, ahead, slides=slides)


class LoadEffects:
    """Rewrites levels of friction and dampers of each simulation before the steps of a sample.

    They are held over the sample: at the load in its middle, where the speed carries the gears, and at the direction of
    its beginning. What friction does at these levels happens inside the integrator.
    """

    def __init__(
        self, model: ElasticModel, batch: Batch, flaws: Imperfections, period_s: float, errors: GearErrors | None = None
    ) -> None:
        self._flaws, self._half_s, self._model, self._errors = flaws, 0.5 * period_s, model, errors
        self._rubs = flaws.friction != "none" and bool(flaws.load_friction or flaws.friction_asymmetry)
        self._damps = flaws.load_damping_1_rad > 0
        self._qpos, self._qvel = batch.qpos, batch.qvel
        robot, engine = model.robot, model.mujoco
        gears = [row for row, spring in enumerate(robot.springs) if spring.place == "transmission"]
        self._springs = [robot.springs[row] for row in gears]
        self._deflection = np.ascontiguousarray(model.deflection[gears].T)
        tendons = [engine.tendon(spring.name).id for spring in self._springs]
        self._dead_band = engine.tendon_lengthspring[tendons, 1]
        self._linear, self._cubic = (
            np.array([getattr(s, kind) for s in self._springs]) for kind in ("stiffness", "cubic")
        )
        if self._damps:
            self._tendons, self._damping = tendons, batch.expand("tendon_damping")
            self._dampers = engine.tendon_damping[tendons].copy()
        if self._rubs:
            self._arm_per_motor = robot.arm_per_motor[[spring.joint for spring in self._springs]]
            laws = [joint.motor.friction for joint in robot.joints]
            self._coulomb = np.array([law.coulomb_nm for law in laws])
            self._turn = SIGN_SHARE * np.array([law.stribeck_rad_s for law in laws])
            self._levels = _levels(model, batch, LAWS[flaws.friction])

    def follow(self) -> None:
        """Moves every level on to what the coming sample asks for."""
        if not (self._rubs or self._damps):
            return
        deflection = (self._qpos + self._half_s * self._qvel) @ self._deflection
        if self._errors and self._errors.any:
            deflection[:, self._errors.gears] += self._errors.ahead
        if self._damps:
            growth = 1 + self._flaws.load_damping_1_rad * np.abs(deflection)
            self._damping[:, self._tendons] = self._dampers * growth
        if self._rubs:
            factor = self._friction_factor(deflection)
            for motor, target, base in self._levels:
                target[:] = factor[:, motor, None] * base

    def _friction_factor(self, deflection: FloatArray) -> FloatArray:
        """Level of each motor's friction (n_sim, n_motor) over that of its law."""
        stretched = deflection - np.clip(deflection, -self._dead_band, self._dead_band)
        linear = self._linear * (1 + self._flaws.one_sided * np.sign(stretched))
        torque = (linear + self._cubic * stretched**2) * stretched
        load = np.abs(torque @ self._arm_per_motor)
        speed = self._qvel[:, self._model.motor] * self._model.turns
        direction = np.tanh(speed / self._turn)
        growth = 1 + self._flaws.load_friction * load / np.where(self._coulomb > 0, self._coulomb, np.inf)
        return np.asarray(growth * (1 + self._flaws.friction_asymmetry * direction))


def _levels(model: ElasticModel, batch: Batch, law: FrictionLaw) -> list[tuple[int, FloatArray, FloatArray]]:
    """Motor, live values (n_sim, n) and values without load of all that a level of friction scales."""
    engine, bias = model.mujoco, batch.expand("actuator_biasprm")
    rows = friction_rows(model.mujoco, model.robot, law)
    # Bristles have both levels beside each other, a ramp its slope and its ends: at a given speed both grow alike.
    ramps = bool(rows) and isinstance(law.in_engine(model.robot.joints[rows[0][0]].motor.friction), Ramps)
    scaled = slice(2, 3) if ramps else slice(3, 5)
    levels = [(motor, bias[:, row, scaled], engine.actuator_biasprm[row, scaled].copy()) for motor, row in rows]
    if ramps:
        limits = batch.expand("actuator_forcerange")
        levels += [(motor, limits[:, row], engine.actuator_forcerange[row].copy()) for motor, row in rows]
    return levels


class Followers:
    """Everything of a batch that follows its motion and is held over a sample.

    Args:
        model: The elastic model.
        batch: Its simulations.
        controller: Whose samples these are.
        flaws: The imperfections.
    """

    def __init__(self, model: ElasticModel, batch: Batch, controller: Controller, flaws: Imperfections) -> None:
        period_s = controller.sampling_period_s
        errors = GearErrors(model, batch, flaws, period_s)
        self._parts = (
            VaryingStiffness(model, batch, period_s),
            PointBalances(model, batch, period_s),
            errors,
            LoadEffects(model, batch, flaws, period_s, errors),
        )
        self._load, self._errors = batch.qfrc_applied, errors

    def begin(self) -> None:
        """Begins where the batch is."""
        self._errors.begin()

    def follow(self) -> None:
        """Moves everything on to the coming sample."""
        self._load[:] = 0.0
        for part in self._parts:
            part.follow()
