"""Explanations of a misfit: score tests to first order, and what no fit estimates, backlash and gear ratios."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.clusters.evidence import group_clusters
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.intervals import FEWEST_CLUSTERS
from robid.models.elastic.fit.nuisance.columns import column
from robid.models.elastic.fit.nuisance.effects import (
    Drift,
    Effect,
    LateDrive,
    LoadFriction,
    Nuisance,
    OneSided,
    RobotMove,
)
from robid.models.elastic.fit.nuisance.listing import estimable_nuisances, estimated_nuisances
from robid.models.elastic.fit.nuisance.moves import with_gear_ratio
from robid.models.elastic.fit.nuisance.off_robot import problem_at
from robid.models.elastic.fit.nuisance.response import nuisance_columns
from robid.models.elastic.fit.nuisance.scene import Scene
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.fitted import FittedModel
from robid.results.finding import two_digits
from robid.results.plausible.evidence import gather_evidence
from robid.robot.description import Robot

CHANCE = 50.0
"""Times what a random column explains does what counts: neighbouring lines err alike."""

_WIDER = 5.0  # than its prior is a nuisance that would explain a misfit


@dataclass(frozen=True)
class Scores:
    """Normal equations of the nuisances, the fit's own parameters eliminated."""

    nuisances: tuple[Nuisance, ...]  # The nuisances
    slope: FloatArray  # (n_nuisance,) Half the negative gradient of the cost by the amounts
    curvature: FloatArray  # (n_nuisance, n_nuisance) Half its Gauss-Newton Hessian, with what is known beforehand
    follow: FloatArray  # (n_param, n_nuisance) How far the parameters move by each amount
    cost: float  # Cost of the residual
    freedom: float  # Real residuals behind it


def score(fitted: FittedModel, nuisances: tuple[Nuisance, ...]) -> Scores:
    """Holds nuisances against what a fit leaves.

    Args:
        fitted: The fitted model in the configurations of the fit's own response.
        nuisances: Nuisances that were listed for its robot.
    """
    problem, internal = fitted.problem, fitted.internal
    residual, derivative = problem.linear(internal)
    columns = nuisance_columns(problem, internal, fitted.robot, fitted.options, nuisances, all_rest=False)
    own, added = _rows(fitted, derivative), _rows(fitted, columns)
    left = _rows(fitted, residual[..., None])[:, 0]
    prior = 0.5 / problem.parameters.prior_std**2
    # Fewer residuals than parameters leave none; what is known beforehand makes up for it.
    cost = float(left @ left)
    freedom = max(float(problem.residual_kind.parts) * (problem.weight > 0).sum() - own.shape[1], 1.0)
    # What errs alike over lines says less than it counts: it must not outweigh what is known beforehand.
    known = (
        max(0.5, CHANCE * cost / freedom) / (_WIDER * np.array([nuisance.common_std for nuisance in nuisances])) ** 2
    )
    mixed = own.T @ added
    follow = -np.linalg.lstsq(own.T @ own + np.diag(prior), mixed, rcond=1e-14)[0]
    # What the parameters leave of each column, and what is known of these beforehand: squares, which no rounding makes
    # negative, as it does the difference `added' added - mixed' (own' own + prior)^-1 mixed`.
    beyond = added + own @ follow
    return Scores(
        nuisances=nuisances,
        slope=added.T @ left + follow.T @ (own.T @ left - prior * internal),
        curvature=beyond.T @ beyond + follow.T @ (prior[:, None] * follow) + np.diag(known),
        follow=follow,
        cost=cost,
        freedom=freedom,
    )


def gain(scores: Scores, chosen: Sequence[int]) -> tuple[float, FloatArray]:
    """Cost that these nuisances save together, and their amounts; zero for those whose amount would make no sense."""
    amounts, kept = np.zeros(len(chosen)), np.arange(len(chosen))
    rows = np.array(chosen)
    least, most = (np.array([getattr(scores.nuisances[row], end) for row in chosen]) for end in ("least", "most"))
    while kept.size:
        own = rows[kept]
        curvature = scores.curvature[np.ix_(own, own)]
        size = np.sqrt(np.diag(curvature))
        scaled = curvature / np.outer(size, size) + 1e-9 * np.eye(own.size)
        found = np.linalg.solve(scaled, scores.slope[own] / size) / size
        sensible = (least[kept] <= found) & (found <= most[kept])
        if sensible.all():
            amounts[kept] = found
            return float(scores.slope[own] @ found), amounts
        kept = kept[sensible]
    return 0.0, amounts


def _rows(fitted: FittedModel, values: ComplexArray) -> FloatArray:
    """Weighted real rows (n_row, n_column) of (n_conf, n_freq, n_out, n_in, n_column)."""
    flat = fitted.problem.weighted(values).reshape(-1, values.shape[-1])
    return np.concatenate([flat.real, flat.imag])


_MOST_NAMED = 3


