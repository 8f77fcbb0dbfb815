"""Stiffness and damping in a robot file, in the units of joints that turn and of joints that slide."""

from __future__ import annotations

from pydantic import Field

from robid.robot.parameters import PARAMETER_KINDS
from robid.settings.base import Assumed
from robid.settings.stiffness import StiffnessOver


class SpringDamper(Assumed):
    """Stiffness and damping of a spring-damper pair, arm side: turning, or of a prismatic joint's transmission."""

    stiffness_nm_rad: float | None = Field(default=None, description="Stiffness [N m/rad].", gt=0)
    damping_nms_rad: float | None = Field(default=None, description="Damping [N m s/rad].", ge=0)
    cubic_nm_rad3: float | None = Field(
        default=None, description="Coefficient of the cubic, stiffening part; 0 when not given [N m/rad^3].", ge=0
    )
    stiffness_n_m: float | None = Field(
        default=None, description="Transmission of a prismatic joint: stiffness [N/m].", gt=0
    )
    damping_ns_m: float | None = Field(
        default=None, description="Transmission of a prismatic joint: damping [N s/m].", ge=0
    )
    cubic_n_m3: float | None = Field(
        default=None,
        description="Transmission of a prismatic joint: coefficient of the cubic part; 0 when not given [N/m^3].",
        ge=0,
    )
    stiffness_over: StiffnessOver | None = Field(
        default=None,
        description="How the stiffness, its cubic part with it, depends on a joint's position: what the numbers above"
        " are multiplied by. The damping does not.",
    )

    def value(self, kind: str, *, linear: bool) -> float | None:
        """Returns a stated value of a kind of parameters.

        Args:
            kind: Of `robid.robot.parameters`.
            linear: Whether the spring works along a line.
        """
        about = PARAMETER_KINDS[kind]
        value: float | None = getattr(self, about.linear_field if linear else about.field)
        return value


class GearSection(SpringDamper):
    """The transmission of a joint, arm side: short for a spring `gear_<joint>` at the place `transmission`."""
