"""Set C of the study of trust: robots with one defect each, and sound ones under the same noises."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from itertools import pairwise
from typing import Any, Literal, TypeAlias

import numpy as np
from pydantic import model_validator

from robid.results.finding import CAUSES
from robid.settings.base import Name, Section
from robid.settings.yaml import FieldPath
from robid.simulate.options import Imperfections
from robid.studies.experiments import Problems, Whole, entry, unknown
from robid.studies.settings.defects import Physics

SINGLE, SOUND = "c", "sound"
"""First word of the figures of these robots, and what the groups of those without a defect are called."""
Kind: TypeAlias = Literal["heavy", "light"]
KINDS: tuple[Literal["heavy"], Literal["light"]] = ("heavy", "light")

_NO_SIZE = ("_phase_rad", "_order")
SIZES = frozenset(
    field.name for field in fields(Imperfections) if field.type == "float" and not field.name.endswith(_NO_SIZE)
)
"""Imperfections that have a size."""
OF_SPRINGS = ("stiffness_nm_rad", "damping_nms_rad")
_BY_JOINT = ("zero_deg", "late_torque_s", "late_angle_s")  # sizes of a truth
_DRAWS = 4  # keeps these draws apart from those of springs, masses, places and linear robots


class RobotCounts(Section):
    """How many robots there are of each kind."""

    heavy: Whole = entry("Robots of this file.", 0)
    light: Whole = entry("Robots of `light`.", 0)

    def turns(self) -> list[Kind]:
        """Returns whose robot each one is: the two kinds lie spread among each other."""
        every = self.heavy + self.light
        # The light ones' share of the first k robots is that of all, as nearly as whole numbers are.
        count = [self.light * number // every for number in range(every + 1)] if every else [0]
        return ["light" if after > before else "heavy" for before, after in pairwise(count)]


class SingleDefect(RobotCounts):
    """A defect that robots have alone."""

    named: tuple[str, ...] = entry(
        "Causes that count as right: several where they cannot be distinguished.", min_length=1
    )
    size_factor: float = entry(
        "Sizes of the defect, one factor for all of a robot's, are multiplied log-uniformly by up to this.", 1.0, ge=1
    )
    variants: dict[Kind, tuple[Physics, ...]] = entry(
        "Defects of robots of each kind; the next variant follows after every noise has had its turn."
    )

    @model_validator(mode="after")
    def _every_kind_has_one(self) -> SingleDefect:
        for kind in KINDS:
            if getattr(self, kind) and not self.variants.get(kind):
                message = f"S518 there is no variant for the {kind} robots"
                raise ValueError(message)
        return self


class SingleDefects(Section):
    """Robots with one defect each, and sound ones of the same noises."""

    noises: dict[Kind, tuple[dict[str, Any], ...]] = entry(
        "`imperfections` that replace those of the campaigns, for robots of each kind; they take turns."
    )
    defects: dict[Name, SingleDefect] = entry("The defects, by name.", min_length=1)
    sound: RobotCounts = entry("Robots without a defect.", default_factory=RobotCounts)

    @model_validator(mode="after")
    def _no_defect_is_called_sound(self) -> SingleDefects:
        if SOUND in self.defects:
            message = f"S517 `{SOUND}` are the robots without a defect: choose another name"
            raise ValueError(message)
        return self

    @property
    def groups(self) -> dict[str, RobotCounts]:
        """How many robots there are of each defect, and without one, by the names of the groups."""
        return {f"{SINGLE}_{name}": one for name, one in {**self.defects, SOUND: self.sound}.items()}

    def defect(self, group: str) -> SingleDefect | None:
        """Returns the defect of a group; None of sound robots."""
        return self.defects.get(group.removeprefix(f"{SINGLE}_"))


def single_physics(single: SingleDefects, group: str, number: int, seed: int) -> dict[str, Any]:
    """Returns what is simulated otherwise for a robot of a group, by its number from 0.

    The seed decides the size of its defect.
    """
    kind, defect = single.groups[group].turns()[number], single.defect(group)
    noises = single.noises.get(kind, ({},))
    chosen, size = Physics(), 1.0
    if defect is not None:
        variants = defect.variants[kind]
        chosen = variants[number // len(noises) % len(variants)]
        size = float(defect.size_factor ** np.random.default_rng([seed, _DRAWS]).uniform(-1, 1))
    flaws = {**noises[number % len(noises)], **_scaled(chosen.imperfections, SIZES, size)}
    truth: dict[str, Any] = {**chosen.truth}
    truth |= {key: _scaled(truth[key], truth[key], size) for key in _BY_JOINT if key in truth}
    if "springs" in truth:
        truth["springs"] = [_scaled(spring, OF_SPRINGS, size) for spring in truth["springs"]]
    return {key: value for key, value in (("imperfections", flaws), ("truth", truth)) if value}


def _scaled(stated: Mapping[str, Any], keys: Any, size: float) -> dict[str, Any]:  # noqa: ANN401
    """Multiplies what is a number under some of the keys."""
    numbers = {key for key, value in stated.items() if key in keys and isinstance(value, int | float)}
    return {key: value * size if key in numbers else value for key, value in stated.items()}


def check_single(single: SingleDefects, *, light: bool) -> Problems:
    """Yields the field and the message of what is wrong with these robots; whether the study has a light robot."""
    for name, defect in single.defects.items():
        field = ("study", "single", "defects", name)
        for index, cause in enumerate(defect.named):
            if message := unknown("cause", cause, CAUSES):
                yield (*field, "named", index), message
    if not light and any(counts.light for counts in single.groups.values()):
        yield ("study", "single"), "S520 the study has no `light` robot"


def every_physics(single: SingleDefects, kind: str) -> Iterator[tuple[FieldPath, dict[str, Any]]]:
    """Yields where each variant of a kind of robot stands, and what is simulated otherwise by it."""
    if kind not in KINDS:
        return
    for index, noise in enumerate(single.noises.get(kind, ())):
        yield ("study", "single", "noises", kind, index), {"imperfections": noise}
    for name, defect in single.defects.items():
        for index, variant in enumerate(defect.variants.get(kind, ())):
            physics = {"imperfections": variant.imperfections, "truth": variant.truth}
            yield ("study", "single", "defects", name, "variants", kind, index), physics
