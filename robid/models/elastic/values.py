"""The elastic fit of responses in memory."""

from __future__ import annotations

from typing import Any

from robid.frf.frf import Frf
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.nuisance.moves import with_estimated_springs
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.assessment import assess_fit
from robid.models.elastic.judge.validating import validate_elastic
from robid.results.fitted import Fitted
from robid.results.options import options_from
from robid.robot.description import Robot


def fit_values(
    robot: Robot,
    responses: Frf,
    *,
    validate_on: Frf | None = None,
    delay_s: float = 0.0,
    **options: Any,  # noqa: ANN401
) -> Fitted:
    """Fits springs and dampers to frequency responses from motor torques to motor accelerations.

    Args:
        robot: The robot that the fit starts from.
        responses: Responses with covariance, in one or many configurations.
        validate_on: Responses in configurations that the fit does not see.
        delay_s: Delay from recorded to applied torque, hold excluded [s].
        options: Fields of `ElasticOptions`, as `free`, `fixed`, `starts`, `weights`.

    Raises:
        DataError: If data and robot do not belong together, or the fit cannot use them.

    Source:
        Wernholt and Moberg (2008), sec. 5; docs/methods, sec. 5.
    """
    chosen = options_from(ElasticOptions, options, "fit_model(elastic)")
    start = with_estimated_springs(robot, chosen)
    solution = fit_elastic(start, responses, chosen, delay_s)
    alone = assess_fit(start, solution, responses, chosen, delay_s)
    if validate_on is None:
        return Fitted("elastic", solution.estimate, solution, alone)
    held = validate_elastic(start, solution, validate_on, chosen, delay_s, None, alone.findings, "validate_on")
    return Fitted("elastic", solution.estimate, solution, alone, held, held.outcome.grade)
