"""Stiffness that depends on a joint's position, in a robot file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from robid.robot.description import StiffnessLaw
from robid.settings.base import Name, Section

if TYPE_CHECKING:
    from robid.settings.robot_sections import JointSection

Coefficients = Annotated[tuple[float, ...], Field(min_length=1)]


class StiffnessOver(Section):
    """A factor on a spring's stiffness by the position of a joint: a table, or a polynomial of either kind."""

    joint: Name = Field(description="Name of the joint.")
    positions_m: Coefficients | None = Field(
        default=None, description="Table: positions of a prismatic joint, ascending, over all of its range [m]."
    )
    positions_deg: Coefficients | None = Field(
        default=None, description="Table: angles of a revolute joint, ascending, over all of its range [deg]."
    )
    factors: Annotated[tuple[Annotated[float, Field(gt=0)], ...], Field(min_length=2)] | None = Field(
        default=None,
        description="Table: what the stiffness is multiplied by at each of these; monotone cubics lie between.",
    )
    stiffness: Coefficients | None = Field(
        default=None,
        description="In place of a table: the factor as a polynomial of the position [m, or rad], constant first.",
    )
    compliance: Coefficients | None = Field(
        default=None,
        description="In place of a table: one over the factor as such a polynomial. Springs in series of which one"
        " grows with the position, as a screw from its fixed bearing to the nut, are `[1, slope]`.",
    )

    @property
    def forms(self) -> tuple[str, ...]:
        """Names of the forms that are written: one, if the section is right."""
        given = {
            "factors": any(part is not None for part in (self.factors, self.positions_m, self.positions_deg)),
            "stiffness": self.stiffness is not None,
            "compliance": self.compliance is not None,
        }
        return tuple(name for name, is_there in given.items() if is_there)

    @property
    def positions(self) -> tuple[float, ...]:
        """Positions of the table [rad, or m]."""
        if self.positions_m is not None:
            return self.positions_m
        return tuple(np.deg2rad(self.positions_deg or ()).tolist())

    def law(self, joints: tuple[JointSection, ...]) -> StiffnessLaw:
        """Returns the plain description."""
        joint = [each.name for each in joints].index(self.joint)
        if self.factors is not None:
            return StiffnessLaw(joint, "table", np.array(self.factors), np.array(self.positions))
        if self.stiffness is not None:
            return StiffnessLaw(joint, "stiffness", np.array(self.stiffness))
        return StiffnessLaw(joint, "compliance", np.array(self.compliance))
