"""The motor friction that a fit hands on, as any stage reads it from the parameters that every model has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.results import estimate_from_artifact
from robid.errors import DataError
from robid.results.estimate import Estimate

_UNIT = "rigid/torque_unit"


@dataclass(frozen=True)
class MotorFriction:
    """Friction of some motors, motor side; where it differs between the directions the mean of both.

    Attributes:
        coulomb_nm (n_joint,): Coulomb levels [N m].
        coulomb_std (n_joint,): Their standard deviations [N m].
        uneven_nms_rad (n_joint,): Half of what viscous friction is larger forward than backward [N m s/rad].
    """

    coulomb_nm: FloatArray
    coulomb_std: FloatArray
    uneven_nms_rad: FloatArray


def friction_from_artifact(model: Artifact, fit: str, joints: Sequence[str], torque_unit: str = "N m") -> MotorFriction:
    """Reads motor friction from the model of a fit.

    Args:
        model: Its artifact.
        fit: Its name.
        joints: Names of the motors' joints.
        torque_unit: Unit of the torques that the friction is subtracted from: A for currents.

    Raises:
        DataError: If it knows no friction of a motor, or torques in another unit.
    """
    unit = str(model.attributes.get(_UNIT, "N m"))
    if unit != torque_unit:
        message = f"fit `{fit}` knows friction in {unit}, but it is subtracted from torques in {torque_unit}"
        raise DataError(message, where=f"fits.{fit}", remedy="import both logs in the same unit")
    estimate = estimate_from_artifact(model)
    rows = [_weights(estimate, joint, "coulomb") for joint in joints]
    missing = [joint for joint, row in zip(joints, rows, strict=True) if not row.any()]
    if missing:
        message = f"fit `{fit}` found no Coulomb friction of {', '.join(missing)}"
        raise DataError(message, where=f"fits.{fit}", remedy="record a motion that reverses these motors often")
    mean = np.array(rows)
    uneven = np.array([_weights(estimate, joint, "viscous", opposite=-1.0) for joint in joints])
    return MotorFriction(
        coulomb_nm=mean @ estimate.value,
        coulomb_std=np.sqrt(np.einsum("jp,pq,jq->j", mean, estimate.covariance, mean)),
        uneven_nms_rad=uneven @ estimate.value,
    )


def _weights(estimate: Estimate, joint: str, kind: str, opposite: float = 1.0) -> FloatArray:
    """Weights (n_param,) of the parameters in a mean of both directions, or, with -1, in half their difference."""
    one_way = {f"{joint}.{kind}_forward": 0.5, f"{joint}.{kind}_backward": 0.5 * opposite}
    both = {} if opposite < 0 else {f"{joint}.{kind}": 1.0}
    return np.array([{**one_way, **both}.get(name, 0.0) for name in estimate.names])
