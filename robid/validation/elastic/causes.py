"""Likely causes of what a fitted model leaves unexplained: score tests, and trials of springs that are not there."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.fit.elastic.doubts.column import DoubtColumn
from robid.fit.elastic.doubts.columns import doubt_columns
from robid.fit.elastic.doubts.freed import free_with
from robid.fit.elastic.doubts.listing import list_doubts
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.solution import ElasticSolution
from robid.fit.estimate import Estimate
from robid.robot.description import Robot
from robid.validation.doubt import CAUSES, Doubt, two_digits
from robid.validation.elastic.fitted import FittedModel
from robid.validation.elastic.remedies import remedy
from robid.validation.elastic.trials import try_springs

_CHANCE = 50.0  # times what a random column explains: neighbouring lines err alike
_WIDER = 5.0  # than its prior is a doubt that would explain a misfit
_TELLING = 0.1
_MOST_OF_IT = 0.9  # of what all doubts of a cause explain
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
        stated: What the robot file says of each; zero where only amounts are.
        free: Names that free it; none where no fit can estimate it.
        fixed: Names that the options keep at the file's value, though their kind is estimated.
    """

    cause: str
    names: tuple[str, ...]
    amounts: FloatArray
    units: tuple[str, ...]
    share: float
    moved: FloatArray
    stated: tuple[float, ...] = ()
    free: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()

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
        return f"a {name} of {stated + float(two_digits(amount)):.6g} instead of {stated:.6g} {unit}"
    return f"{name} {two_digits(amount, signed)} {unit}"


@dataclass(frozen=True)
class _Scores:
    """Normal equations of the doubts, the fit's own parameters eliminated.

    Attributes:
        doubts: The doubts.
        slope (n_doubt,): Half the negative gradient of the cost by the amounts.
        curvature (n_doubt, n_doubt): Half its Gauss-Newton Hessian, with what is known of them beforehand.
        follow (n_param, n_doubt): How far the parameters move by each amount.
        cost: Cost of the residual.
        freedom: Real residuals behind it.
    """

    doubts: tuple[DoubtColumn, ...]
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
    return tuple(_doubt(solution.estimate, each, found if each is found[0] else (), options) for each in found)


def explain(robot: Robot, fitted: FittedModel, options: ElasticOptions) -> list[Explanation]:
    """Ranks what a robot file may have wrong by how much of a fit's residual it explains.

    Each doubt is a column beside the parameters' own, which are at liberty to follow. Those of one cause are freed
    together, as far as their priors let them, and the fewest are named that explain most of what all of them do. A
    missing spring changes the response too much for that: each is put in its place and the fit goes on for some steps.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        fitted: The fitted model in the configurations of the fit's own response.
        options: Options of the fit.

    Source:
        Rao's score test; METHODS sec. 11.
    """
    scores = _score(robot, fitted, options)
    groups: dict[str, list[int]] = defaultdict(list)
    for index, doubt in enumerate(scores.doubts):
        groups[doubt.cause].append(index)
    found = [each for group in groups.values() if (each := _explanation(scores, group, options)) is not None]
    found += _missing_spring(robot, fitted, options)
    return sorted(found, key=lambda each: -each.share)


def _missing_spring(robot: Robot, fitted: FittedModel, options: ElasticOptions) -> list[Explanation]:
    trials = try_springs(robot, fitted, options)[:1]
    return [
        Explanation(
            "missing_spring",
            (trial.title,),
            np.array([1e-6 * trial.spring.stiffness]),
            ("MN/m" if robot.is_linear(trial.spring) else "MN m/rad",),
            trial.share,
            trial.moved,
            free=(trial.spring.name,),
        )
        for trial in trials
    ]


def _score(robot: Robot, fitted: FittedModel, options: ElasticOptions) -> _Scores:
    problem, internal = fitted.problem, fitted.internal
    doubts = tuple(
        doubt for doubt in list_doubts(robot, options) if doubt.cause != "missing_spring" and doubt.common_std > 0
    )
    residual, derivative = problem.linear(internal)
    own, added = _rows(fitted, derivative), _rows(fitted, doubt_columns(problem, internal, robot, options, doubts))
    left = _rows(fitted, residual[..., None])[:, 0]
    prior = 0.5 / problem.parameters.prior_std**2
    cost, freedom = float(left @ left), float(problem.residual_kind.parts) * (problem.weight > 0).sum() - own.shape[1]
    # What errs alike over lines says less than it counts: it must not outweigh what is known beforehand.
    known = max(0.5, _CHANCE * cost / freedom) / (_WIDER * np.array([doubt.common_std for doubt in doubts])) ** 2
    mixed = own.T @ added
    follow = -np.linalg.lstsq(own.T @ own + np.diag(prior), mixed, rcond=1e-14)[0]
    return _Scores(
        doubts=doubts,
        slope=added.T @ left + follow.T @ (own.T @ left - prior * internal),
        curvature=added.T @ added + mixed.T @ follow + np.diag(known),
        follow=follow,
        cost=cost,
        freedom=freedom,
    )


