"""The fit of gears, its validation and true values: settings and artifacts in, artifacts out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.artifacts.results import grade_from_artifact
from robid.models.family import Data, Work
from robid.models.handed_on import rigid_source
from robid.models.transmission.files import model_of, solution_from_artifact, validation_from_artifact, validation_of
from robid.models.transmission.fit.fitting import fit_transmissions
from robid.models.transmission.fit.load import KnownBodies
from robid.models.transmission.fit.motions import Motion, motions_of
from robid.models.transmission.judge.plausible import assess
from robid.models.transmission.judge.validating import validate_transmissions
from robid.models.transmission.settings import transmission_fit
from robid.models.transmission.truth import true_values_of
from robid.robot.description import Robot
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s
from robid.simulate.truth import TrueRobot


def fit(data: Data, work: Work) -> Artifact:
    """Fits gears and grades them by their own motions."""
    settings = transmission_fit(data.loaded.experiment, data.name)
    work.progress.expect(1, "fits")
    options = settings.options()
    motions = motions_in(data, settings.campaigns)
    solution = fit_transmissions(robot_of(data.loaded, data.name), motions, options, known_of(data))
    work.progress.advance()
    return model_of(solution, assess(solution, options))


def validate(data: Data, model: Artifact, true: TrueRobot | None) -> Artifact:
    """Holds gears against a motion that the fit never saw, and against the true robot where it is known."""
    settings = transmission_fit(data.loaded.experiment, data.name)
    solution = solution_from_artifact(model)
    validation = validate_transmissions(
        robot_of(data.loaded, data.name),
        solution,
        motions_in(data, (settings.validate_on or settings.campaign,)),
        settings.options(),
        grade_from_artifact(model).findings,
        None if true is None else values_in(data.loaded, data.name, true),
    )
    return validation_of(validation)


def robot_of(loaded: LoadedExperiment, name: str) -> Robot:
    """Returns the robot file's robot with the fit's payload."""
    settings = transmission_fit(loaded.experiment, name)
    return loaded.robot.to_robot(loaded.experiment.campaigns[settings.campaign].payload_kg)


def known_of(data: Data) -> KnownBodies | None:
    """Returns the bodies of a rigid fit, where one is named."""
    name = transmission_fit(data.loaded.experiment, data.name).rigid
    if name is None:
        return None
    source = rigid_source(data.loaded, name, data.taken["standard"])
    names, directions = source.standard.names, source.directions()
    moved = np.stack(directions, axis=1) if directions else np.zeros((len(names), 0))
    return KnownBodies(names, source.standard.value, moved)


def motions_in(data: Data, campaigns: Sequence[str]) -> tuple[Motion, ...]:
    """Returns the motions of the records of some campaigns."""
    found: list[Motion] = []
    robot = robot_of(data.loaded, data.name)
    for name, record in zip(campaigns, data.records, strict=True):
        late = round(delay_s(data.loaded, data.loaded.experiment.campaigns[name]) / record.sampling_period_s)
        found += motions_of(record, robot, late_samples=late, name=name)
    return tuple(found)


def misfits(model: Artifact, validation: Artifact | None) -> Mapping[str, float]:
    """What the laws leave of the deflections, of the fit and of its validation; the worst gear that is determined."""
    solution = solution_from_artifact(model)
    if not solution.determined.any():
        return {}
    left = solution.residual / np.maximum(solution.size, np.finfo(float).tiny)
    found = {"relative residual": float(left[solution.determined].max())}
    if validation is not None:
        error = validation_from_artifact(validation).relative_error[solution.determined]
        found["relative error of the validation"] = float(error.max())
    return found


def phrase_of_model(model: Artifact) -> str:
    """Says how the fit ended, in a phrase, from its artifact."""
    solution = solution_from_artifact(model)
    known = int(solution.determined.sum())
    return f"{solution.estimate.status}, stiffness of {known} of {len(solution.joints)} gears identified"


def values_in(loaded: LoadedExperiment, name: str, true: TrueRobot) -> dict[str, float]:
    """Returns the true value of every parameter of the gears that the simulation knows, by name."""
    settings = transmission_fit(loaded.experiment, name)
    return true_values_of(robot_of(loaded, name), true, settings.options())
