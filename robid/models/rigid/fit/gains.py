"""Gains of the motors' torques from a known load, moved beside the same motions without it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.errors import DataError
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.regression import Reduction, reduce_rows, solve_factor, weighted_least_squares
from robid.models.rigid.fit.rows import Reading
from robid.models.rigid.fit.shots import Shot, motion_of
from robid.robot.description import Robot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.links import PAYLOAD
from robid.robot.regressor.model import RigidModel, build_rigid_model

_PASSES = 100
_TOLERANCE = 1e-8
_TOLD = 0.5  # of the prior's deviation


@dataclass(frozen=True)
class Gains:
    """What each motor's true torque is over its stated one."""

    gain: FloatArray  # (n_joint,): true torque over the recorded one
    deviation: FloatArray  # (n_joint,): its standard deviation
    determined: BoolArray  # (n_joint,): whether the load tells it; the others are the prior's for the most part


def estimate_gains(
    robot: Robot, shots: Sequence[Shot], filters: PreprocessingOptions, options: RigidFitOptions, prior_std: float = 0.1
) -> Gains:
    """Estimates one gain a motor from shots with and without the robot's payload, whose mass properties are known.

    Recorded torques are `(W x + l) / g`, with the links' rows `W x` and the known load's `l`. They alone have noise:
    divided by g they stay on the left, so that no regressor has errors, unlike where `g` multiplies them. A motor that
    the load hardly moves keeps its prior, around 1. The deviations take residuals as white.

    Args:
        robot: The robot with the known payload.
        shots: Some with (`loaded`), some without it.
        filters: Filters with a cut-off.
        options: The rigid fit's; its payload is a body of its own here.
        prior_std: Standard deviation of 1 / g before the records.

    Raises:
        DataError: If the payload has no mass, no shots differ in it, or friction grows with the torque.
        ValueError: If the rows do not determine the links, a record is too short, or no gains settle.

    Source:
        Gautier and Briot (2014), global identification of joint drive gains, with their total least squares replaced
        by the likelihood of noise in the torques.
    """
    model = build_rigid_model(robot, replace(options.model, payload="body"))
    _refuse(robot, shots, model)
    regressor = _WithLoad.of(model, options)
    decimator = filters.decimator(shots[0].sampling_period_s)
    motions = [motion_of(shot, model, filters) for shot in shots]
    return gains_of(reduce_rows(Reading(motions, regressor, decimator)), prior_std)


def gains_of(reduction: Reduction, prior_std: float) -> Gains:
    """Estimates gains from reduced rows whose last column is the known load's torque, by Gauss and Newton's method."""
    factors, n_row = reduction.factors, reduction.n_row
    n_joint, n_link = len(factors), reduction.n_param - 1
    # From gains of 1 on, weights as those of least squares with a free size of the load.
    start = weighted_least_squares(reduction)
    inverse, links, deviation = np.ones(n_joint), start.parameters[:-1], start.deviation
    for _ in range(_PASSES):
        whole = np.append(links, 1.0)
        # Residuals t - h (W x + l), and their derivatives by x and by h = 1 / g.
        explained = factors[:, :, :-1] @ whole
        left = factors[:, :, -1] - inverse[:, None] * explained
        by_gain = explained[:, :, None] * np.eye(n_joint)[:, None]
        rows = np.concatenate([inverse[:, None, None] * factors[:, :, :n_link], by_gain, left[..., None]], axis=2)
        rows = (rows / deviation[:, None, None]).reshape(-1, n_link + n_joint + 1)
        prior = np.column_stack([np.zeros((n_joint, n_link)), np.eye(n_joint), 1.0 - inverse]) / prior_std
        factor = np.asarray(np.linalg.qr(np.vstack([rows, prior]), mode="r"))
        step, covariance, _ = solve_factor(factor)
        links, inverse = links + step[:n_link], inverse + step[n_link:]
        # The parameters' degrees of freedom are shared by the joints as their rows are.
        freedom = n_row * (1 - (n_link + n_joint) / n_row.sum())
        deviation = np.sqrt(np.sum(left**2, axis=1) / freedom)
        if np.all(np.abs(step) <= _TOLERANCE + 1e-3 * np.sqrt(np.diag(covariance))):
            break
    else:
        raise ValueError("The gains do not settle: the load explains too little of the torques.")
    spread = np.sqrt(np.diag(covariance)[n_link:])
    # By the delta method, d g = -g^2 d h.
    return Gains(1 / inverse, spread / inverse**2, spread < _TOLD * prior_std)


@dataclass(frozen=True)
class _WithLoad:
    """The links' base parameters, and the known load's torque as a last column."""

    links: RigidModel
    load: RigidModel
    values: FloatArray  # (n_load,): the load's standard parameters

    @classmethod
    def of(cls, model: RigidModel, options: RigidFitOptions) -> _WithLoad:
        """Parts a model with a payload of its own."""
        own = [name.startswith(f"{PAYLOAD}.") for name in model.names]
        links = model.only(np.flatnonzero(np.logical_not(own)).tolist())
        base = find_base_parameters(links, options.base)
        load = model.only(np.flatnonzero(own).tolist())
        return cls(links.only(base.columns.tolist()), load, load.nominal)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each parameter."""
        return (*self.links.names, PAYLOAD)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kind of each parameter."""
        return (*self.links.kinds, "load")

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each parameter."""
        return (*self.links.units, "1")

    def columns(
        self,
        position: FloatArray,
        velocity: FloatArray,
        acceleration: FloatArray,
        *,
        torque: FloatArray | None = None,
        friction_speed: FloatArray | None = None,
        loaded: bool = True,
    ) -> FloatArray:
        """Returns the columns (n_sample, n_joint, n_link + 1); without the load the last one is zero."""
        path = position, velocity, acceleration
        links = self.links.columns(*path, torque=torque, friction_speed=friction_speed)
        load = self.load.columns(*path, loaded=loaded) @ self.values if loaded else np.zeros_like(position)
        return np.concatenate([links, load[..., None]], axis=2)


def _refuse(robot: Robot, shots: Sequence[Shot], model: RigidModel) -> None:
    """Refuses what no gain can be told from."""
    if robot.payload.mass_kg <= 0 or len({shot.loaded for shot in shots}) < 2:
        message = "D452 gains need records with and without a known load of some mass"
        raise DataError(message, where="record", remedy="record the same motion with and without the payload")
    if model.needs_torque:
        message = "D453 gains and friction that grows with the torque are not told apart"
        raise DataError(message, where="fit", remedy="leave load-dependent friction out")
