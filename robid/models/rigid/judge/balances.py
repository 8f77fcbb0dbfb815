"""Whether a stated spring or gas cylinder pulls as it is stated to: what else its pull does with its length."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.stats import f as fisher

from robid.arrays import FloatArray
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.regression import Regression, reduce_rows, weighted_least_squares
from robid.models.rigid.fit.residuals import LongRun, least_squares_influence, long_run_covariance
from robid.models.rigid.fit.rows import Reading, Remembered
from robid.models.rigid.fit.shots import Shot, motion_of
from robid.models.rigid.fit.solution import RigidSolution
from robid.results.finding import Finding, two_digits
from robid.robot.balances import PointBalance, SpringBalance, stretch
from robid.robot.description import Robot
from robid.robot.parameters import RigidKind
from robid.robot.regressor.drives import DriveMotion, DriveTerm
from robid.robot.regressor.model import RigidModel, StandardParameter, build_rigid_model

_FALSE_ALARM = 0.01
_MATTERS = 1.0, 0.005  # half-widths, and of the pull
_OWN = ("counterbalance_stiffness", "counterbalance_preload", "counterbalance_pressure")


@dataclass(frozen=True)
class _Departure:
    """What a pull does beside the stated law, along the motion of a fit."""

    surprise: float  # Its statistic over what chance keeps below
    torque: FloatArray  # (n_moment,) Torque by which the nearest pull of the stated law is off [N m, or N]
    share: float  # Its root mean square over that of the whole pull's torque
    moved: FloatArray  # (n_param,) By how many half-widths of its interval each parameter of the fit moves with it
    value: FloatArray  # (n_param,) Where they move to
    worst: int  # The parameter that moves most, the counterbalance's own and what is not identified left out


def balance_findings(
    robot: Robot, shots: Sequence[Shot], solution: RigidSolution, options: RigidFitOptions
) -> Iterator[Finding]:
    """Yields the counterbalances between two points that pull by another law than stated.

    A spring's pull may bend over its length, a gas cylinder's may have a straight line beside it: each stands for the
    other. The law is to blame where such terms are told from zero, and move what is no part of the counterbalance by
    more than its interval or make more than half a percent of the pull.

    Args:
        robot: The robot of the fit.
        shots: The shots that it was fitted to.
        solution: What it found.
        options: Its options.
    """
    whole = build_rigid_model(robot, options.model)
    model = whole.only([whole.names.index(name) for name in solution.estimate.names])
    filters = replace(
        options.filters, position_cut_hz=solution.filtered.cut_hz, decimation=solution.filtered.decimation
    )
    for index, joint in enumerate(robot.joints):
        balance = joint.counterbalance
        fitted = any(f"{joint.name}.{kind}" in model.names for kind in _OWN)
        if not isinstance(balance, PointBalance) or not fitted:
            continue
        more = _with_departure(model, index, balance)
        decimator = filters.decimator(shots[0].sampling_period_s)
        rows = Remembered(Reading([motion_of(shot, model, filters) for shot in shots], more, decimator))
        reduction = reduce_rows(rows)
        try:
            found = weighted_least_squares(reduction)
        except ValueError:  # the motion cannot tell them from the rest
            continue
        influence = least_squares_influence(reduction, found)
        long_run = long_run_covariance(rows, [influence], len(solution.residuals.torque), float(reduction.n_row.mean()))
        departure = _departure(robot, index, balance, found, long_run, solution)
        sizes = abs(departure.moved[departure.worst]), departure.share
        if departure.surprise > 1 and np.greater(sizes, _MATTERS).any():
            yield _finding(robot, index, balance, departure, solution)


def _orders(balance: PointBalance) -> tuple[int, ...]:
    """Powers of the stretch that the stated law lacks: a spring bends, beside a gas cylinder lies a straight line."""
    return (2,) if isinstance(balance, SpringBalance) else (0, 1)


def _power(balance: PointBalance, slides: bool, order: int, position: FloatArray) -> FloatArray:
    """Torque (n_sample,) against a pull that is a power of the stretch."""
    length, lever, _ = stretch(balance, position, slides=slides)
    return np.asarray((length - balance.free_length_m) ** order * lever)


def _with_departure(model: RigidModel, index: int, balance: PointBalance) -> RigidModel:
    """The model with what its joint's counterbalance may do beside its law."""
    joint, row = model.robot.joints[index], model.robot.arm_per_motor[index]
    own: RigidKind = "counterbalance_preload"

    def effect(order: int, motion: DriveMotion) -> FloatArray:
        return _power(balance, joint.type == "prismatic", order, motion.position)

    terms = [
        DriveTerm(joint.name, f"{own}{order}", own, "N", 0.0, row, partial(effect, order)) for order in _orders(balance)
    ]
    parameters = [StandardParameter(term.name, term.kind, term.unit, term.nominal) for term in terms]
    return replace(model, terms=(*model.terms, *terms), parameters=(*model.parameters, *parameters))


