"""Likely causes of what a fitted model leaves unexplained: score tests, and trials of springs that are not there."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.solution import ElasticSolution
from robid.fit.estimate import Estimate
from robid.robot.description import Robot
from robid.validation.doubt import Doubt, two_digits
from robid.validation.elastic.fitted import FittedModel
from robid.validation.elastic.suspects import Suspect, suspects
from robid.validation.elastic.trials import try_springs

_CHANCE = 50.0  # times what a random column explains: neighbouring lines err alike
_TELLING = 0.1
_MOST_NAMED = 3
_RUINED = 0.2  # relative error of a spring
_MOSTLY = 0.5  # of the misfit
_CLEARLY = 3.0  # half-widths


@dataclass(frozen=True)
class Explanation:
    """What freeing something that the robot file states would do to a fit.

    Attributes:
        cause: The cause, of `robid.validation.doubt.CAUSES`.
        names: What would be free, the one that explains most first.
        amounts (n_name,): How much of each.
        units: Units of the amounts.
        share: Share of the residual's cost that it explains, beyond what as many random columns would.
        moved (n_param,): How far the internal parameters would move.
    """

    cause: str
    names: tuple[str, ...]
    amounts: FloatArray
    units: tuple[str, ...]
    share: float
    moved: FloatArray


@dataclass(frozen=True)
class _Scores:
    """Normal equations of the suspects, the fit's own parameters eliminated.

    Attributes:
        slope (n_suspect,): Half the negative gradient of the cost by the amounts.
        curvature (n_suspect, n_suspect): Half its Gauss-Newton Hessian.
        follow (n_param, n_suspect): How far the parameters move by each amount.
        cost: Cost of the residual.
        freedom: Real residuals behind it.
    """

    slope: FloatArray
    curvature: FloatArray
    follow: FloatArray
    cost: float
    freedom: float


def misfit_doubts(
    robot: Robot, solution: ElasticSolution, fitted: FittedModel, options: ElasticOptions
) -> tuple[Doubt, ...]:
    """Names what would explain a fit's residual, the most telling first.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        solution: What the fit found.
        fitted: The fitted model in the configurations of the fit's own response.
        options: Options of the fit.

    Returns:
        Doubts whose strength is how many half widths of its interval some parameter would move. The first is decisive
        where a spring was put in place, explains most of the residual and leaves another one far from its estimate.
    """
    found = [each for each in explain(robot, fitted, options) if each.share > _TELLING]
    return tuple(_doubt(solution.estimate, each, leads=each is found[0]) for each in found)


def explain(robot: Robot, fitted: FittedModel, options: ElasticOptions) -> list[Explanation]:
    """Ranks what a robot file may have wrong by how much of a fit's residual it explains.

    Each suspect is a column beside the parameters' own, which are at liberty to follow. Per cause the one that
    explains most is taken, then the next, as long as each explains more than chance. A missing spring changes the
    response too much for that: each is put in its place and the fit goes on for some steps.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        fitted: The fitted model in the configurations of the fit's own response.
        options: Options of the fit.

    Source:
        Rao's score test; METHODS sec. 11.
    """
    every = suspects(robot, fitted, options)
    scores = _score(fitted, every)
    groups: dict[str, list[int]] = defaultdict(list)
    for index, suspect in enumerate(every):
        groups[suspect.doubt.cause].append(index)
    found = [each for group in groups.values() if (each := _explanation(every, scores, group)) is not None]
    found += _missing_spring(robot, fitted, options)
    return sorted(found, key=lambda each: -each.share)


def _missing_spring(robot: Robot, fitted: FittedModel, options: ElasticOptions) -> list[Explanation]:
    trials = try_springs(robot, fitted, options)[:1]
    return [
        Explanation(
            "missing_spring",
            (trial.spring.name,),
            np.array([1e-6 * trial.spring.stiffness]),
            ("MN/m" if robot.is_linear(trial.spring) else "MN m/rad",),
            trial.share,
            trial.moved,
        )
        for trial in trials
    ]


def _score(fitted: FittedModel, every: list[Suspect]) -> _Scores:
    problem, internal = fitted.problem, fitted.internal
    residual, derivative = problem.linear(internal)
    columns = np.stack([suspect.column for suspect in every], axis=-1)
    kind = problem.residual_kind
    columns = kind.part(columns * kind.per_relative(problem.model_response(internal))[..., None])
    own, added = _rows(fitted, derivative), _rows(fitted, columns)
    left = _rows(fitted, residual[..., None])[:, 0]
    prior = 0.5 / problem.parameters.prior_std**2
    mixed = own.T @ added
    follow = -np.linalg.lstsq(own.T @ own + np.diag(prior), mixed, rcond=1e-14)[0]
    return _Scores(
        slope=added.T @ left + follow.T @ (own.T @ left - prior * internal),
        curvature=added.T @ added + mixed.T @ follow,
        follow=follow,
        cost=float(left @ left),
        freedom=float(kind.parts) * (problem.weight > 0).sum() - own.shape[1],
    )


def _rows(fitted: FittedModel, values: ComplexArray) -> FloatArray:
    """Weighted real rows (n_row, n_column) of (n_conf, n_freq, n_out, n_in, n_column)."""
    flat = fitted.problem.weighted(values).reshape(-1, values.shape[-1])
    return np.concatenate([flat.real, flat.imag])


def _explanation(every: list[Suspect], scores: _Scores, group: list[int]) -> Explanation | None:
    """Adds suspects of one cause while each explains more than its fair share of what is left."""
    chosen: list[int] = []
    gained = 0.0
    amounts: FloatArray = np.zeros(0)
    while len(chosen) < len(group):
        trials = [(*_gain(scores, [*chosen, index], every), index) for index in group if index not in chosen]
        gain, solved, index = max(trials, key=lambda trial: trial[0])
        if gain - gained <= _CHANCE * (scores.cost - gain) / scores.freedom:
            break
        chosen, gained, amounts = [*chosen, index], gain, solved
    if not chosen:
        return None
    fair = gained - len(chosen) * _CHANCE * (scores.cost - gained) / scores.freedom
    return Explanation(
        every[chosen[0]].doubt.cause,
        tuple(every[index].doubt.title for index in chosen),
        amounts,
        tuple(every[index].doubt.unit for index in chosen),
        fair / scores.cost,
        scores.follow[:, chosen] @ amounts,
    )


def _gain(scores: _Scores, chosen: list[int], every: list[Suspect]) -> tuple[float, FloatArray]:
    """Cost that these suspects explain together, and their amounts; none where an amount makes no sense."""
    curvature = scores.curvature[np.ix_(chosen, chosen)]
    size = np.sqrt(np.maximum(np.diag(curvature), 1e-300))
    scaled = curvature / np.outer(size, size) + 1e-9 * np.eye(len(chosen))
    amounts = np.linalg.solve(scaled, scores.slope[chosen] / size) / size
    least = np.array([every[index].doubt.least for index in chosen])
    most = np.array([every[index].doubt.most for index in chosen])
    sensible = (least <= amounts).all() and (amounts <= most).all()
    explained = float(scores.slope[chosen] @ amounts) if sensible else 0.0
    return explained, amounts


def _doubt(estimate: Estimate, found: Explanation, *, leads: bool) -> Doubt:
    named = zip(found.names[:_MOST_NAMED], found.amounts.tolist(), found.units, strict=False)
    signed = "" if found.cause == "missing_spring" else "+"
    what = ", ".join(f"{name} {two_digits(amount, signed)} {unit}" for name, amount, unit in named)
    half = np.maximum(0.5 * (estimate.upper - estimate.lower), 1e-300)
    slopes = np.where(np.array(estimate.nominal) == 0, 1.0, np.abs(estimate.value))
    telling = np.array([kind in ("stiffness", "damping") for kind in estimate.kinds])
    widths = np.where(telling, np.abs(found.moved) * slopes / half, 0.0)
    ruined = _ruined(estimate, found, widths) if leads else None
    worst = int(np.argmax(widths)) if ruined is None else ruined
    message = (
        f"{what} would explain {found.share:.0%} of the misfit and move {estimate.names[worst]} by "
        f"{two_digits(float(widths[worst]))} half-widths of its interval"
    )
    if ruined is not None:
        message += f", which leaves it {_error(found)[ruined]:.0%} off"
    return Doubt(found.cause, message, decisive=ruined is not None, strength=float(widths[worst]))


def _ruined(estimate: Estimate, found: Explanation, widths: FloatArray) -> int | None:
    """The identified spring that an explanation leaves farthest off, if that is far and the explanation good.

    Only springs that were put in place count: a column beside the parameters' own says little of what is far away.
    """
    if found.cause != "missing_spring" or found.share < _MOSTLY:
        return None
    springs = np.array([kind == "stiffness" for kind in estimate.kinds]) & estimate.identified & (widths > _CLEARLY)
    error = np.where(springs, _error(found), 0.0)
    worst = int(np.argmax(error))
    return worst if error[worst] > _RUINED else None


def _error(found: Explanation) -> FloatArray:
    """Relative error (n_param,) of each logarithmic estimate, were the explanation true."""
    return np.asarray(np.abs(np.expm1(np.clip(-found.moved, -50.0, 50.0))))
