"""Options of the elastic fit, and the names of parameters that they may say something about."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from robid.arrays import group, option
from robid.errors import SettingsError
from robid.frf.residual import RESIDUALS, EstimatorKind, Residual
from robid.robot.parameters import ELASTIC, FREE, LOGARITHMIC, PARAMETER_KINDS, ElasticKind, element_names

if TYPE_CHECKING:
    from robid.robot.description import Robot
    from robid.robot.response import ElasticParameters


WeightsKind = Literal["user", "optimal", "optimal_full", "inflated", "estimated"]
Optimizer = Literal["levenberg", "scipy", "nlopt", "nlopt_global"]
BY_SPRING: tuple[ElasticKind, ...] = ("stiffness", "damping")
"""Kinds that a spring's name frees of it."""
_COMPLIANCE = ".compliance"


def spring_of(name: str) -> str:
    """Name of the spring that something frees which may end as a nuisance of its compliance does."""
    return name.removesuffix(_COMPLIANCE)


@dataclass(frozen=True)
class Weights:
    """Weights of the residual."""

    kind: WeightsKind = option(
        "inflated",
        "`user`: constant per element. `optimal`: 1/variance. `optimal_full`: inverse covariance, with "
        "correlations between a line's elements. `inflated`: 1/(variance + model error). `estimated`: the same "
        "with the model error from the residuals of each element after a first fit by `inflated`.",
    )
    off_diagonal: float = option(0.3, "User weight of off-diagonal elements, diagonal is 1.", ge=0)
    low_cut_hz: float = option(0.0, "Lines below have no weight [Hz].", ge=0)
    model_error: float = option(0.02, "Relative model error that `inflated` adds, and `estimated` at first.", ge=0)


@dataclass(frozen=True)
class ElasticOptions:
    """The elastic fit."""

    estimator: EstimatorKind = option("lls", "Logarithmic or plain least squares, or logarithmic of magnitudes only.")
    weights: Weights = group(Weights, "Weights of the residual.")
    free: tuple[ElasticKind | str, ...] = option(
        FREE,
        f"Estimated kinds of parameters: {', '.join(f'`{kind}`' for kind in ELASTIC)}."
        " And nuisance parameters, by name or group: `payload`, `masses`, `axis_2.mass`,"
        " `axis_2.com`, `gear_coupling`, `torque_constant`, `counterbalance`, `load_damping`, `hysteresis`,"
        " `bearing_axis_2_x`. If only nuisance parameters are named, the default kinds are estimated too.",
        max_length=1_000,
    )
    fixed: tuple[str, ...] = option(
        (), "Names of single parameters that stay at the robot file's value.", max_length=1_000
    )
    tied: Mapping[str, str] = group(
        dict,
        "Parameters that share the correction of another one of their kind, by name. It is a common factor on "
        "the robot file's values, for linear kinds a common multiple of their scales.",
    )
    bounds: Mapping[str, tuple[float, float]] = group(
        dict, "Lower and upper bound of single parameters, by name, in their own units."
    )
    starts: int = option(1, "Most starts; the first is the robot file's values.", ge=1, le=10_000)
    agreeing_starts: int = option(
        4,
        "Starts that end in the best minimum after which no further ones are made; 0 makes all of them.",
        ge=0,
        le=10_000,
    )
    start_decades: float = option(1.0, "Further starts are log-uniform within this many decades.", ge=0)
    prior_decades: float = option(
        1.0,
        "Prior standard deviation of the robot file's springs, dampers and link inertias [decades]; that of "
        "motor inertias is the file's `inertia_relative_std`.",
        gt=0,
    )
    strategy: Literal["staged", "plain"] = option(
        "staged",
        "From a start to a minimum: over heavier dampers and fewer lines, with diverged parameters reset; or direct.",
    )
    optimizer: Optimizer = option(
        "levenberg",
        "Optimiser that ends each start: robid's own, scipy's least_squares, nlopt's SLSQP, or nlopt's MLSL "
        "over the bounds before robid's own.",
    )
    correct_torques: bool = option(
        True, "Whether the fit also corrects the compensated friction and ripple, as nuisance parameters."
    )
    max_iterations: int = option(200, "Iteration limit of one start.", ge=1, le=100_000)
    statics: Literal["updates", "every_iterate"] = option(
        "updates",
        "Whether inertia and gravity stay as at rest between updates, or follow the rest position of every "
        "iterate to first order. They follow it where locations are estimated.",
    )
    statics_updates: int = option(
        4, "Largest number of new solutions of the equilibrium for the fitted springs; 0 is none.", ge=0, le=1_000
    )
    identifiable_relative_std: float = option(
        0.2, "Predicted relative deviation up to which a parameter counts as identifiable.", gt=0
    )
    bootstrap: int = option(
        0,
        "Number of fits repeated on realizations with new random weights. Their intervals assume nothing about "
        "the correlation of a realization's errors; 0 for none.",
        ge=0,
        le=100_000,
    )
    confidence: float = option(0.95, "Level of the intervals.", gt=0, lt=1)
    seed: int = option(1, "Seed of the starts.", ge=0)

    @property
    def kinds(self) -> tuple[ElasticKind, ...]:
        """Kinds of parameters that are estimated."""
        named = sorted((kind for kind in ELASTIC if kind in self.free), key=self.free.index)
        return tuple(named) or (FREE if self.estimated else ())

    @property
    def estimated(self) -> tuple[str, ...]:
        """Names of nuisances that are estimated, or of groups of them."""
        return tuple(dict.fromkeys(name for name in self.free if name not in ELASTIC))

    def frees(self, kind: str, name: str) -> bool:
        """Whether a parameter is of a kind that is free, or of a spring that is estimated by its name."""
        by_spring = kind in BY_SPRING and name.removesuffix(f".{kind}") in map(spring_of, self.estimated)
        return kind in self.kinds or by_spring

    def estimates(self, kind: str, name: str) -> bool:
        """Whether a parameter is estimated: free and not fixed."""
        return self.frees(kind, name) and name not in self.fixed

    @property
    def residual(self) -> Residual:
        """How the estimator compares responses."""
        return RESIDUALS[self.estimator]