def _departure(
    robot: Robot,
    index: int,
    balance: PointBalance,
    found: Regression,
    long_run: LongRun,
    solution: RigidSolution,
) -> _Departure:
    """What the further terms say: how sure they are, what they do, and what moves with them."""
    orders, n_param = _orders(balance), len(solution.estimate.names)
    further = found.parameters[n_param:]
    # Wald's test of all further terms at once, with the long-run covariance and its few degrees of freedom.
    covariance = long_run.of(0)[n_param:, n_param:]
    statistic = float(further @ np.linalg.solve(covariance, further)) / len(orders)
    limit = float(fisher.isf(_FALSE_ALARM, len(orders), long_run.freedom))
    slides, place = robot.joints[index].type == "prismatic", solution.travel.position[:, index]
    bent = np.stack([_power(balance, slides, order, place) for order in orders], axis=-1) @ further
    stated = np.stack([_power(balance, slides, order, place) for order in (0, 1)], axis=-1)
    if not isinstance(balance, SpringBalance):
        length, lever, _ = stretch(balance, place, slides=slides)
        stated = (balance.per_pressure(length) * lever)[:, None]
    names = dict(zip(solution.estimate.names, found.parameters[:n_param].tolist(), strict=True))
    own = [names.get(f"{robot.joints[index].name}.{kind}", 0.0) for kind in _own_kinds(balance)]
    whole = stated @ own + bent
    # What the stated law cannot take up: the least squares over the places of the motion.
    left = whole - stated @ np.linalg.lstsq(stated, whole, rcond=None)[0]
    lower, upper = solution.estimate.effective_interval
    half = np.maximum(0.5 * (upper - lower), 1e-300)
    change = found.parameters[:n_param] - solution.estimate.value
    others = [not name.startswith(f"{robot.joints[index].name}.counterbalance") for name in solution.estimate.names]
    worst = int(np.argmax(np.abs(change / half) * others * solution.estimate.identified))
    share = float(np.sqrt(np.mean(left**2) / np.mean(whole**2)))
    return _Departure(np.sqrt(statistic / limit), left, share, change / half, found.parameters[:n_param], worst)


def _own_kinds(balance: PointBalance) -> tuple[str, ...]:
    """Kinds of a counterbalance's parameters, as its columns above stand."""
    return (_OWN[1], _OWN[0]) if isinstance(balance, SpringBalance) else (_OWN[2],)


def _finding(robot: Robot, index: int, balance: PointBalance, found: _Departure, solution: RigidSolution) -> Finding:
    """Says by how much the law is off and where, what it does to other parameters, and what to state instead."""
    joint, estimate = robot.joints[index], solution.estimate
    worst = int(np.argmax(np.abs(found.torque)))
    place = float(solution.travel.position[worst, index])
    where = f"{1e3 * place:.3g} mm" if joint.type == "prismatic" else f"{np.rad2deg(place):.3g} deg"
    unit = "N" if joint.type == "prismatic" else "N m"
    moved, widths = found.worst, abs(float(found.moved[found.worst]))
    spring = isinstance(balance, SpringBalance)
    law = "straight over its spring's length" if spring else "that of its gas"
    remedy = (
        "state a gas cylinder in place of the spring (`area_m2`, `rest_pressure_pa`, `rest_volume_m3`, `exponent`)"
        if spring
        else "correct `rest_volume_m3` and `exponent`, or state a spring (`stiffness_n_m`, `preload_n`)"
    )
    told = (
        f"the pull of the counterbalance of {joint.name} is not {law}: the misfit grows with the joint's position, to "
        f"{two_digits(abs(float(found.torque[worst])))} {unit} on the arm at {where}, and with it taken "
        f"{estimate.names[moved]} would move from {estimate.value[moved]:.4g} to {found.value[moved]:.4g} "
        f"{estimate.units[moved]}, {two_digits(widths)} half-widths of its interval; {remedy}"
    )
    return Finding("counterbalance_law", told, decisive=False, strength=max(found.surprise, widths))
