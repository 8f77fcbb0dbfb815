"""Rigid dynamics and friction from records: base parameters, several estimators, a verdict."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.rigid.fit.alone import explained_alone
from robid.models.rigid.fit.conclusion import conclude, instrumental_variables
from robid.models.rigid.fit.cut_off import (
    CutOffChoice,
    choose_cut_off,
    fewest_rows,
    row_count,
    shot_of_rows,
    unchosen,
)
from robid.models.rigid.fit.gains import corrected, estimate_gains
from robid.models.rigid.fit.options import ConclusionOptions, PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.regression import (
    Regression,
    ordinary_least_squares,
    reduce_rows,
    residuals,
    sweep_bend,
    weighted_least_squares,
)
from robid.models.rigid.fit.residuals import FEWEST_TESTED, Influence
from robid.models.rigid.fit.result import Found, first_moments, make_solution
from robid.models.rigid.fit.rows import Motion, Reading, Remembered, RowSource
from robid.models.rigid.fit.shots import Shot, motion_of, refuse_unusable, travel_of
from robid.models.rigid.fit.solution import Gains, RigidSolution
from robid.robot.description import Robot
from robid.robot.regressor.base import BaseParameters, find_base_parameters, label, select_base
from robid.robot.regressor.links import PAYLOAD
from robid.robot.regressor.model import RigidModel, build_rigid_model

Simulate: TypeAlias = Callable[[RigidModel, FloatArray], Sequence[FloatArray]]
"""Motor angles (n_sample, n_joint) of each shot by a model with given parameters (n_base,), without noise."""

_DEPENDENT = 1e-7  # share of a column that is rounding in filtered rows


def fit_rigid(
    robot: Robot, shots: Sequence[Shot], options: RigidFitOptions, simulate: Simulate | None = None
) -> RigidSolution:
    """Fits rigid dynamics and friction; without a simulation of the loop there are no instrumental variables.

    Returns:
        The base parameters with their uncertainty, and whether least squares is to be trusted.

    Raises:
        DataError: If a motor never moves, a record is too short, or the motion determines nothing.

    Source:
        Janot et al. (2009); docs/methods, sec. 7.
    """
    refuse_unusable(robot, shots)
    if options.estimator == "instruments" and simulate is None:
        message = "D182 instrumental variables need the robot's loop: its `controller` and recorded motor commands"
        raise DataError(message, where="record", remedy="take another `estimator`, or state the `controller`")
    model = build_rigid_model(robot, options.model)
    base = find_base_parameters(model, options.base)
    try:
        whole = model.only(base.columns.tolist())
        used, choice = _filters(shots, whole, options)
        gains, shots, choice = _with_gains(robot, shots, whole, replace(options, filters=used), choice)
        problem = _Problem(shots, whole, used)
        _refuse_few(robot, problem)
        problem, base = _without_dependent(problem, base)
        estimated = _estimate(problem, base.values(model.nominal), options, simulate)
    except ValueError as error:
        remedy = "look at the record's channels; record longer, with all joints in motion"
        raise DataError(f"D254 {error}", where="record", remedy=remedy) from error
    travel = travel_of(robot, shots)
    found = make_solution(model, base, problem.model, estimated, choice, travel, options, gains)
    alone = explained_alone(problem.measured, estimated.shot, found.residuals.relative_error)
    return replace(found, torque_unit=shots[0].torque_unit, alone=alone)


@dataclass(frozen=True)
class _Problem:
    """Rows of a model along shots."""

    shots: Sequence[Shot]
    model: RigidModel
    filters: PreprocessingOptions

    @cached_property
    def measured(self) -> RowSource:
        """The rows without instruments, made once."""
        return self.rows()

    def rows(self, instruments: Sequence[FloatArray] | None = None) -> RowSource:
        """The rows, with the instruments' positions where there are any."""
        given = [None] * len(self.shots) if instruments is None else instruments
        motions = [self._motion(shot, one) for shot, one in zip(self.shots, given, strict=True)]
        decimator = self.filters.decimator(self.shots[0].sampling_period_s)
        return Remembered(Reading(motions, self.model, decimator))

    def _motion(self, shot: Shot, instrument: FloatArray | None) -> Motion:
        try:
            return motion_of(shot, self.model, self.filters, instrument)
        except ValueError as error:
            remedy = "record longer, or state a higher `filters.position_cut_hz`"
            raise DataError(f"D255 {error}", where="record", remedy=remedy) from error


