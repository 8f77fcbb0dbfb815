"""Names of the parameters of an elastic fit, and what options may say about them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from robid.errors import SettingsError
from robid.models.elastic.fit.options import BY_SPRING, ElasticOptions
from robid.robot.parameters import LOGARITHMIC, PARAMETER_KINDS, ElasticKind, element_names, kind_of_name

if TYPE_CHECKING:
    from robid.robot.description import Robot
    from robid.robot.response import ElasticParameters


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
        unknown: What is freed and not known, each with what may be meant.

    Raises:
        SettingsError: With every problem.
    """
    kind_of = {name: kind for kind, names in every.items() for name in names if name is not None}
    free = {name: kind for name, kind in kind_of.items() if name not in options.fixed}
    known = ", ".join(sorted(kind_of))
    problems = [f"`free`: {free_problem(*each)}" for each in unknown]
    missing = [name for name in options.fixed if name not in kind_of]
    problems += [f"`fixed` names `{name}`, which is not free (free: {known})" for name in missing]
    problems += [f"`{section}`: {problem}" for section, problem in name_problems(options, free)]
    for kind in LOGARITHMIC:
        values = getattr(nominal, kind)
        problems += [
            f"`{name}` starts at {value:g}, but must be positive to be estimated"
            for name, value in zip(every.get(kind, []), values, strict=False)
            if value <= PARAMETER_KINDS[kind].lower and name in free
        ]
    if problems:
        remedy = "correct `free`, `fixed`, `tied`, `bounds` or the robot file's values"
        raise SettingsError("; ".join(problems), where="fit", remedy=remedy)


def estimable_names(robot: Robot, options: ElasticOptions) -> dict[str, list[str | None]]:
    """Names of the parameters that a fit estimates unless it fixes them, by kind; None for all others of the kind."""
    every = {str(kind): element_names(robot, kind) for kind in options.kinds}
    for kind in BY_SPRING if options.freed else ():
        names = [name if name and options.frees(kind, name) else None for name in element_names(robot, kind)]
        if any(names):
            every[kind] = names
    return every


def free_problem(name: str, meant: str) -> str:
    """Says that a name cannot be freed."""
    return f"nothing of this robot is called `{name}`; {meant}"


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
            problems.append(("tied", f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} not estimated"))
        elif leader in options.tied:
            problems.append(("tied", f"`{name}` cannot follow `{leader}`, which is tied itself"))
        elif free[name] != free[leader]:
            problems.append(("tied", f"`{name}` cannot follow `{leader}`, which is of another kind"))
    for name, (low, high) in options.bounds.items():
        if name not in free:
            problems.append(("bounds", f"`{name}` is not estimated"))
        elif name in options.tied:
            problems.append(("bounds", f"`{name}` is tied: bound `{options.tied[name]}`"))
        if not low < high:
            problems.append(("bounds", f"`{name}` has nothing between {low:g} and {high:g}"))
    return problems


def restricted(options: ElasticOptions, kinds: tuple[ElasticKind, ...]) -> ElasticOptions:
    """Returns options under which only some of the free kinds are estimated, with what is said of these."""

    def kept(name: str) -> bool:
        return kind_of_name(name) in kinds

    return replace(
        options,
        free=kinds,
        fixed=tuple(name for name in options.fixed if kept(name)),
        tied={name: leader for name, leader in options.tied.items() if kept(name)},
        bounds={name: ends for name, ends in options.bounds.items() if kept(name)},
    )
