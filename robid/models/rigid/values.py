"""The rigid fit of records in memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from robid.models.rigid.fit.gains import corrected
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.shots import Shot, shots_of, without_gears
from robid.models.rigid.judge.identifying import identify
from robid.models.rigid.judge.validating import validate_rigid
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
    """Fits rigid dynamics and friction to torques and angles of motors.

    Instrumental variables, which need the robot's loop, are of `robid run`.

    Args:
        robot: The robot that the fit starts from.
        records: Records of motors' torques and angles.
        validate_on: Records of motions that the fit does not see.
        delay_s: Delay from recorded to applied torque [s].
        options: Fields of `RigidFitOptions`, as `model`, `filters`, `estimator`.

    Raises:
        DataError: If data and robot do not belong together, or the fit cannot use them.

    Source:
        Janot et al. (2009); docs/methods, sec. 7.
    """
    chosen, own = options_from(RigidFitOptions, options, "fit_model(rigid)"), _several(records)
    robot = without_gears(robot, own[0])
    solution, alone = identify(robot, own[0], _shots(own, robot, delay_s), chosen)
    if validate_on is None:
        return Fitted("rigid", solution.estimate, solution, alone)
    new = corrected(_shots(_several(validate_on), robot, delay_s), solution.gains)
    held = validate_rigid(robot, solution, new, chosen, alone.findings)
    return Fitted("rigid", solution.estimate, solution, alone, held, held.outcome.grade)


def _several(records: Record | Sequence[Record]) -> tuple[Record, ...]:
    return (records,) if isinstance(records, Record) else tuple(records)


def _shots(records: Sequence[Record], robot: Robot, delay_s: float) -> tuple[Shot, ...]:
    loaded = robot.payload.mass_kg > 0
    return tuple(
        shot
        for record in records
        for shot in shots_of(record, robot, late_samples=round(delay_s / record.sampling_period_s), loaded=loaded)
    )