@dataclass(frozen=True)
class Explanation:
    """What freeing something that the robot file states would do to a fit."""

    cause: str  # The cause, of `robid.results.finding.CAUSES`
    names: tuple[str, ...]  # What would be free, the one that explains most first
    amounts: FloatArray  # (n_name,) How much of each
    units: tuple[str, ...]  # Units of the amounts
    share: float  # Share of the residual's cost that it explains, beyond what as many random columns would
    moved: FloatArray  # (n_param,) How far the internal parameters would move
    stated: tuple[float, ...] = ()  # What the robot file says of each; zero where only amounts are
    free: tuple[str, ...] = ()  # Names that free it; none where no fit can estimate it
    fixed: tuple[str, ...] = ()  # Names that the options keep at the file's value, though their kind is estimated
    correct: tuple[str, ...] = ()  # What to correct in robot file or log description, where no fit can estimate it
    at_most: bool = False  # Whether what `free` estimates is less at liberty than what was tested

    @property
    def what(self) -> str:
        """What would be free and how much of it, the first few."""
        stated = self.stated or (0.0,) * len(self.names)
        signed = "" if self.cause == "missing_spring" else "+"
        named = zip(self.names, self.amounts.tolist(), self.units, stated, strict=True)
        told = [_told(*each, signed) for each in named]
        more = f" and {len(told) - _MOST_NAMED} more" if len(told) > _MOST_NAMED else ""
        return ", ".join(told[:_MOST_NAMED]) + more


def _told(name: str, amount: float, unit: str, stated: float, signed: str) -> str:
    if stated:
        return f"a {name} of {stated + float(two_digits(amount)):.6g} instead of {stated:.6g} {unit}".rstrip()
    return f"{name} {two_digits(amount, signed)} {unit}" if unit else f"a {name}"


_RATIO_STD = 0.1
_RATIO_STEP = 1e-5
_LEAST_RATIO, _MOST_RATIO = 0.5, 2.0  # times the stated one
_TURNED_RAD = float(np.deg2rad(5.0))
_CONFIRMED = 0.01
_MILLI = 1e3
_BACKLASH_STD, _MOST_BACKLASH = 0.1, 2.0  # mrad: a gear of good quality has some 0.3


def candidates(robot: Robot, frf: Frf, options: ElasticOptions | None = None) -> tuple[Nuisance, ...]:
    """Lists explanations of a misfit that are no nuisances of a robot file.

    They widen no interval: ratios are exact or plainly wrong, so are drives, all in one clock or a sample late, and
    backlash leaves no linear spring to estimate. In a few clusters of configurations anything goes with the load.
    What the options have a fit estimate is left out: nothing is left of it.
    """
    estimated = () if options is None else {each.name for each in estimated_nuisances(robot, options)}
    few = len(group_clusters(frf.configurations)) < FEWEST_CLUSTERS
    kinds = OneSided | Drift if few else OneSided | Drift | LoadFriction
    freed = (each for each in estimable_nuisances(robot) if isinstance(each.effect, kinds))
    every = *_gear_ratios(robot, frf), *_backlashes(robot), *_late_drives(robot, frf), *freed
    return tuple(each for each in every if each.name not in estimated)


def gear_ratio(robot: Robot, joint: int) -> Nuisance:
    """Returns the explanation that a joint's gear ratio is not as stated, in the unit of the ratio."""
    own = robot.joints[joint]
    stated = own.motor.gear_ratio
    least, most = sorted(((_LEAST_RATIO - 1) * stated, (_MOST_RATIO - 1) * stated))
    unit = "rad/m" if robot.prismatic[joint] else "turns per turn"
    return Nuisance(
        f"{own.name}.gear_ratio",
        f"gear ratio of {own.name}",
        "gear_ratio",
        unit,
        _RATIO_STD * abs(stated),
        0.0,
        RobotMove(partial(with_gear_ratio, joint), _RATIO_STEP * abs(stated)),
        least,
        most,
        stated,
    )


def _late_drives(robot: Robot, frf: Frf) -> Iterator[Nuisance]:
    """Drives later than the others, in samples.

    None is earlier: with the common delay, that is all others later, and of two motors nothing tells the two apart.
    """
    for each in estimable_nuisances(robot):
        if isinstance(each.effect, LateDrive):
            effect = replace(each.effect, amount_s=frf.sampling_period_s)
            yield replace(each, unit="samples", common_std=1.0, natural=1.0, least=0.0, effect=effect)


def _gear_ratios(robot: Robot, frf: Frf) -> Iterator[Nuisance]:
    confirmed = _confirmed(robot, frf)
    for index, joint in enumerate(robot.joints):
        if joint.name not in confirmed:
            yield gear_ratio(robot, index)


