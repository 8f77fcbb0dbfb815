"""What a named doubt is, and the directions in which robots are moved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from robid.arrays import ComplexArray
from robid.robot.description import Robot

if TYPE_CHECKING:
    from robid.models.elastic.fit.doubts.scene import Scene


class Direction(Protocol):
    """What a doubt does to the response."""

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the model's log response by the doubt's amount."""


@dataclass(frozen=True)
class DoubtColumn:
    """Something that a robot file may have wrong.

    Amounts are zero where the file is right.

    Attributes:
        name: What it is, in one word as parameters are named: `axis_2.mass`.
        title: The same for a sentence.
        cause: The likely cause that it stands for, of `robid.results.doubt.CAUSES`, or what only a fit's wish frees.
        unit: Unit of its amounts.
        common_std: Standard deviation of the amount that all places share.
        place_std: Standard deviation of what each place adds to that.
        direction: What it does to the response.
        least: Smallest amount that makes sense.
        most: Largest amount that makes sense.
        stated: What the robot file says in the same unit, where that is said; zero where only amounts are.
        natural: Amount from which it matters: where the file says nothing, its deviation is judged by it.
    """

    name: str
    title: str
    cause: str
    unit: str
    common_std: float
    place_std: float
    direction: Direction
    least: float = -np.inf
    most: float = np.inf
    stated: float = 0.0
    natural: float = 1.0


@dataclass(frozen=True)
class RobotMove:
    """A robot whose file says something else: central differences of its response, statics included.

    Attributes:
        moved: Returns a robot that is off by an amount from another one.
        step: Amount of a difference.
    """

    moved: Callable[[Robot, float], Robot]
    step: float

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        ahead, behind = (scene.sampled(self.moved(scene.robot, step)) for step in (self.step, -self.step))
        return np.asarray(np.log(ahead / behind) / (2 * self.step))
