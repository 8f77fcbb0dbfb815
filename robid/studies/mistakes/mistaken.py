"""What a mistake makes of a sound robot's simulation, of its record and of its robot file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import JointSection, given
from robid.signals.record import Record
from robid.studies.settings.study import Mistake


def mistaken_record(record: Record, mistake: Mistake, configurations: FloatArray, index: int, campaign: str) -> Record:
    """Returns a record as it is read with a mistake in its mapping.

    Args:
        record: Record of one configuration.
        mistake: The mistake.
        configurations (n_conf, n_joint): The campaign's configurations [rad].
        index: Index of the record's.
        campaign: `estimation` or `validation`: only the first has swapped configurations.
    """
    torque = np.array([mistake.torque_factor.get(name, 1.0) for name in record.input_names])
    angle = np.array([mistake.angle_factor.get(name, 1.0) for name in record.output_names])
    if mistake.swapped is not None and campaign == "estimation":
        exchanged = dict(zip(mistake.swapped, reversed(mistake.swapped), strict=True))
        told = exchanged.get(index, index)
        record = replace(record, configurations=configurations[told : told + 1])
    return replace(
        record,
        inputs=record.inputs * torque,
        outputs=_late(record.outputs, mistake.delay_samples) * angle,
        output_offset=record.output_offset * angle,
    )


def _late(position: FloatArray, samples: int) -> FloatArray:
    """The same steady state (n_conf, n_real, n_exp, n_period, n_sample, n_out), read later."""
    if samples == 0:
        return position
    shape = position.shape
    joined = position.reshape(*shape[:3], -1, shape[-1])
    return np.roll(joined, samples, axis=3).reshape(shape)


def mistaken_robot(robot: RobotFile, mistake: Mistake) -> RobotFile:
    """Returns a robot file with a mistake in it."""
    joints = tuple(_mistaken_joint(joint, mistake) for joint in robot.joints)
    springs = tuple(spring for spring in robot.springs if spring.name not in mistake.without_springs)
    return robot.model_copy(update={"joints": joints, "springs": springs})


def mistaken_truth(truth: Mapping[str, float], mistake: Mistake) -> dict[str, float]:
    """Returns true values as they relate to the robot file that is read: levels of friction are relative to its own."""
    factor = mistake.friction_factor
    return {name: (1 + value) / factor - 1 if name.endswith(".level") else value for name, value in truth.items()}


def _mistaken_joint(joint: JointSection, mistake: Mistake) -> JointSection:
    stated = given(joint.motor)
    factor, law = mistake.friction_factor, stated.friction
    levels = {key: getattr(law, key) * factor for key in ("coulomb_nm", "static_nm")}
    turned = stated.with_ratio(mistake.gear_ratio_factor.get(joint.name, 1.0))
    motor = turned.model_copy(update={"friction": law.model_copy(update=levels)})
    gear = None if f"gear_{joint.name}" in mistake.without_springs else joint.gear
    return joint.model_copy(update={"motor": motor, "gear": gear})