def _estimate(problem: _Problem, nominal: FloatArray, options: RigidFitOptions, simulate: Simulate | None) -> Found:
    """Runs all estimators on the same rows and judges them."""
    rows = problem.measured
    reduction = reduce_rows(rows)
    plain = ordinary_least_squares(reduction)
    instruments: tuple[Regression, Influence] | None = None
    if simulate is not None:
        found, influence, rows = instrumental_variables(
            lambda values: _instrumented(problem, simulate(problem.model, values)),
            weighted_least_squares(reduction),
            options.convergence,
            nominal,
        )
        instruments = found, influence
    period = problem.shots[0].sampling_period_s
    how = ConclusionOptions(options.estimator != "ordinary", options.huber, options.verdict)
    vectors = first_moments(problem.model.names)
    decimator = problem.filters.decimator(period)
    conclusion = conclude(rows, decimator, problem.model.names, instruments, vectors=vectors, options=how)
    chosen = {"huber": conclusion.huber, "instruments": conclusion.instruments}.get(options.estimator)
    residual = conclusion.residual
    if chosen is not None:
        residual = residuals(rows, chosen.parameters)
    return Found(
        ordinary=plain,
        conclusion=conclusion,
        swept=tuple(sweep_bend(rows, conclusion.reduction, options.sweep, options.huber)),
        torque=np.concatenate([np.where(each.used, each.torque, np.nan) for each in rows]),
        residual=residual,
        shot=shot_of_rows(problem.shots, problem.filters),
        shots=tuple(shot.name for shot in problem.shots),
        filters=problem.filters,
        sampling_period_s=period,
    )


def _instrumented(problem: _Problem, positions: Sequence[FloatArray]) -> RowSource | None:
    return problem.rows(positions) if all(np.isfinite(each).all() for each in positions) else None


def _filters(
    shots: Sequence[Shot], model: RigidModel, options: RigidFitOptions
) -> tuple[PreprocessingOptions, CutOffChoice]:
    """The filters, their cut-off chosen where none is stated."""
    stated = options.filters
    if len({shot.loaded for shot in shots}) < 2:
        # Without both kinds of records nothing tells a payload from the link that it is on.
        model = model.only([index for index, name in enumerate(model.names) if not name.startswith(f"{PAYLOAD}.")])
    if stated.position_cut_hz is not None:
        try:
            return stated, choose_cut_off(shots, model, stated, (stated.position_cut_hz,))
        except ValueError:  # too short to leave out a piece of it
            return stated, unchosen(shots, stated.position_cut_hz)
    try:
        choice = choose_cut_off(shots, model, stated)
    except ValueError as error:
        message = "D183 the record is too short, or its motion too poor, to choose a cut-off from it"
        raise DataError(message, where="record", remedy="state `filters.position_cut_hz`, or record longer") from error
    return replace(stated, position_cut_hz=choice.cut_hz), choice


def _with_gains(
    robot: Robot, shots: Sequence[Shot], model: RigidModel, options: RigidFitOptions, choice: CutOffChoice
) -> tuple[Gains | None, Sequence[Shot], CutOffChoice]:
    """Gains where they are estimated, shots with the torques that motors had, and what the cut-off leaves of these."""
    if options.gain_std is None:
        return None, shots, choice
    gains = estimate_gains(robot, shots, options.filters, options, options.gain_std)
    true = corrected(shots, gains)
    _, again = _filters(true, model, options)
    return gains, true, replace(choice, left_out=again.left_out, residual=again.residual)


def _refuse_few(robot: Robot, problem: _Problem) -> None:
    """Refuses records that leave hardly more rows than there are parameters, or none of a joint."""
    n_param, n_joint = len(problem.model.names), problem.shots[0].position.shape[1]
    rows = sum(row_count(len(shot.position), problem.filters, shot.sampling_period_s) for shot in problem.shots)
    if rows < fewest_rows(n_param, n_joint):
        samples = sum(len(shot.position) for shot in problem.shots)
        message = f"D184 the filters leave {rows} rows of {samples} samples, too few for {n_param} parameters"
        remedy = "record longer, or state a higher `filters.position_cut_hz` or a smaller `filters.decimation`"
        raise DataError(message, where="record", remedy=remedy)
    used = np.sum([each.used.sum(axis=0) for each in problem.measured], axis=0)
    slow = [joint.name for joint, count in zip(robot.joints, used.tolist(), strict=True) if count < FEWEST_TESTED]
    if slow or used.sum() < fewest_rows(n_param, n_joint):
        names = ", ".join(slow) or "all motors together"
        message = f"D185 the rows of {names} that are fast enough are too few for {n_param} parameters"
        remedy = "lower `filters.drop_below_rad_s` and `filters.drop_deviations`, or move faster or longer"
        raise DataError(message, where="record", remedy=remedy)


def _without_dependent(problem: _Problem, base: BaseParameters) -> tuple[_Problem, BaseParameters]:
    """Regroups base parameters that this motion cannot tell apart."""
    reduction = reduce_rows(problem.measured)
    # Base parameters are independent on any motion; on this one, filtered, some columns may be nearly combinations of
    # others.
    factor = reduction.weighted(np.ones(len(reduction.n_row)))[:-1, :-1]
    again = select_base(factor, problem.model, _DEPENDENT)
    if len(again.columns) == len(problem.model.names):
        return problem, base
    combination, own = again.combination @ base.combination, base.columns[again.columns]
    joined = replace(
        base,
        columns=own,
        combination=combination,
        labels=tuple(label(row, base.names, first) for row, first in zip(combination, own.tolist(), strict=True)),
        units=again.units,
        silent=(*base.silent, *again.silent),
        undetermined=tuple(dict.fromkeys((*base.undetermined, *again.undetermined))),
    )
    return replace(problem, model=problem.model.only(again.columns.tolist())), joined
