"""Torques of the estimated links beside those of the robot file's, along the same motion."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.rigid.fit.reduction import Reduction
from robid.models.rigid.fit.solution import NominalTorques
from robid.results.estimate import Estimate
from robid.robot.regressor.base import BaseParameters
from robid.robot.regressor.model import RigidModel

_LINKS = ("inertia", "first_moment", "mass")
_ROTORS = ("motor_inertia", "coupling_inertia")
_NOTHING = 1e-9  # of a joint's torque


def against_nominal(
    model: RigidModel, base: BaseParameters, estimate: Estimate, reduction: Reduction
) -> NominalTorques:
    """Compares the torques of the links with those of the robot file's, from reduced rows alone.

    The rotors that are grouped with links are taken as the robot file has them. What other parameters can give along
    this motion is left out of both, since an estimate shares it out as it pleases.

    Args:
        model: The model with all of its standard parameters.
        base: Its base parameters.
        estimate: Their estimates.
        reduction: The rows.
    """
    rotors = base.combination @ np.where(np.isin(np.array(model.kinds), _ROTORS), model.nominal, 0.0)
    both, kinds = np.stack([estimate.value, estimate.nominal], axis=1), np.array(estimate.kinds)
    links, bodies = np.isin(kinds, _LINKS), np.isin(kinds, (*_LINKS, *_ROTORS))
    rows = [_compare(factor, links, both - rotors[:, None]) for factor in reduction.factors]
    share, ratio, likeness = np.array(rows).T
    whole = np.array([_compare(factor, bodies, both)[1] for factor in reduction.factors])
    return NominalTorques(share, ratio, likeness, whole)


def _compare(factor: FloatArray, chosen: BoolArray, values: FloatArray) -> tuple[float, float, float]:
    """Share, ratio and likeness of what some parameters (n_param, 2), estimated and nominal, do to one joint."""
    both, others = factor[:, :-1][:, chosen] @ values[chosen], factor[:, :-1][:, ~chosen]
    size = np.linalg.norm(others, axis=0)
    others = others / np.where(size > 0, size, 1.0)
    both = both - others @ np.linalg.lstsq(others, both, rcond=None)[0]
    estimated, stated = np.linalg.norm(both, axis=0).tolist()
    whole = float(np.linalg.norm(factor[:, -1]))
    if min(estimated, stated) <= _NOTHING * whole:
        return estimated / whole, float("nan"), float("nan")
    return estimated / whole, estimated / stated, float(both[:, 0] @ both[:, 1]) / (estimated * stated)
