"""Doubts of springs and dampers that no fit estimates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from robid.arrays import ComplexArray
from robid.models.elastic.fit.doubts.column import DoubtColumn
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Robot, Spring

if TYPE_CHECKING:
    from robid.models.elastic.fit.doubts.scene import Scene

HELD = "held_spring"
"""Their cause."""
_PERCENT = 100.0
_LEAST = -90.0  # percent: what has no stiffness is no spring


@dataclass(frozen=True)
class HeldSpring:
    """A spring, or its damper, that is off by some percent where no fit estimates it.

    Attributes:
        spring: Index of the spring.
        kind: Which of both.
    """

    spring: int
    kind: Literal["stiffness", "damping"]

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        slopes = scene.spring_slopes if self.kind == "stiffness" else scene.damper_slopes
        stated, now = (float(getattr(values, self.kind)[self.spring]) for values in (scene.stated, scene.values))
        return np.asarray(slopes[..., self.spring] * (stated / now) / _PERCENT)

    def moved(self, spring: Spring, percent: float) -> Spring:
        """Returns the spring that is off."""
        factor = 1 + percent / _PERCENT
        if self.kind == "stiffness":
            return replace(spring, stiffness=factor * spring.stiffness)
        return replace(spring, damping=factor * spring.damping)


def held_doubts(robot: Robot, options: ElasticOptions) -> Iterator[DoubtColumn]:
    """Yields the doubts of stiffnesses and dampings that no fit estimates."""
    for index, spring in enumerate(robot.springs):
        doubts = robot.doubts if spring.place in ("base", "payload") else robot.joints[spring.joint].doubts
        stated: tuple[tuple[Literal["stiffness", "damping"], str, float, float], ...] = (
            ("stiffness", spring.name, doubts.stiffness_relative_std, spring.stiffness),
            ("damping", f"{spring.name}'s damper", doubts.damping_relative_std, spring.damping),
        )
        for kind, what, std, value in stated:
            name = f"{spring.name}.{kind}"
            if std > 0 and value > 0 and not options.estimates(kind, name):
                limits = {"least": _LEAST, "most": -_LEAST * 10}
                yield DoubtColumn(name, what, HELD, "%", _PERCENT * std, 0.0, HeldSpring(index, kind), **limits)
