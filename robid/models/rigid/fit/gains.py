"""Gains of the motors' torques from a known load, moved beside the same motions without it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.regression import Reduction, reduce_rows, solve_factor, weighted_least_squares
from robid.models.rigid.fit.residuals import Influence, LongRun, long_run_covariance
from robid.models.rigid.fit.rows import Reading, Remembered, Rows, RowSource
from robid.models.rigid.fit.shots import Shot, motion_of
from robid.models.rigid.fit.solution import Gains
from robid.robot.description import Inertial, Robot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.links import PAYLOAD, standard_parameters
from robid.robot.regressor.model import RigidModel, build_rigid_model

_PASSES = 100
_TOLERANCE = 1e-8
_TOLD = 0.5  # of the prior's deviation
_DOUBTS = tuple(f"{PAYLOAD} {doubt}" for doubt in ("mass", "com_x", "com_y", "com_z", "inertia"))
_N_DOUBT = len(_DOUBTS)


def estimate_gains(
    robot: Robot, shots: Sequence[Shot], filters: PreprocessingOptions, options: RigidFitOptions, prior_std: float = 0.1
) -> Gains:
    """Estimates one gain a motor from shots with and without the robot's payload, whose mass properties are known.

    Recorded torques are `(W x + l) / g`, with the links' rows `W x` and the known load's `l`. They alone have noise:
    divided by g they stay on the left, so that no regressor has errors, unlike where `g` multiplies them. A motor that
    the load hardly moves keeps its prior, around 1. The load is known as well as the robot's doubts of it say.

    Args:
        robot: The robot with the known payload.
        shots: Some with (`loaded`), some without it.
        filters: Filters with a cut-off.
        options: The rigid fit's; its payload is a body of its own here.
        prior_std: Standard deviation of 1 / g before the records.

    Raises:
        DataError: If the payload has no mass, no shots differ in it, torques are currents, or friction grows with them.
        ValueError: If the rows do not determine the links, a record is too short, or no gains settle.

    Source:
        Gautier and Briot (2014), Global identification of joint drive gains and dynamic parameters of robots, with
        their total least squares replaced by the likelihood of noise in the torques.
    """
    model = build_rigid_model(robot, replace(options.model, payload="body"))
    _refuse(robot, shots, model)
    regressor = _WithLoad.of(model, options)
    decimator = filters.decimator(shots[0].sampling_period_s)
    motions = [motion_of(shot, model, filters) for shot in shots]
    return gains_of(Remembered(Reading(motions, regressor, decimator)), prior_std)


def corrected(shots: Sequence[Shot], gains: Gains | None) -> tuple[Shot, ...]:
    """Returns shots with the torques that their motors had; as they are without gains."""
    return tuple(shots) if gains is None else tuple(replace(shot, torque=shot.torque * gains.gain) for shot in shots)


def describe_gains(gains: Gains, names: Sequence[str], level: float) -> str:
    """Says by what torques of joints were multiplied, with half their intervals, and what the load did not tell."""
    rows = zip(names, gains.gain.tolist(), gains.half_width(level).tolist(), gains.determined.tolist(), strict=True)
    told = ", ".join(
        f"{name} {gain:.3g} ± {half:.2g}{'' if sure else ' (not determined)'}" for name, gain, half, sure in rows
    )
    return f"torques are multiplied by gains: {told}"


def gains_of(source: RowSource, prior_std: float) -> Gains:
    """Estimates gains from rows whose last columns are the known load's torque and what its doubts add to it."""
    reduction = reduce_rows(source)
    factors, n_row = reduction.factors.swapaxes(0, 1), reduction.n_row
    n_joint, n_link = len(n_row), reduction.n_param - 1 - _N_DOUBT
    # Parameters are the links', the load's doubts in deviations, and h = 1 / g, the last two with priors.
    mean = np.concatenate([np.zeros(n_link + _N_DOUBT), np.ones(n_joint)])
    precision = np.concatenate([np.zeros(n_link), np.ones(_N_DOUBT), np.full(n_joint, prior_std**-2.0)])
    deviation, found = _start(reduction, n_link), mean.copy()
    for _ in range(_PASSES):
        point = _Linear(source, found, n_joint)
        derivative, left = point.linearise(factors[..., :-1], factors[..., -1])
        rows = np.concatenate([derivative, left[..., None]], axis=2) / deviation[:, None]
        prior = np.sqrt(precision)[:, None] * np.column_stack([np.eye(len(mean)), mean - found])
        factor = np.linalg.qr(np.vstack([rows.reshape(-1, len(mean) + 1), prior]), mode="r")
        step, bread, _ = solve_factor(np.asarray(factor))
        found = found + step
        # The parameters' degrees of freedom are shared by the joints as their rows are.
        freedom = n_row * (1 - (n_link + n_joint) / n_row.sum())
        deviation = np.sqrt(np.sum(left**2, axis=0) / freedom)
        if np.all(np.abs(step) <= _TOLERANCE + 1e-3 * np.sqrt(np.diag(bread))):
            break
    else:
        raise ValueError("The gains do not settle: the load explains too little of the torques.")
    long_run = _long_run(_Linear(source, found, n_joint), bread, deviation, n_row)
    # Rows of white residuals add B J' J B, with their derivatives J, no less than this where they are correlated in
    # time: few degrees of freedom tell variances, not correlations. The prior adds B L B, with its precision L.
    covariance = _widened((rows.reshape(-1, len(mean) + 1)[:, :-1] @ bread)[:, -n_joint:], long_run)
    covariance = covariance + (bread * precision @ bread)[-n_joint:, -n_joint:]
    gain = 1 / found[-n_joint:]
    told = np.sqrt(np.diag(covariance)) < _TOLD * prior_std
    # By the delta method, d g = -g^2 d h.
    return Gains(gain, covariance * np.outer(gain**2, gain**2), told, float(long_run.freedom))


