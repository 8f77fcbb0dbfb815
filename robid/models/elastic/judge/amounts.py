"""Amounts of nuisance parameters as the settings want them that they correct: their sign, frame and unit."""

from __future__ import annotations

import numpy as np

from robid.models.elastic.fit.nuisance.columns import value_of_one
from robid.models.elastic.fit.nuisance.effects import Nuisance, TorqueScale, ValueOff
from robid.models.elastic.fit.nuisance.moves import PERCENT
from robid.robot.description import Robot
from robid.robot.parameters import RESPONSE_NUISANCE, element_units
from robid.robot.response import ElasticParameters

_COUPLING = ".coupling_"


def as_set(nuisance: Nuisance, amount: float, robot: Robot, values: ElasticParameters) -> tuple[str, float, str, float]:
    """Returns an amount as what is to be added to the setting that it corrects, in its sign, frame and unit.

    Args:
        nuisance: The nuisance parameter.
        amount: Its amount, in its own unit.
        robot: The robot that it was listed for.
        values: Values of the parameters there.

    Returns:
        What it is, how much is to be added, in which unit, and what the setting says, zero where the amount is a share.
    """
    effect, title = nuisance.effect, nuisance.title
    if isinstance(effect, TorqueScale):
        # A torque that is read too large asks for a torque constant that is smaller.
        return title, PERCENT * float(np.expm1(-amount / PERCENT)), nuisance.unit, 0.0
    if isinstance(effect, ValueOff) and effect.kind in RESPONSE_NUISANCE and effect.kind != "delay":
        unit = element_units(robot, effect.kind)[effect.element]
        stated = float(getattr(values, effect.kind)[effect.element])
        return title, amount * value_of_one(effect, values), unit, stated
    if nuisance.cause == "gear_coupling":
        # Of the file per turn of the other motor, here in percent of what that motor does to its own arm.
        name, _, other = nuisance.name.partition(_COUPLING)
        joints = {joint.name: joint for joint in robot.joints}
        per_turn = amount / PERCENT / joints[other].motor.gear_ratio
        return title, per_turn, "turns per motor turn", joints[name].couplings.get(other, 0.0)
    return title, amount, nuisance.unit, nuisance.stated
