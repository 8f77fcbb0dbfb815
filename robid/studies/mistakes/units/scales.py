"""What the tool said of a case, and whether that names the scale that is wrong."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

from robid.results.doubt import CAUSES
from robid.results.scale import SCALES, Scale, read_scale
from robid.studies.settings.mistakes import UnitMistake

UNITS = "units"
"""The cause that must be blamed."""


@dataclass(frozen=True)
class Said:
    """What the tool said of a case."""

    causes: tuple[str, ...]  # The causes that its grade names, the first to blame first; none where it was refused
    scales: tuple[Scale, ...]  # What the first of them says is wrongly scaled
    refusal: str  # Why it was refused; empty where it was not

    @property
    def accuses_units(self) -> bool:
        """Whether units are accused, as the first cause or by any word of a refusal."""
        return self.causes[:1] == (UNITS,) or bool(re.search(r"\bunits?\b", self.refusal, re.IGNORECASE))

    @property
    def first(self) -> str:
        """What is said first, in words."""
        if self.refusal:
            return "refused"
        named = ": ".join([*self.causes[:1], *map(str, self.scales[:1])])
        return named.replace("_", " ") or "nothing"

    def texts(self) -> dict[str, str]:
        """Returns it as texts, which `said_of` reads."""
        scales = _BETWEEN.join(map(str, self.scales))
        return {"causes": _BETWEEN.join(self.causes), "scales": scales, "refusal": self.refusal}


_BETWEEN = "; "


def said_of(causes: str, scales: str, refusal: str) -> Said:
    """Reads what `Said.texts` returns."""
    named, scaled = ([one for one in text.split(_BETWEEN) if one] for text in (causes, scales))
    return Said(tuple(named), tuple(map(read_scale, scaled)), refusal)


def group_of(mistake: UnitMistake, robot: str) -> tuple[Scale, ...]:
    """Returns the scales that give the same data as a mistake on a robot, itself first."""
    return tuple(read_scale(text) for text in (mistake.scale, *mistake.same.get(robot, ())))


def is_named(said: Said, mistake: UnitMistake, robot: str, joints: Sequence[str], wrong: Sequence[str]) -> bool:
    """Whether a mistake's group is named first.

    A refusal names it by its words; a grade by the likeliest scale of its first cause, on no joint that is right.

    Args:
        said: What the tool said.
        mistake: The mistake.
        robot: Name of the robot.
        joints: All of its joints.
        wrong: Those whose channel has the mistake.
    """
    if said.refusal:
        told = [_words(scale) for scale in group_of(mistake, robot)] if CAUSES[UNITS] in said.refusal else []
        return any(words.lower() in said.refusal.lower() for words in (*told, *mistake.refusals))
    if said.causes[:1] != (UNITS,) or not said.scales:
        return False
    first = said.scales[0]
    concerned = first.joints or tuple(joints)
    group = {(scale.channel, scale.factor, scale.inverse) for scale in group_of(mistake, robot)}
    return (first.channel, first.factor, first.inverse) in group and set(concerned) <= set(wrong)


def _words(scale: Scale) -> str:
    """What a message says was read as what, without its remedy."""
    return scale.mistake(SCALES.get(scale.factor, 1.0)).partition(":")[0]
