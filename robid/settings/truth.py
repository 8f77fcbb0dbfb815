"""The true robot of a simulated campaign as its settings give it, springs that the robot file lacks included."""

from __future__ import annotations

from dataclasses import dataclass, field

from robid.robot.description import Robot
from robid.settings.robot import RobotFile
from robid.settings.robot_sections import SpringSection
from robid.simulate.options import SimulateOptions, Truth
from robid.simulate.truth import true_robot


@dataclass(frozen=True)
class TruthSettings(Truth):
    """How the simulated robot differs from the robot file, in springs that the file lacks too."""

    springs: tuple[SpringSection, ...] = field(
        default=(),
        metadata={
            "description": "Springs that the simulated robot has and the robot file lacks, written as in a robot file;"
            " no transmissions. They have no random deviation."
        },
    )


@dataclass(frozen=True)
class SimulateSettings(SimulateOptions):
    """One simulated campaign, as the experiment file describes it."""

    truth: TruthSettings = field(
        default_factory=TruthSettings, metadata={"description": "How the true robot differs from the robot file."}
    )


def with_truth_springs(robot: RobotFile, truth: TruthSettings) -> RobotFile:
    """Returns the robot file with the springs that it lacks after its own."""
    return robot.model_copy(update={"springs": (*robot.springs, *truth.springs)})


def true_robot_of(robot: RobotFile, payload_kg: float | None, truth: Truth) -> Robot:
    """Returns the true robot of a campaign.

    Args:
        robot: The robot file.
        payload_kg: Payload mass that replaces the file's [kg].
        truth: How it differs.
    """
    springs = truth.springs if isinstance(truth, TruthSettings) else ()
    further = tuple(spring.spring(robot.joints) for spring in springs)
    return true_robot(robot.to_robot(payload_kg), truth, further)
