"""Friction that grows with what a gear carries, as an explanation of a misfit."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray
from robid.models.elastic.fit.nuisance.columns import column
from robid.models.elastic.fit.nuisance.effects import Effect, Nuisance
from robid.models.elastic.fit.nuisance.scene import Scene
from robid.models.elastic.fit.rest_model import NO_LOAD_RAD, friction_of_one
from robid.robot.description import Robot

_LIKELY = 5.0  # percent, as what a motor's friction drifts by


@dataclass(frozen=True)
class LoadFriction(Effect):
    """A motor's friction that grows with the load of its gear; only an explanation.

    An amount is what it has under the largest load of the campaign more than without, in percent of what the rotor asks
    for at 10 Hz: Coulomb friction of a motor that moves on acts as viscous friction.

    Source:
        Statistical linearisation of a relay: Gelb and Vander Velde (1968), app. E.
    """

    put_in = False
    joint: int  # Index of the motor
    spring: int  # Index of its gear


@column.register
def _(effect: LoadFriction, scene: Scene) -> ComplexArray:
    load = np.abs(scene.problem.model.rest.deflection[:, effect.spring])
    share = load / max(float(load.max()), NO_LOAD_RAD)
    own = friction_of_one(float(scene.robot.joints[effect.joint].motor.inertia_kgm2)) * share
    return np.asarray(own[:, None, None, None] * scene.slopes("viscous")[..., effect.joint])


def load_frictions(robot: Robot) -> Iterator[Nuisance]:
    """Yields the friction by load of each motor with an elastic gear."""
    for index, spring in enumerate(robot.springs):
        if spring.place == "transmission":
            name, effect = robot.joints[spring.joint].name, LoadFriction(spring.joint, index)
            titles = f"{name}.load_friction", f"friction of {name} by its gear's load"
            unit = "% of what its rotor asks for at 10 Hz"
            yield Nuisance(*titles, "friction", unit, _LIKELY, 0.0, effect, least=0.0)