def _rows(fitted: FittedModel, values: ComplexArray) -> FloatArray:
    """Weighted real rows (n_row, n_column) of (n_conf, n_freq, n_out, n_in, n_column)."""
    flat = fitted.problem.weighted(values).reshape(-1, values.shape[-1])
    return np.concatenate([flat.real, flat.imag])


def _explanation(scores: _Scores, group: list[int], options: ElasticOptions) -> Explanation | None:
    """The fewest doubts of a cause that explain most of what all do; None where chance explains as much."""
    whole, _ = _gain(scores, group)
    chosen: list[int] = []
    gained: float = 0.0
    amounts: FloatArray = np.zeros(0)
    while len(chosen) < len(group) and gained < _MOST_OF_IT * whole:
        trials = [(*_gain(scores, [*chosen, index]), index) for index in group if index not in chosen]
        gained, amounts, index = max(trials, key=lambda trial: trial[0])
        chosen.append(index)
    fair = gained - len(chosen) * _CHANCE * (scores.cost - gained) / scores.freedom
    if fair <= 0:
        return None
    named = [scores.doubts[index] for index in chosen]
    return Explanation(
        named[0].cause,
        tuple(doubt.title for doubt in named),
        amounts,
        tuple(doubt.unit for doubt in named),
        fair / scores.cost,
        scores.follow[:, chosen] @ amounts,
        tuple(doubt.stated for doubt in named),
        remedy(named),
        tuple(doubt.name for doubt in named if doubt.name in options.fixed),
    )


def _gain(scores: _Scores, chosen: list[int]) -> tuple[float, FloatArray]:
    """Cost that these doubts save together, and their amounts; zero for those whose amount would make no sense."""
    amounts, kept = np.zeros(len(chosen)), np.arange(len(chosen))
    rows = np.array(chosen)
    least, most = (np.array([getattr(scores.doubts[row], end) for row in chosen]) for end in ("least", "most"))
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


def _doubt(estimate: Estimate, found: Explanation, ranked: Sequence[Explanation], options: ElasticOptions) -> Doubt:
    """What an explanation speaks against; the first of those ranked tells of the next ones too."""
    leads = bool(ranked)
    half = np.maximum(0.5 * (estimate.upper - estimate.lower), 1e-300)
    slopes = np.where(np.array(estimate.nominal) == 0, 1.0, np.abs(estimate.value))
    telling = np.array([kind in ("stiffness", "damping") for kind in estimate.kinds])
    widths = np.where(telling, np.abs(found.moved) * slopes / half, 0.0)
    ruined = _ruined(estimate, found, widths) if leads else None
    worst = int(np.argmax(widths)) if ruined is None else ruined
    hints = _remedies(found, options)
    hints += [f"next: {'; '.join(f'{CAUSES[each.cause]}, {each.share:.0%}' for each in ranked[1:])}"] * (
        len(ranked) > 1
    )
    told = f" ({'; '.join(hints)})" if hints else ""
    message = (
        f"{found.what} would explain {found.share:.0%} of the misfit{told} and move {estimate.names[worst]} by "
        f"{two_digits(float(widths[worst]))} half-widths of its interval"
    )
    if ruined is not None:
        message += f", which leaves it {_error(found)[ruined]:.0%} off"
    return Doubt(found.cause, message, decisive=ruined is not None, strength=float(widths[worst]))


def _remedies(found: Explanation, options: ElasticOptions) -> list[str]:
    """What to write into the settings of the fit; nothing where that stands there already."""
    free = free_with(options.free, found.free)
    kept = [f"`{name}`" for name in found.fixed]
    more = [] if {*free} <= {*options.free, *options.kinds} else [f"try `free: [{', '.join(free)}]`"]
    return [*more, *([f"take {' and '.join(kept)} out of `fixed`"] if kept else [])]


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
