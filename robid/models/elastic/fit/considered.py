"""Robots that show how far rigid parameters from elsewhere may be off."""

from __future__ import annotations

from dataclasses import dataclass

from robid.robot.description import Robot


@dataclass(frozen=True)
class DoubtfulRobot:
    """A robot whose rigid parameters are off along one of several independent directions.

    Attributes:
        robot: The robot.
        deviations: By how many standard deviations; not zero.
    """

    robot: Robot
    deviations: float
