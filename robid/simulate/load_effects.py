"""Friction and damping of a batch of simulations that follow the load and the direction of motion."""

from __future__ import annotations

import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray
from robid.robot.actuators import friction_rows
from robid.robot.friction import LAWS, SIGN_SHARE, FrictionLaw, Ramps
from robid.robot.model import ElasticModel
from robid.simulate.options import Imperfections


class LoadEffects:
    """Rewrites levels of friction and dampers of each simulation before the steps of a sample.

    They are held over the sample: at the load in its middle, where the speed carries the gears, and at the direction of
    its beginning. What friction does at these levels happens inside the integrator.

    Args:
        model: The elastic model.
        batch: Its simulations; nothing of them changes where no such imperfection is on.
        flaws: The imperfections.
        period_s: Time for which a level is held [s].
    """

    def __init__(self, model: ElasticModel, batch: Batch, flaws: Imperfections, period_s: float) -> None:
        self._flaws, self._half_s, self._model = flaws, 0.5 * period_s, model
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
        torque = (self._linear + self._cubic * stretched**2) * stretched
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
