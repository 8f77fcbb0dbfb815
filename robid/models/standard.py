"""The standard parameters that a fit of rigid dynamics hands on, as any family reads them from its model.

Families never import each other: what is handed on lies in the model's group `rigid/standard`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.errors import DataError
from robid.robot.description import Robot
from robid.robot.standard import StandardRobot, with_standard
from robid.settings.experiment import heaviest
from robid.settings.load import LoadedExperiment

_GROUP = "rigid/standard"
_NEWTON_METRES = "N m"


@dataclass(frozen=True)
class Standard:
    """Standard parameters of real bodies as a fit of rigid dynamics found them.

    Attributes:
        names: Their names.
        units: Their units.
        value (n_std,): The values.
        covariance (n_std, n_std): Their covariance by what was estimated.
        status: `estimated`, or `moved` where only the nearest real bodies could be had.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    value: FloatArray
    covariance: FloatArray
    status: str

    @property
    def values(self) -> dict[str, float]:
        """The values by name."""
        return dict(zip(self.names, self.value.tolist(), strict=True))

    def mean(self, joint: str, kind: str) -> tuple[float, float]:
        """Returns a joint's friction, the mean of both directions where they differ, and its deviation."""
        wanted = (f"{joint}.{kind}", f"{joint}.{kind}_forward", f"{joint}.{kind}_backward")
        own = np.isin(np.array(self.names), wanted)
        share = own / max(1, own.sum())
        return float(share @ self.value), float(np.sqrt(share @ self.covariance @ share))


def standard_from_artifact(model: Artifact, fit: str) -> Standard:
    """Reads the standard parameters from the model of a rigid fit.

    Args:
        model: Its artifact.
        fit: Its name.

    Raises:
        DataError: If it has none that could be handed on.
    """
    unit = str(model.attributes.get("rigid/torque_unit", _NEWTON_METRES))
    if unit != _NEWTON_METRES:
        message = f"fit `{fit}` knows torques in {unit} alone: its masses are ratios to the torque constant"
        raise DataError(message, where=f"fits.{fit}", remedy="import torques in N m; json, csv and mat hold the ratios")
    status = str(model.attributes.get(f"{_GROUP}/status", "missing"))
    if status not in ("estimated", "moved"):
        message = f"fit `{fit}` has no standard parameters of real bodies ({status})"
        remedy = "leave `physical` at true, and give the robot file's links masses and inertias that a body can have"
        raise DataError(message, where=f"fits.{fit}", remedy=remedy)
    found = {key: model.datasets[f"{_GROUP}/{key}"].values for key in ("names", "units", "value", "covariance")}
    return Standard(
        names=tuple(map(str, found["names"])),
        units=tuple(map(str, found["units"])),
        value=np.asarray(found["value"], float),
        covariance=np.asarray(found["covariance"], float),
        status=status,
    )


def standard_robot(loaded: LoadedExperiment, fit: str, standard: Standard) -> StandardRobot:
    """Returns the robot file's robot with the standard parameters of a rigid fit, and with that fit's payload."""
    campaign = loaded.experiment.campaigns[heaviest(loaded.experiment, loaded.experiment.fits[fit], loaded.robot)]
    found = with_standard(loaded.robot.to_robot(campaign.payload_kg), standard.values)
    return replace(found, robot=_with_std(found.robot, standard))


def _with_std(robot: Robot, standard: Standard) -> Robot:
    """The robot with the relative deviations of its Coulomb friction."""
    joints = []
    for joint in robot.joints:
        law, (level, std) = joint.motor.friction, standard.mean(joint.name, "coulomb")
        friction = replace(law, relative_std=std / level) if level > 0 else law
        joints.append(replace(joint, motor=replace(joint.motor, friction=friction)))
    return replace(robot, joints=tuple(joints))
