"""Springs of a batch of simulations whose stiffness follows a joint's position."""

from __future__ import annotations

import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray
from robid.robot.model import ElasticModel


class VaryingStiffness:
    """Rewrites the stiffness of each simulation before the steps of a sample.

    A stiffness is held over the sample at its value in the sample's middle, where the speed carries the joint: what is
    left is of second order in the sampling period. The joint feels how the spring's energy changes with its position.

    Args:
        model: The elastic model.
        batch: Its simulations; nothing of them changes where no stiffness depends on a position.
        period_s: Time for which a stiffness is held [s].
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
