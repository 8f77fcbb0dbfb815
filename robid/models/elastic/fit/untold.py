"""What a fit's data cannot tell of the gears' kinds that it frees, by name and with what to do."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from robid.arrays import FloatArray
from robid.models.elastic.fit.problem import Problem
from robid.results.estimate import Estimate
from robid.robot.spring_laws import BristleTable

_ALIKE = 2.0  # largest over smallest load
_STICKS = 3.0  # slip over swing from which bristles are as good as a spring
_OR_FIX = "or leave it out of `free`"


@dataclass(frozen=True)
class _Found:
    """What a fit found of one kind of a gear."""

    name: str
    value: float
    lower: float
    upper: float
    identified: bool


def untold(problem: Problem, estimate: Estimate) -> tuple[str, ...]:
    """Says what of load-dependent damping and hysteresis stays open, a sentence each without its full stop.

    Args:
        problem: The problem at its minimum.
        estimate: What the fit found.
    """
    effects = problem.model.effects
    if effects is None:
        return ()
    names = [name for name, kind in zip(estimate.names, estimate.kinds, strict=True) if kind == "doubt"]
    every = problem.parameters
    told: list[str] = []
    for name, (_, spring) in zip(effects.damped_names, effects.damped.tolist(), strict=True):
        if name in names:
            unit = "mm" if every.units[every.names.index(name)] == "1/m" else "mrad"
            told += _of_damper(_found(estimate, name), 1e3 * effects.load[:, spring], unit)
    for name, bristle in zip(effects.slipping_names, effects.bristles, strict=True):
        if name in names:
            told += _of_bristles(_found(estimate, name), bristle, every.units[every.names.index(name)])
    return tuple(told)


def _found(estimate: Estimate, name: str) -> _Found:
    index = estimate.names.index(name)
    value, lower, upper = (float(each[index]) for each in (estimate.value, estimate.lower, estimate.upper))
    return _Found(name, value, lower, upper, bool(estimate.identified[index]))


def _of_damper(found: _Found, load: FloatArray, unit: str) -> Iterator[str]:
    if found.identified:
        return
    damper, least, most = found.name.replace("load_damping", "damping"), float(load.min()), float(load.max())
    reach = f"{least:.2g} to {most:.2g} {unit}"
    if most < _ALIKE * least:
        yield (
            f"{found.name} is hardly told from {damper}: the gear is bent nearly alike in all configurations "
            f"({reach}): measure some that load it otherwise, {_OR_FIX}"
        )
    else:
        yield (
            f"{found.name} is hardly told, though the gear is bent by {reach}: measure more configurations at "
            f"both ends, {_OR_FIX}"
        )


def _of_bristles(found: _Found, bristle: BristleTable, unit: str) -> Iterator[str]:
    spring = found.name.replace("hysteresis", "stiffness")
    sticking, slip = _STICKS * bristle.stiffness * bristle.swing, abs(found.value) / bristle.stiffness
    if slip > _STICKS * bristle.swing:
        yield (
            f"{found.name} is hardly told from {spring}: at this swing bristles stick from some {sticking:.2g} {unit} "
            f"on, and are part of the spring: excite the gear more (`rms`), {_OR_FIX}"
        )
    elif found.lower <= 0 <= found.upper:
        more = max(abs(found.lower), abs(found.upper))
        yield (
            f"{found.name} may be none: it is below {more:.2g} {unit}, or above some {sticking:.2g} {unit}, where "
            f"bristles stick at this swing and are part of the spring: excite the gear more (`rms`) to tell, {_OR_FIX}"
        )
    elif not found.identified:
        yield f"{found.name} is hardly told from dampers: average more realizations, {_OR_FIX}"
