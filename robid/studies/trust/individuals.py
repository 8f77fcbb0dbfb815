"""The robots of the study of trust: whose they are, and which sizes their defects have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from robid.simulate.options import Imperfections
from robid.studies.settings.trust import Defects, TrustStudy

_DEFECT_DRAWS = 2  # keeps these draws apart from those of springs and masses
_SIZES = frozenset(field.name for field in fields(Imperfections) if field.type == "float")

_OF_SPRINGS = ("stiffness_nm_rad", "damping_nms_rad")

LINEAR, FILE = "linear", "linear_file"
"""Names of the linear robots: those whose doubted values are drawn, and those that are as their file says."""


@dataclass(frozen=True)
class Individual:
    """One robot of the study.

    Attributes:
        group: Name of its set, of its cause, or one of the linear robots.
        kind: `set`, `cause` or `linear`.
        robot: `heavy` or `light`.
        seed: Seed of its truth, its defects, its places and its noise.
        physics: What is simulated otherwise than the campaigns say: `imperfections` and `truth`.
        referenced: Whether it is measured in fresh and designed places too.
    """

    group: str
    kind: str
    robot: str
    seed: int
    physics: Mapping[str, Any]
    referenced: bool = False

    @property
    def key(self) -> str:
        """A name that no other robot has."""
        return f"{self.group}_{self.seed}"


def individuals(study: TrustStudy) -> list[Individual]:
    """Returns all robots: those of the sets, of the causes, then the linear ones; each has a seed of its own."""
    limit, seed = study.chosen.robots, study.chosen.first
    found: list[Individual] = []
    for group in _groups(study):
        count = group.count if limit is None else min(group.count, limit)
        found += [group.individual(number, seed + number) for number in range(count)]
        seed += count
    return found


@dataclass(frozen=True)
class _Group:
    """Robots of one kind, with what they lack in their model."""

    name: str
    kind: str
    count: int
    defects: Defects
    referenced: int = 0

    def individual(self, number: int, seed: int) -> Individual:
        physics = drawn_physics(self.defects, seed)
        return Individual(self.name, self.kind, self.defects.robot, seed, physics, number < self.referenced)


def _groups(study: TrustStudy) -> Iterator[_Group]:
    for name, defects in study.sets.items():
        yield _Group(name, "set", defects.robots, defects, defects.referenced)
    for name, kind in study.causes.items():
        stated = Defects(imperfections=kind.imperfections, truth=kind.truth, size_factor=1.0, robots=study.cause_robots)
        yield _Group(name, "cause", study.cause_robots, stated)
    for name, count in () if study.linear is None else ((LINEAR, study.linear.drawn), (FILE, study.linear.file)):
        yield _Group(name, "linear", count, Defects(robots=max(count, 1)))


def drawn_physics(defects: Defects, seed: int) -> dict[str, Any]:
    """Returns the imperfections and the truth of one robot, its sizes and springs drawn.

    Args:
        defects: What the robots of its set have.
        seed: Seed of the robot.
    """
    generator = np.random.default_rng([seed, _DEFECT_DRAWS])

    def factor() -> float:
        return float(np.exp(np.log(defects.size_factor) * generator.uniform(-1, 1)))

    sizes = {key: value * factor() if _is_size(key, value) else value for key, value in defects.imperfections.items()}
    chosen = np.sort(generator.permutation(len(defects.springs))[: defects.springs_each])
    springs = []
    for spring in (defects.springs[index] for index in chosen.tolist()):
        plain = spring.model_dump(mode="json", exclude_none=True)
        share = factor()
        springs.append({**plain, **{key: plain[key] * share for key in _OF_SPRINGS if key in plain}})
    truth = {**defects.truth, **({"springs": springs} if springs else {})}
    return {key: value for key, value in (("imperfections", sizes), ("truth", truth)) if value}


def _is_size(key: str, value: object) -> bool:
    return key in _SIZES and isinstance(value, int | float)
