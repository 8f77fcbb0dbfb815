"""The fit of gears to records in memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from robid.models.transmission.fit.fitting import fit_transmissions
from robid.models.transmission.fit.motions import Motion, motions_of
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.models.transmission.judge.plausible import assess
from robid.models.transmission.judge.validating import validate_transmissions
from robid.results.fitted import Fitted
from robid.results.options import options_from
from robid.robot.description import Robot
from robid.signals.record import Record


def fit_values(
    robot: Robot,
    records: Record | Sequence[Record],
    *,
    validate_on: Record | Sequence[Record] | None = None,
    delay_s: float = 0.0,
    **options: Any,  # noqa: ANN401
) -> Fitted:
    """Fits gears to angles of motors and arms and to the motors' torques.

    Args:
        robot: The robot, whose bodies say what loads the gears.
        records: Records of motors' torques and angles and of arms' angles.
        validate_on: Records of motions that the fit does not see.
        delay_s: Delay from recorded to applied torque [s].
        options: Fields of `TransmissionFitOptions`, as `gear`, `cut_hz`, `rated_torque_nm`.

    Raises:
        DataError: If data and robot do not belong together, or the fit cannot use them.

    Source:
        docs/methods, sec. 15.
    """
    chosen = options_from(TransmissionFitOptions, options, "fit_model(transmission)")
    solution = fit_transmissions(robot, _motions(records, robot, delay_s), chosen)
    alone = assess(solution, chosen)
    if validate_on is None:
        return Fitted("transmission", solution.estimate, solution, alone)
    held = validate_transmissions(robot, solution, _motions(validate_on, robot, delay_s), chosen, alone.findings)
    return Fitted("transmission", solution.estimate, solution, alone, held, held.outcome.grade)


def _motions(records: Record | Sequence[Record], robot: Robot, delay_s: float) -> tuple[Motion, ...]:
    several = (records,) if isinstance(records, Record) else tuple(records)
    return tuple(
        motion
        for index, record in enumerate(several)
        for motion in motions_of(
            record,
            robot,
            late_samples=round(delay_s / record.sampling_period_s),
            name=f"record {index + 1}" if len(several) > 1 else "",
        )
    )
