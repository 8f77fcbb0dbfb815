"""What an experiment file frees of what its robot file may have wrong."""

from __future__ import annotations

from collections.abc import Iterator

from robid.families.elastic.settings import ElasticFit
from robid.fit.elastic.doubts.freed import DOUBT, freed_doubts, unknown_names
from robid.fit.elastic.doubts.further import with_freed_springs
from robid.fit.elastic.names import free_problem
from robid.robot.description import Robot, Spring
from robid.robot.parameters import names_of
from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath


def freed_problems(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> Iterator[tuple[FieldPath, str]]:
    """Yields what is wrong with the doubts that a fit frees: names that the robot does not have."""
    for name, meant in unknown_names(_robot(experiment, fit, robot), fit.options()):
        yield ("free", fit.free.index(name)), free_problem(name, meant)


def freed_names(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> dict[str, str]:
    """Returns every parameter that freed doubts and springs add, with its kind."""
    start, options = _robot(experiment, fit, robot), fit.options()
    more = with_freed_springs(start, options).springs[len(start.springs) :]
    of_springs = {name: kind for kind in fit.kinds for name in _of_springs(kind, more)}
    return of_springs | {doubt.name: DOUBT for doubt in freed_doubts(start, options)}


def _of_springs(kind: str, springs: tuple[Spring, ...]) -> list[str]:
    return [name for name in names_of(kind, springs, []) if name is not None and kind != "delay"]


def _robot(experiment: Experiment, fit: ElasticFit, robot: RobotFile) -> Robot:
    return robot.to_robot(experiment.campaigns[fit.campaign].payload_kg)
