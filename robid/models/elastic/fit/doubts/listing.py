"""Everything that a robot file may have wrong, with how far it may be off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray
from robid.models.elastic.fit.considered import DoubtfulRobot
from robid.models.elastic.fit.doubts.column import DoubtColumn
from robid.models.elastic.fit.doubts.drives import (
    coupling_doubts,
    delay_doubts,
    friction_doubts,
    left_of_freed,
    rotor_doubts,
    torque_doubts,
)
from robid.models.elastic.fit.doubts.freed import freed_doubts
from robid.models.elastic.fit.doubts.gears import bristle_names, gear_doubts
from robid.models.elastic.fit.doubts.held import held_doubts
from robid.models.elastic.fit.doubts.masses import base_doubts, link_doubts, payload_doubts
from robid.models.elastic.fit.doubts.scene import Scene
from robid.models.elastic.fit.doubts.springs import spring_doubts
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.description import Robot


def list_doubts(robot: Robot, options: ElasticOptions, rigid: Sequence[DoubtfulRobot] = ()) -> tuple[DoubtColumn, ...]:
    """Lists the doubts of a robot file with the priors that it states.

    What the fit estimates is none: springs, dampers, rotor inertias, viscous friction, delay, cubic gears, doubts that
    are freed and not fixed.

    Args:
        robot: The robot that the fit starts from, with its campaign's payload.
        options: Options of the fit.
        rigid: Robots that are off along the independent directions that a rigid fit leaves open, which take the place
            of the file's doubts of links.
    """
    of_links = _rigid_doubts(rigid) if rigid else link_doubts(robot)
    listed = (
        *payload_doubts(robot),
        *of_links,
        *base_doubts(robot),
        *torque_doubts(robot, rigid=bool(rigid)),
        *delay_doubts(robot, options),
        *rotor_doubts(robot, options),
        *coupling_doubts(robot),
        *gear_doubts(robot, options),
        *friction_doubts(robot, options),
        *held_doubts(robot, options),
        *spring_doubts(robot),
    )
    freed = {doubt.name for doubt in freed_doubts(robot, options)}.difference(options.fixed)
    freed |= {bristle for name in freed for bristle in bristle_names(name)}
    kept = (left_of_freed(doubt) if doubt.name in freed else doubt for doubt in listed)
    return tuple(doubt for doubt in kept if doubt is not None)


@dataclass(frozen=True)
class RigidError:
    """An independent error of a rigid fit, amounts in standard deviations.

    Attributes:
        off: What the rigid fit found, off along the direction.
    """

    off: DoubtfulRobot

    def column(self, scene: Scene) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in) of the log response by the amount."""
        ratio = scene.sampled(self.off.robot) / scene.at_rest
        return np.asarray(np.log(ratio) / self.off.deviations)


def _rigid_doubts(rigid: Sequence[DoubtfulRobot]) -> list[DoubtColumn]:
    return [
        DoubtColumn(f"rigid.{number}", f"error {number} of the rigid fit", "masses", "std", 1.0, 0.0, RigidError(off))
        for number, off in enumerate(rigid, start=1)
    ]
