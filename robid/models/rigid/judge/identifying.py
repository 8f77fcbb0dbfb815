"""A rigid fit with everything that speaks against it: scales first, since all else would be their doing."""

from __future__ import annotations

from collections.abc import Sequence

from robid.errors import DataError
from robid.models.rigid.fit.fitting import Simulate, fit_rigid
from robid.models.rigid.fit.gains import corrected
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.shots import Shot, refuse_unusable
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.balances import balance_findings
from robid.models.rigid.judge.plausible import assess_rigid, is_unexplained
from robid.models.rigid.judge.scales import motions_of, rigid_scale_findings, sum_findings
from robid.models.rigid.judge.small_angles import small_angle_findings
from robid.models.rigid.judge.trials import try_causes
from robid.results.finding import blamed
from robid.results.grade import Grade
from robid.robot.description import Robot
from robid.signals.record import Record


def identify(
    robot: Robot, record: Record, shots: Sequence[Shot], options: RigidFitOptions, loop: Simulate | None = None
) -> tuple[RigidSolution, Grade]:
    """Fits rigid dynamics and friction, and grades the fit by itself.

    Args:
        robot: The robot that the fit starts from.
        record: The first record, whose channels say what moves.
        shots: Shots of all records.
        options: Options of the fit.
        loop: Simulates the loop of the shots, for instrumental variables.

    Raises:
        DataError: If the data cannot be used; it names a wrong scale first where that explains it.
    """
    refuse_unusable(robot, shots)
    motions = motions_of(record, robot)
    scales = rigid_scale_findings(robot, shots, motions, options) or sum_findings(robot, shots, options)
    try:
        solution = fit_rigid(robot, shots, options, loop)
    except DataError as error:
        raise blamed(error, scales) from error
    shots = corrected(shots, solution.gains)
    scales = scales or small_angle_findings(robot, shots, motions, solution, options)
    if scales:
        return solution, assess_rigid(robot, solution, options, scales)
    tried = try_causes(robot, shots, solution, options) if is_unexplained(robot, solution, options) else ()
    further = tuple(balance_findings(robot, shots, solution, options))
    return solution, assess_rigid(robot, solution, options, (), tried, further)
