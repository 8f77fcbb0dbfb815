"""Springs of a batch of simulations whose stiffness follows a joint's position."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from mujoco.batch import Batch

from robid.arrays import FloatArray
from robid.robot.model import ElasticModel
from robid.robot.stiffness_law import LawFactor


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
        self._springs = [
            _spring(model, batch, int(index), int(place), law)
            for index, place, law in zip(varying.indices, varying.scheduled, varying.laws, strict=True)
        ]
        self._half_s = 0.5 * period_s
        if self._springs:
            self._qpos, self._qvel, self._load = batch.qpos, batch.qvel, batch.qfrc_applied

    def follow(self) -> None:
        """Moves every stiffness on to the middle of the coming sample."""
        for spring in self._springs:
            self._load[:, spring.scheduled] = 0.0
        for spring in self._springs:
            place = spring.scheduled
            factor = spring.law.whole(self._qpos[:, place] + self._half_s * self._qvel[:, place])
            np.multiply(factor.value, spring.linear, out=spring.stiffness)
            deflection = self._qpos @ spring.deflection
            if spring.dead_band:
                deflection -= np.clip(deflection, -spring.dead_band, spring.dead_band)
            energy = 0.5 * spring.linear * deflection**2
            if spring.cubic:
                spring.polynomial[:] = factor.value * spring.cubic
                energy += 0.25 * spring.cubic * deflection**4
            self._load[:, place] -= factor.slope * energy


@dataclass(frozen=True)
class _Spring:
    """One spring of all simulations; `stiffness` and `polynomial` (n_sim,) are the engine's own memory."""

    scheduled: int
    law: LawFactor
    linear: float
    cubic: float
    dead_band: float
    deflection: FloatArray
    stiffness: FloatArray
    polynomial: FloatArray


def _spring(model: ElasticModel, batch: Batch, index: int, scheduled: int, law: LawFactor) -> _Spring:
    spring, engine = model.robot.springs[index], model.mujoco
    is_tendon = spring.place == "transmission"
    kind = "tendon" if is_tendon else "jnt"
    row = engine.tendon(spring.name).id if is_tendon else engine.joint(f"q_e_{spring.name}").id
    return _Spring(
        scheduled=scheduled,
        law=law,
        linear=spring.stiffness,
        cubic=spring.cubic,
        dead_band=float(engine.tendon_lengthspring[row, 1]) if is_tendon else 0.0,
        deflection=model.deflection[index],
        stiffness=batch.expand(f"{kind}_stiffness")[:, row],
        polynomial=batch.expand(f"{kind}_stiffnesspoly")[:, row, 1],
    )