def _confirmed(robot: Robot, frf: Frf) -> set[str]:
    """Joints whose mean motor angles follow the stated configurations by the stated ratio."""
    evidence = gather_evidence(frf)
    if evidence.mean_angle is None or not evidence.belongs_to(robot) or len(evidence.configurations) < 2:
        return set()
    rows = evidence.joints(robot)
    expected = evidence.configurations @ robot.motor_per_arm[rows].T
    away = expected - expected.mean(axis=0)
    square = (away**2).sum(axis=0)
    slope = (away * evidence.mean_angle).sum(axis=0) / np.maximum(square, np.finfo(float).tiny)
    turned = np.ptp(expected / robot.gear_ratio[rows], axis=0) > _TURNED_RAD
    sure = turned & (np.abs(slope - 1) < _CONFIRMED)
    return {name for name, known in zip(evidence.names, sure.tolist(), strict=True) if known}


@dataclass(frozen=True)
class Backlash(Effect):
    """A gap in a gear, in thousandths of its unit of motion.

    A gear that rests at a deflection `y` and swings by `s`, root mean square and normally distributed, passes through
    a small gap `b` for `b / s` times the standard normal density at `y / s` of its time, and is softer by that share.
    A load holds a gear on one side of its gap, so configurations distinguish backlash from softness.

    Source:
        Statistical linearisation of a dead zone: Gelb and Vander Velde (1968), app. E.
    """

    put_in = False
    spring: int  # Index of the gear


@column.register
def _(effect: Backlash, scene: Scene) -> ComplexArray:
    swing = np.sqrt(scene.swing[:, :, effect.spring].sum(axis=1))
    moves = swing > 0  # zero where the swing is unknown
    size = np.where(moves, swing, 1.0)
    load = scene.problem.model.rest.deflection[:, effect.spring] / size
    softer = moves * np.exp(-0.5 * load**2) / (np.sqrt(2 * np.pi) * size * _MILLI)
    return np.asarray(-softer[:, None, None, None] * scene.gear_slopes[..., effect.spring])


def _backlashes(robot: Robot) -> Iterator[Nuisance]:
    for index, spring in enumerate(robot.springs):
        if spring.place == "transmission":
            unit = "mm" if robot.is_linear(spring) else "mrad"
            names = f"{spring.name}.backlash", f"backlash of {spring.name}"
            sizes = _BACKLASH_STD, 0.0
            yield Nuisance(*names, "gear_nonlinearity", unit, *sizes, Backlash(index), 0.0, _MOST_BACKLASH)


_ROUNDS, _STEPS, _LAST_STEPS = 4, 4, 25
_ARRIVED = 1e-3
_LONGEST = 0.15  # of the ratio, in a round
_KEPT = 2
_ENOUGH = 0.9  # of the cost, so that no other joint needs to be tried


@dataclass(frozen=True)
class RatioTrial:
    """What another gear ratio does to a fit."""

    joint: int  # Index of the joint
    ratio: float  # The ratio that explains most
    share: float  # Share of the residual's cost that it takes away
    moved: FloatArray  # (n_param,) How far it moves the internal parameters


def try_ratios(fitted: FittedModel, likely: Sequence[int]) -> list[RatioTrial]:
    """Tries other gear ratios, the most telling first.

    Each round moves a ratio by what the score test says, and lets the fit follow for some steps.

    Args:
        fitted: The fitted model in the configurations of the fit's own response.
        likely: Joints, those first that explain most to first order.
    """
    found: list[RatioTrial] = []
    for joint in likely[:_KEPT]:
        trial = _try(fitted, joint)
        found += [] if trial is None else [trial]
        if trial is not None and trial.share > _ENOUGH:
            break
    return sorted(found, key=lambda trial: -trial.share)


def _try(fitted: FittedModel, joint: int) -> RatioTrial | None:
    stated = abs(fitted.robot.joints[joint].motor.gear_ratio)
    now = fitted
    for _ in range(_ROUNDS):
        try:
            scores = score(now, (gear_ratio(now.robot, joint),))
            amount = float(np.clip(gain(scores, (0,))[1][0], -_LONGEST * stated, _LONGEST * stated))
            if abs(amount) < _ARRIVED * stated:
                break
            other = with_gear_ratio(joint, now.robot, amount)
            there = _followed(other, now, now.internal + scores.follow[:, 0] * amount)
        except DataError:  # a robot that finds no rest explains nothing
            break
        if there.cost >= now.cost:
            break
        now = there
    if now is fitted:
        return None
    end = optimise(now.problem, now.internal, max_iterations=_LAST_STEPS)
    ratio = now.robot.joints[joint].motor.gear_ratio
    return RatioTrial(joint, ratio, 1 - end.cost / fitted.cost, end.parameters - fitted.internal)


def _followed(robot: Robot, fitted: FittedModel, start: FloatArray) -> FittedModel:
    """Another robot's model, some steps on: from a start, from where it was, or from the robot file's values.

    A fit by a ratio that is far off is lost: from there nothing leads back.
    """
    problem = problem_at(fitted.problem, fitted.parameters, robot, fitted.options)
    starts = start, fitted.internal, np.zeros_like(start)
    end = min((optimise(problem, each, max_iterations=_STEPS) for each in starts), key=lambda end: end.cost)
    return replace(fitted, problem=problem, internal=end.parameters, robot=robot)
