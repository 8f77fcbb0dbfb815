"""What a rigid model has beside its links."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

FrictionForm = Literal["none", "viscous", "coulomb", "asymmetric", "load"]
PayloadForm = Literal["link", "body"]


@dataclass(frozen=True)
class RigidOptions:
    """What a rigid model has beside its links."""

    friction: FrictionForm = field(
        default="coulomb",
        metadata={
            "description": "Friction of each motor: `none`, `viscous`, `coulomb` (viscous and Coulomb), `asymmetric`"
            " (both for either direction), `load` (viscous, and Coulomb that grows with the motor's torque)."
        },
    )
    offsets: bool = field(default=True, metadata={"description": "Whether each motor's torque has an offset."})
    motor_inertias: bool = field(default=True, metadata={"description": "Whether rotors have inertia."})
    couplings: bool = field(
        default=True,
        metadata={
            "description": "Whether gears that several motors drive have inertia, viscous and, where the motors have"
            " it, Coulomb friction of their own, which move with the arm."
        },
    )
    counterbalances: bool = field(
        default=True, metadata={"description": "Whether the counterbalances of the robot file are there."}
    )
    payload: PayloadForm = field(
        default="link",
        metadata={
            "description": "Whether the payload is part of the last link (`link`) or a body with parameters of its own"
            " (`body`)."
        },
    )


@dataclass(frozen=True)
class BaseOptions:
    """How base parameters are found."""

    n_sample: int = field(
        default=500, metadata={"description": "Random configurations with speeds and accelerations.", "ge": 10}
    )
    speed_rad_s: float = field(default=2.0, metadata={"description": "Largest arm speed [rad/s, or m/s].", "gt": 0})
    acceleration_rad_s2: float = field(
        default=10.0, metadata={"description": "Largest arm acceleration [rad/s^2, or m/s^2].", "gt": 0}
    )
    threshold: float = field(
        default=1e-8,
        metadata={
            "description": "Columns, each scaled to 1, that lie nearer than this to the space of others are dependent.",
            "gt": 0,
            "lt": 1,
        },
    )
    seed: int = field(default=0, metadata={"description": "Seed of the random configurations.", "ge": 0})