def check_names(
    options: ElasticOptions,
    every: Mapping[str, list[str | None]],
    nominal: ElasticParameters,
    unknown: Sequence[tuple[str, str]] = (),
) -> None:
    """Refuses options that name what is not there, tie or bound what cannot be, or estimate what starts at zero.

    Args:
        options: Options of the fit.
        every: Names of every free kind's elements.
        nominal: Nominal values.
        unknown: What is estimated and not known, each with what may be meant.

    Raises:
        SettingsError: With every problem.
    """
    kind_of = {name: kind for kind, names in every.items() for name in names if name is not None}
    free = {name: kind for name, kind in kind_of.items() if name not in options.fixed}
    known = ", ".join(sorted(kind_of))
    problems = [f"S052 `free`: {free_problem(*each)}" for each in unknown]
    missing = [name for name in options.fixed if name not in kind_of]
    problems += [f"S053 `fixed` names `{name}`, which is not free (free: {known})" for name in missing]
    problems += [f"`{section}`: {problem}" for section, problem in name_problems(options, free)]
    for kind in LOGARITHMIC:
        values = getattr(nominal, kind)
        problems += [
            f"S055 `{name}` starts at {value:g}, but must be positive to be estimated"
            for name, value in zip(every.get(kind, []), values, strict=False)
            if value <= PARAMETER_KINDS[kind].lower and name in free
        ]
    if problems:
        remedy = "correct `free`, `fixed`, `tied`, `bounds` or the robot file's values"
        raise SettingsError("; ".join(problems), where="fit", remedy=remedy)


def estimable_names(robot: Robot, options: ElasticOptions) -> dict[str, list[str | None]]:
    """Names of the parameters that a fit estimates unless it fixes them, by kind; None for all others of the kind."""
    every = {str(kind): element_names(robot, kind) for kind in options.kinds}
    for kind in BY_SPRING if options.estimated else ():
        names = [name if name and options.frees(kind, name) else None for name in element_names(robot, kind)]
        if any(names):
            every[kind] = names
    return every


def free_problem(name: str, meant: str) -> str:
    """Says that a name cannot be estimated."""
    return f"S056 nothing of this robot is called `{name}`; {meant}"


def name_problems(options: ElasticOptions, free: Mapping[str, str]) -> list[tuple[str, str]]:
    """Says what is wrong with `tied` and `bounds`: which of the two, and a sentence.

    Args:
        options: Options of the fit.
        free: Kind of each parameter that is estimated, by name.
    """
    problems = []
    for name, leader in options.tied.items():
        missing = [f"`{each}`" for each in (name, leader) if each not in free]
        if missing:
            problems.append(
                ("tied", f"S352 {' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not estimated")
            )
        elif leader in options.tied:
            problems.append(("tied", f"S353 `{name}` cannot follow `{leader}`, which is tied itself"))
        elif free[name] != free[leader]:
            problems.append(("tied", f"S354 `{name}` cannot follow `{leader}`, which is of another kind"))
    for name, (low, high) in options.bounds.items():
        if name not in free:
            problems.append(("bounds", f"S355 `{name}` is not estimated"))
        elif name in options.tied:
            problems.append(("bounds", f"S356 `{name}` is tied: bound `{options.tied[name]}`"))
        if not low < high:
            problems.append(("bounds", f"S357 `{name}` has nothing between {low:g} and {high:g}"))
    return problems


def restricted(options: ElasticOptions, free: Sequence[str], keeps: Callable[[str], bool]) -> ElasticOptions:
    """Returns options under which only these are free, with what is said of parameters whose names are kept."""
    return replace(
        options,
        free=tuple(free),
        fixed=tuple(filter(keeps, options.fixed)),
        tied={name: leader for name, leader in options.tied.items() if keeps(name)},
        bounds={name: ends for name, ends in options.bounds.items() if keeps(name)},
    )
