"""Options of the steps that compare models in the time domain."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class StepOptions:
    """Short steps of one axis at a time, as fast as the motors allow."""

    configurations: int = field(
        default=5, metadata={"description": "Random configurations in which every axis is stepped.", "ge": 1}
    )
    seed: int = field(default=1, metadata={"description": "Seed of the configurations.", "ge": 0})
    step_deg: float = field(default=1.0, metadata={"description": "Size of a step, arm side [deg].", "gt": 0})
    step_m: float = field(default=0.01, metadata={"description": "The same of prismatic joints [m].", "gt": 0})
    peak_motor_speed_rad_s: float = field(
        default=20.0, metadata={"description": "Largest speed of any motor during a step [rad/s].", "gt": 0}
    )
    torque_share: float = field(
        default=0.8,
        metadata={"description": "Share of the torque limits that a step may need; feedback has the rest.", "gt": 0},
    )
    shortest_ramp_s: float = field(
        default=0.1, metadata={"description": "Shortest time in which a step reaches its speed [s].", "gt": 0}
    )
    duration_s: float = field(
        default=1.0, metadata={"description": "Time that is compared, from the beginning of a step [s].", "gt": 0}
    )
