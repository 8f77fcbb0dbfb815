"""The elastic fit of responses in memory."""

from __future__ import annotations

from typing import Any

from robid.errors import DataError
from robid.frf.frf import Frf
from robid.later import later
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.known_gears import with_known_gears
from robid.models.elastic.fit.nuisance.moves import with_estimated_springs
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.validating import validate_elastic
from robid.results.fitted import Fitted
from robid.results.options import options_from
from robid.robot.description import Robot

with later(__name__):
    from robid.models.handed_on import gears_of


def fit_values(
    robot: Robot,
    responses: Frf,
    *,
    validate_on: Frf | None = None,
    delay_s: float = 0.0,
    springs_from: Fitted | None = None,
    **options: Any,  # noqa: ANN401
) -> Fitted:
    """Fits springs and dampers to frequency responses from motor torques to motor accelerations.

    Args:
        robot: The robot that the fit starts from.
        responses: Responses with covariance, in one or many configurations.
        validate_on: Responses in configurations that the fit does not see.
        delay_s: Delay from recorded to applied torque, hold excluded [s].
        springs_from: A fit of gears, whose stiffness is known beforehand.
        options: Fields of `ElasticOptions`, as `free`, `fixed`, `starts`, `weights`.

    Raises:
        DataError: If data and robot do not belong together, the fit cannot use them, or `springs_from` is none of gears
            that it identified.

    Source:
        Wernholt and Moberg (2008), sec. 5; docs/methods, sec. 5.
    """
    chosen = options_from(ElasticOptions, options, "fit_model(elastic)")
    start = with_estimated_springs(_with_gears(robot, responses, springs_from), chosen)
    solution = fit_elastic(start, responses, chosen, delay_s)
    alone = assess_fit(start, solution, responses, chosen, delay_s)
    if validate_on is None:
        return Fitted("elastic", solution.estimate, solution, alone)
    held = validate_elastic(start, solution, validate_on, chosen, delay_s, None, alone.findings, "validate_on")
    return Fitted("elastic", solution.estimate, solution, alone, held, held.outcome.grade)


def _with_gears(robot: Robot, responses: Frf, found: Fitted | None) -> Robot:
    if found is None:
        return robot
    if getattr(found, "kind", None) != "transmission":
        message = "D653 `springs_from` is no fit of gears"
        raise DataError(message, where="fit_model(elastic)", remedy="pass a fit of kind `transmission`")
    gears = gears_of(found.estimate, "springs_from", robot, responses.input_unit)
    return with_known_gears(robot, gears)