def _long_run(linear: _Linear, bread: FloatArray, deviation: FloatArray, n_row: IntArray) -> LongRun:
    """Covariance of all parameters by residuals that are correlated in time."""
    influence = Influence(np.zeros(len(bread)), bread, deviation**-2.0, np.full(len(deviation), np.inf))
    n_moment = sum(len(rows.torque) for rows in linear.source)
    return long_run_covariance(linear, [influence], n_moment, float(n_row.mean()))


def _widened(moves: FloatArray, long_run: LongRun) -> FloatArray:
    """Covariance (n_joint, n_joint) of moves (n_row, n_joint) by white residuals, widened to the long-run variances."""
    white = moves.T @ moves
    variance = np.diag(long_run.covariance)[-len(white) :]
    ratio = np.sqrt(np.maximum(variance / np.maximum(np.diag(white), np.finfo(float).tiny), 1.0))
    return np.asarray(white * np.outer(ratio, ratio))


def _start(reduction: Reduction, n_link: int) -> FloatArray:
    """Deviations (n_joint,) of the residuals of least squares with a free size of the load, without its doubts."""
    factors = np.delete(reduction.factors, np.s_[n_link + 1 : -1], axis=2)
    squares = [np.linalg.qr(factor, mode="r") for factor in factors]
    return weighted_least_squares(Reduction(np.array(squares), reduction.n_row)).deviation


_Pair: TypeAlias = tuple[FloatArray, FloatArray]


