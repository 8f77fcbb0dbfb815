"""The choice of configurations from candidates in memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from robid.arrays import FloatArray
from robid.design.configurations.candidates import candidate_information
from robid.design.configurations.for_prediction import design_for_prediction
from robid.design.configurations.information import design_configurations
from robid.design.configurations.options import BetweenRelativeStd, DesignOptions, InformationOptions
from robid.design.configurations.prediction import joined
from robid.errors import DataError, SettingsError
from robid.face.arguments import placed, required, sampled, shaped
from robid.face.robots import RobotModel
from robid.pipeline.design_prediction import assumed_parts
from robid.pipeline.design_tasks import AssumedTask
from robid.results.options import options_from

if TYPE_CHECKING:
    from robid.design.configurations.information import ConfigurationDesign

_CHUNK = 20
"""Candidates whose nuisance parameters are linearised together."""
_LEAST_ERROR = 1e-6
"""Least relative error of a response element that a design assumes, and the inverse of the largest."""


def choose_configurations(
    robot: RobotModel,
    candidates: FloatArray,
    frequency_hz: FloatArray,
    count: int = 8,
    *,
    relative_error: float = 0.03,
    fixed: Sequence[str] = (),
    **options: Any,  # noqa: ANN401
) -> ConfigurationDesign:
    """Chooses the configurations that tell most about springs and dampers, or predict best, with a certificate.

    Args:
        robot: The robot, its springs as well as they are known.
        candidates (n_conf, n_joint): Configurations that may be measured [rad, or m].
        frequency_hz (n_freq,): Frequencies that are excited [Hz].
        count: How many configurations are chosen.
        relative_error: Assumed relative standard deviation of each response element.
        fixed: Names of parameters that are known, as `base_x.stiffness`.
        options: Further fields of `DesignOptions`, as `criterion` or `experiments`. With `criterion="prediction"` what
            the robot file may have wrong counts by its `doubts`, and responses in all candidates are to be predicted.

    Returns:
        The design: `chosen` are rows of the candidates, `efficiency` what they reach of the best possible.

    Raises:
        DataError: If the robot has no controller, whose sampling period the response needs.
        SettingsError: If an argument has another type or shape, a frequency no sampled signal has, or the candidates
            cannot determine the parameters.

    Source:
        Zimmermann et al. (2023), sec. III; docs/methods, sec. 6.
    """
    called = "choose_configurations"
    robot = required(robot, RobotModel, "robot", called, "robid.load_robot(path)")
    places = shaped(candidates, "candidates", "n_conf n_joint", called, n_joint=len(robot.joints))
    places, lines = placed(places, "candidates", called), sampled(frequency_hz, called, robot.sampling_period_s)
    if robot.sampling_period_s is None:
        remedy = "add a `controller` section to the robot file"
        raise DataError("D299 the robot has no sampling period", where=robot.name, remedy=remedy)
    if not _LEAST_ERROR <= relative_error <= 1 / _LEAST_ERROR:
        what = f"S601 `relative_error` is {relative_error:g}, but must be from {_LEAST_ERROR:g} to {1 / _LEAST_ERROR:g}"
        raise SettingsError(what, where=called, remedy="give 0.03 for an error of 3 %")
    chosen = options_from(DesignOptions, {"count": count, **options}, called)
    matrices, names = candidate_information(
        robot.description,
        places,
        lines,
        robot.sampling_period_s,
        robot.delay_s,
        relative_error,
        fixed=fixed,
    )
    # What the model lacks makes springs differ between configurations: no number of visits to one tells more.
    between = BetweenRelativeStd().of(names)
    if chosen.criterion != "prediction":
        return design_configurations(matrices, places, names, chosen, between=between)
    about = InformationOptions(assumed_relative_error=relative_error, fixed=tuple(fixed))
    few = np.array_split(places, -(-len(places) // _CHUNK))
    period_s, delay_s = robot.sampling_period_s, robot.delay_s
    tasks = (AssumedTask((robot.description,), about, delay_s, part, lines, period_s) for part in few)
    parts = joined([assumed_parts(task, between) for task in tasks], [len(part) for part in few])
    return design_for_prediction(parts, matrices[None], places, names, chosen, between=between)
