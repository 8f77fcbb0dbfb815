"""The rigid family's fit and validation: settings and artifacts in, artifacts out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.grade import grade_from_artifact
from robid.families.family import Data, Work
from robid.families.rigid.files import model_of, solution_from_artifact, validation_of
from robid.families.rigid.settings import rigid_fit
from robid.families.rigid.truth import values_in
from robid.fit.rigid.fitting import Simulate, fit_rigid
from robid.fit.rigid.shots import Shot, shots_of
from robid.robot.description import Robot
from robid.robot.regressor.model import RigidModel
from robid.settings.robot_parts import delay_s
from robid.simulate.rigid_loop import simulate_rigid
from robid.simulate.truth import TrueRobot
from robid.validation.rigid.grading import assess_rigid
from robid.validation.rigid.validating import validate_rigid


def fit(data: Data, work: Work) -> Artifact:
    """Fits a rigid model and grades it by itself."""
    settings = rigid_fit(data.loaded.experiment, data.name)
    work.progress.expect(1, "fits")
    robot = robot_of(data, settings.campaign)
    shots = shots_in(data, settings.campaigns, robot)
    solution = fit_rigid(robot, shots, settings.options(), _loop(data, robot, shots))
    work.progress.advance()
    return model_of(solution, assess_rigid(solution))


def validate(data: Data, model: Artifact, true: TrueRobot | None) -> Artifact:
    """Holds a rigid model against a motion that it never saw, and against the true robot where it is known."""
    settings = rigid_fit(data.loaded.experiment, data.name)
    campaign = settings.validate_on or settings.campaign
    robot = robot_of(data, campaign)
    validation = validate_rigid(
        robot,
        solution_from_artifact(model),
        shots_in(data, (campaign,), robot),
        settings.options(),
        grade_from_artifact(model).doubts,
        None if true is None else values_in(data.loaded, data.name, true),
    )
    return validation_of(validation)


def phrase_of_model(model: Artifact) -> str:
    """Says how the fit ended, in a phrase, from its artifact."""
    solution = solution_from_artifact(model)
    estimate = solution.estimate
    known = int(np.sum(estimate.identifiable))
    return (
        f"{estimate.status}, {known} of {len(estimate.names)} base parameters identifiable, torques to "
        f"{100 * solution.residuals.total_error:.3g} % of their size"
    )


def robot_of(data: Data, campaign: str) -> Robot:
    """Returns the robot file's robot with the payload of a campaign."""
    return data.loaded.robot.to_robot(data.loaded.experiment.campaigns[campaign].payload_kg)


def shots_in(data: Data, campaigns: Sequence[str], robot: Robot) -> tuple[Shot, ...]:
    """Returns the shots of the records of some campaigns."""
    found: list[Shot] = []
    for name, record in zip(campaigns, data.records, strict=True):
        campaign = data.loaded.experiment.campaigns[name]
        late = round(delay_s(data.loaded, campaign) / record.sampling_period_s)
        loaded = robot_of(data, name).payload.mass_kg > 0
        found += shots_of(record, robot, late_samples=late, loaded=loaded)
    return tuple(found)


def _loop(data: Data, robot: Robot, shots: Sequence[Shot]) -> Simulate | None:
    """Simulates the loop of the shots, where controller and commands are known and it is wanted."""
    controller, settings = data.loaded.robot.controller, rigid_fit(data.loaded.experiment, data.name)
    commands = [shot.command for shot in shots if shot.command is not None]
    same = len({len(command.angle) for command in commands}) == 1
    if settings.instruments == "none" or controller is None or len(commands) < len(shots) or not same:
        return None

    def simulate(model: RigidModel, values: FloatArray) -> Sequence[FloatArray]:
        # What repeats has settled after one period.
        times = 2 if commands[0].periodic else 1
        told = (np.tile([getattr(one, name) for one in commands], (1, times, 1)) for name in ("angle", "speed"))
        found = simulate_rigid(model, values, robot, controller, *told)
        late = shots[0].late_samples
        return list(found[:, -len(commands[0].angle) + late :])

    return simulate