@dataclass(frozen=True)
class _Linear:
    """Rows linearised about links, doubts of the load and 1 / g: columns are derivatives, torques residuals."""

    source: RowSource
    found: FloatArray  # (n_link + n_doubt + n_joint,): where
    n_joint: int

    def __len__(self) -> int:
        return len(self.source)

    def __getitem__(self, index: int) -> Rows:
        rows = self.source[index]
        return Rows(*self.linearise(rows.columns, rows.torque), rows.used)

    def __iter__(self) -> Iterator[Rows]:
        return (self[index] for index in range(len(self)))

    def linearise(self, columns: FloatArray, torque: FloatArray) -> _Pair:
        """Returns derivatives (n_row, n_joint, n_param) and residuals (n_row, n_joint) `t - h (W x + l)`."""
        known, inverse = self.found[: -self.n_joint], self.found[-self.n_joint :]
        n_link = len(known) - _N_DOUBT
        explained = columns @ np.insert(known, n_link, 1.0)
        own = np.delete(columns, n_link, axis=2) * inverse[:, None]
        by_gain = explained[..., None] * np.eye(self.n_joint)
        return np.concatenate([own, by_gain], axis=2), torque - inverse * explained


@dataclass(frozen=True)
class _WithLoad:
    """The links' base parameters, and as last columns the known load's torque and a deviation of each doubt of it."""

    links: RigidModel
    load: RigidModel
    values: FloatArray  # (n_load, 1 + n_doubt): the load's standard parameters, and their moves

    @classmethod
    def of(cls, model: RigidModel, options: RigidFitOptions) -> _WithLoad:
        """Parts a model with a payload of its own."""
        own = [name.startswith(f"{PAYLOAD}.") for name in model.names]
        links = model.only(np.flatnonzero(np.logical_not(own)).tolist())
        base = find_base_parameters(links, options.base)
        load = model.only(np.flatnonzero(own).tolist())
        values = np.column_stack([load.nominal, *_moves(model.robot)])
        return cls(links.only(base.columns.tolist()), load, values)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each parameter."""
        return (*self.links.names, PAYLOAD, *_DOUBTS)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kind of each parameter."""
        return (*self.links.kinds, *("load" for _ in range(1 + _N_DOUBT)))

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of each parameter."""
        return (*self.links.units, *("1" for _ in range(1 + _N_DOUBT)))

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
        """Returns the columns (n_sample, n_joint, n_link + 1 + n_doubt); without the load the last ones are zero."""
        path = position, velocity, acceleration
        links = self.links.columns(*path, torque=torque, friction_speed=friction_speed)
        load = self.load.columns(*path, loaded=loaded) @ self.values
        return np.concatenate([links, load], axis=2)


def _moves(robot: Robot) -> list[FloatArray]:
    """Moves of the payload's standard parameters by a deviation of each doubt: mass, centre of mass, inertia."""
    load, std = robot.payload, robot.nuisance_std

    def move(mass: float, com: FloatArray, inertia: float) -> FloatArray:
        heavier = (1 + mass) * load.mass_kg, load.com_m + com, (1 + mass + inertia) * load.inertia_kgm2
        return standard_parameters(Inertial(*heavier)) - standard_parameters(load)

    still = np.zeros(3)
    centre = [move(0.0, std.payload_com_m * axis, 0.0) for axis in np.eye(3)]
    mass, inertia = std.payload_relative_std, std.payload_inertia_relative_std
    return [move(mass, still, 0.0), *centre, move(0.0, still, inertia)]


def _refuse(robot: Robot, shots: Sequence[Shot], model: RigidModel) -> None:
    """Refuses what no gain can be told from."""
    if robot.payload.mass_kg <= 0 or len({shot.loaded for shot in shots}) < 2:
        message = "D452 gains need records with and without a known load of some mass"
        raise DataError(message, where="record", remedy="record the same motion with and without the payload")
    if shots[0].torque_unit != "N m":
        message = "D494 gains need torques in N m, and these are currents"
        raise DataError(message, where="record", remedy="state `torque_constant_nm_a` of the motors")
    if model.needs_torque:
        message = "D453 gains and friction that grows with the torque are not distinguished"
        raise DataError(message, where="fit", remedy="leave load-dependent friction out")
