"""What the sections of a rigid fit's page are laid out from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from robid.models.rigid.fit.options import VerdictOptions
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.motors import Motors
from robid.models.rigid.judge.validating import RigidValidation
from robid.report.parameters import Estimates
from robid.results.grade import Grade
from robid.robot.description import Joint
from robid.robot.regressor.drives import acts_along


@dataclass(frozen=True)
class RigidContent:
    """A rigid fit with everything that its page says of it."""

    solution: RigidSolution  # the fit
    estimates: Estimates  # its parameters
    motors: Motors  # its motors
    joints: Sequence[Joint]  # the robot's
    validation: RigidValidation | None = None  # how it does on another motion; None where it was not validated
    grade: Grade | None = None  # how far to trust it; None where that is unknown
    tests: VerdictOptions = field(default_factory=VerdictOptions)  # limits of the tests of least squares

    @property
    def units(self) -> tuple[str, ...]:
        """Unit of what drives each joint: of the torques, or N where it is a force."""
        unit = self.estimates.torque_unit
        return tuple("N" if unit == "N m" and acts_along(joint) else unit for joint in self.joints)

    @property
    def sensed(self) -> tuple[str, ...]:
        """Joints without a motor."""
        return tuple(joint.name for joint in self.joints if not joint.has_motor)
