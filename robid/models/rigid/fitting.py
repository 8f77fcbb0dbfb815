"""The rigid family's fit, validation and true values: settings and artifacts in, artifacts out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.results import grade_from_artifact
from robid.models.family import Data, Work
from robid.models.rigid.files import model_of, solution_from_artifact, validation_from_artifact, validation_of
from robid.models.rigid.fit.fitting import Simulate
from robid.models.rigid.fit.gains import corrected
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.shots import Shot, shots_of, without_gears
from robid.models.rigid.judge.identifying import identify
from robid.models.rigid.judge.validating import validate_rigid
from robid.models.rigid.settings import loaded_campaign, rigid_fit
from robid.robot.description import Robot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.model import RigidModel, build_rigid_model
from robid.settings.experiment import payload_kg
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s
from robid.simulate.rigid_loop import simulate_rigid_loop
from robid.simulate.truth import TrueRobot


def fit(data: Data, work: Work) -> Artifact:
    """Fits a rigid model and grades it by itself."""
    settings = rigid_fit(data.loaded.experiment, data.name)
    work.progress.expect(1, "fits")
    robot = robot_of(data)
    shots = shots_in(data, settings.campaigns, robot)
    loop = None if settings.instruments == "none" else _loop(data, robot, shots)
    solution, grade = identify(robot, data.records[0], shots, settings.options(), loop)
    work.progress.advance()
    return model_of(solution, grade)


def validate(data: Data, model: Artifact, true: TrueRobot | None) -> Artifact:
    """Holds a rigid model against a motion that it never saw, and against the true robot where it is known."""
    settings = rigid_fit(data.loaded.experiment, data.name)
    campaign = settings.validate_on or settings.campaign
    robot, solution = robot_of(data), solution_from_artifact(model)
    shots = corrected(shots_in(data, (campaign,), robot), solution.gains)
    validation = validate_rigid(
        robot,
        solution,
        shots,
        settings.options(),
        grade_from_artifact(model).findings,
        None if true is None else values_in(data.loaded, data.name, true),
        _loop(data, robot, shots),
    )
    return validation_of(validation)


def misfits(model: Artifact, validation: Artifact | None) -> dict[str, float]:
    """Error of the torques over their size, of the fit and of its validation."""
    found = {"relative error": solution_from_artifact(model).residuals.total_error}
    if validation is not None:
        found["relative error of the validation"] = validation_from_artifact(validation).total_error
    return found


def phrase_of_model(model: Artifact) -> str:
    """Says how the fit ended, in a phrase, from its artifact."""
    solution = solution_from_artifact(model)
    estimate = solution.estimate
    known = int(np.sum(estimate.identified))
    return (
        f"{estimate.status}, {known} of {len(estimate.names)} base parameters identified, residual "
        f"{100 * solution.residuals.total_error:.3g} % of the torques"
    )


def robot_of(data: Data) -> Robot:
    """Returns the robot file's robot with the fit's payload, as far as its records leave it in doubt."""
    robot = data.loaded.robot.to_robot(loaded_campaign(data.loaded, data.name).payload_kg)
    return without_gears(robot, data.records[0])


def shots_in(data: Data, campaigns: Sequence[str], robot: Robot) -> tuple[Shot, ...]:
    """Returns the shots of the records of some campaigns."""
    found: list[Shot] = []
    for name, record in zip(campaigns, data.records, strict=True):
        campaign = data.loaded.experiment.campaigns[name]
        late = round(delay_s(data.loaded, campaign) / record.sampling_period_s)
        loaded = payload_kg(campaign, data.loaded.robot) > 0
        found += shots_of(record, robot, late_samples=late, loaded=loaded, name=name)
    return tuple(found)


def _loop(data: Data, robot: Robot, shots: Sequence[Shot]) -> Simulate | None:
    """Simulates the loop of the shots, where controller and commands are known."""
    controller = data.loaded.robot.controller
    commands = [shot.command for shot in shots if shot.command is not None]
    alike: dict[tuple[int, bool], list[int]] = {}
    for index, command in enumerate(commands):
        alike.setdefault((len(command.angle), shots[index].loaded), []).append(index)
    if controller is None or len(commands) < len(shots) or not all(joint.has_motor for joint in robot.joints):
        return None

    def simulate(model: RigidModel, values: FloatArray) -> Sequence[FloatArray]:
        found: dict[int, FloatArray] = {}
        for (n_sample, loaded), rows in alike.items():
            # What repeats has settled after one period.
            times = 2 if commands[rows[0]].periodic else 1
            angle, speed = (
                np.tile([getattr(commands[row], name) for row in rows], (1, times, 1)) for name in ("angle", "speed")
            )
            moved = simulate_rigid_loop(model, values, robot, controller, angle, speed, loaded=loaded)[0]
            own = moved[:, -n_sample + shots[rows[0]].late_samples :]
            found |= dict(zip(rows, own, strict=True))
        return [found[index] for index in range(len(shots))]

    return simulate


def values_in(loaded: LoadedExperiment, name: str, true: TrueRobot) -> dict[str, float]:
    """Returns the true value of every base parameter of the model, by the name of its first standard parameter.

    Parameters that a motion cannot tell apart are regrouped by the fit: these have no value here.
    """
    robot = loaded.robot.to_robot(loaded_campaign(loaded, name).payload_kg)
    return true_base_values(robot, true.robot, rigid_fit(loaded.experiment, name).options())


def true_base_values(robot: Robot, true: Robot, options: RigidFitOptions) -> dict[str, float]:
    """Returns the base parameters of a true robot by the names that they have in the model of a robot file's."""
    base = find_base_parameters(build_rigid_model(robot, options.model), options.base)
    values = base.values(build_rigid_model(true, options.model).nominal)
    return dict(zip(base.base_names, values.tolist(), strict=True))
