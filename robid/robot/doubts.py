"""How far the values of a robot file may be off: standard deviations of what no data sheet states."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Doubts:
    """Standard deviations of what a robot file may have wrong; zero for what is taken for granted."""

    mass_relative_std: float = field(
        default=0.05, metadata={"description": "Of a link's mass, its inertia with it, relative.", "ge": 0}
    )
    com_m: float = field(
        default=0.01, metadata={"description": "Of each coordinate of a link's centre of mass [m].", "ge": 0}
    )
    payload_relative_std: float = field(
        default=0.02, metadata={"description": "Of the payload's mass, its inertia with it, relative.", "ge": 0}
    )
    payload_com_m: float = field(
        default=0.01, metadata={"description": "Of each coordinate of the payload's centre of mass [m].", "ge": 0}
    )
    payload_inertia_relative_std: float = field(
        default=0.1, metadata={"description": "Of the payload's inertia about its centre of mass, relative.", "ge": 0}
    )
    torque_relative_std: float = field(
        default=0.02, metadata={"description": "Of a motor's torque constant, relative.", "ge": 0}
    )
