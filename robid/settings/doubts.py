"""How far the values of one joint may be off, where a robot file says other than for all joints."""

from __future__ import annotations

from dataclasses import replace

from pydantic import Field

from robid.robot.doubts import Doubts
from robid.settings.base import Section

_FOR_ALL = "in place of the robot's; 0 takes it for granted"


class JointDoubts(Section):
    """Standard deviations of what a robot file may have wrong of one joint."""

    mass_relative_std: float | None = Field(default=None, description=f"Of the link's mass, {_FOR_ALL}.", ge=0)
    com_m: float | None = Field(default=None, description=f"Of the link's centre of mass, {_FOR_ALL} [m].", ge=0)
    inertia_relative_std: float | None = Field(
        default=None, description=f"Of the link's inertia about its centre of mass, {_FOR_ALL}.", ge=0
    )
    torque_relative_std: float | None = Field(
        default=None, description=f"Of the motor's torque constant, {_FOR_ALL}.", ge=0
    )
    coupling_std: float | None = Field(default=None, description=f"Of the joint's gear couplings, {_FOR_ALL}.", ge=0)
    arm_friction: float | None = Field(
        default=None, description=f"Of viscous friction behind the transmission, {_FOR_ALL}.", ge=0
    )
    friction: float | None = Field(
        default=None, description=f"Of what friction leaves in the motor's torque, {_FOR_ALL}.", ge=0
    )
    loss_factor: float | None = Field(
        default=None, description=f"Of the largest loss factor of the gear's hysteresis, {_FOR_ALL}.", ge=0
    )
    stiffness_relative_std: float | None = Field(
        default=None, description=f"Of the joint's springs where no fit estimates them, {_FOR_ALL}.", ge=0
    )
    damping_relative_std: float | None = Field(
        default=None, description=f"Of the joint's dampers where no fit estimates them, {_FOR_ALL}.", ge=0
    )
    load_stiffness: float | None = Field(
        default=None, description=f"Of the gear's stiffness over the range of its loads, {_FOR_ALL}.", ge=0
    )
    compliance: float | None = Field(
        default=None, description=f"Of the compliance of bearings that the file lacks, {_FOR_ALL}.", ge=0
    )

    def over(self, doubts: Doubts) -> Doubts:
        """Returns the robot's doubts with what is said of this joint."""
        return replace(doubts, **self.model_dump(exclude_none=True))
