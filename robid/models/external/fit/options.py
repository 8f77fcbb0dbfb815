"""Options of an external fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

HoldName = Literal["recorded", "zoh", "foh"]
StartName = Literal["auto", "rest", "periodic", "free"]


@dataclass(frozen=True)
class CouplingOptions:
    """When an output counts as coupled to a command of another channel."""

    coherence: float = field(
        default=0.70,
        metadata={"description": "Root of the coherence from which on signals are related.", "gt": 0, "lt": 1},
    )
    ratio: float = field(
        default=0.15, metadata={"description": "Normalised magnitude ratio from which on coupling matters.", "gt": 0}
    )
    resolution_m: float = field(default=1e-5, metadata={"description": "Resolution of translations [m].", "gt": 0})
    resolution_rad: float = field(
        default=float(np.deg2rad(0.001)), metadata={"description": "Resolution of rotations [rad].", "gt": 0}
    )
    segments: int = field(
        default=16, metadata={"description": "Segments of Welch's method, which overlap by half.", "ge": 2}
    )
    level: float = field(
        default=0.01, metadata={"description": "Chance of a false alarm of one pair.", "gt": 0, "lt": 1}
    )


@dataclass(frozen=True)
class ExternalOptions:
    """How transfer functions from commands to positions are estimated."""

    matrix: Literal["diagonal", "full"] = field(
        default="diagonal",
        metadata={
            "description": "One transfer function a channel, or the whole matrix of all channels with common poles."
        },
    )
    pairs: tuple[tuple[str, str], ...] = field(
        default=(),
        metadata={
            "description": "Channels as input and output; when not given each input with the output of its name."
        },
    )
    poles: int | None = field(
        default=None, metadata={"description": "Number of poles; chosen from the data when not given.", "ge": 1}
    )
    zeros: int | None = field(
        default=None, metadata={"description": "Number of zeros, below that of poles; chosen when not given.", "ge": 0}
    )
    rule: Literal["evidence", "sufficient"] = field(
        default="evidence",
        metadata={
            "description": "How the order is chosen: by evidence against overfitting, or the"
            " smallest that reaches `sufficient_nrmse`."
        },
    )
    sufficient_nrmse: float = field(
        default=0.9, metadata={"description": "What the rule `sufficient` asks for.", "gt": 0, "lt": 1}
    )
    max_poles: int = field(default=5, metadata={"description": "Poles that are tried at most.", "ge": 1, "le": 12})
    delay_samples: int | None = field(
        default=None, metadata={"description": "Transport delay in samples; searched when not given.", "ge": 0}
    )
    max_delay_samples: int = field(
        default=10, metadata={"description": "Longest transport delay that is searched, in samples.", "ge": 0}
    )
    moving_average: int = field(
        default=1, metadata={"description": "Samples of the command's moving average, known beforehand.", "ge": 1}
    )
    hold: HoldName = field(
        default="recorded",
        metadata={
            "description": "What commands do between samples: `zoh`, `foh` (straight lines), or what the record says."
        },
    )
    start: StartName = field(
        default="auto",
        metadata={
            "description": "State at the first sample: at rest, that of a steady period, free, or by the record"
            " (periodic, or free of one shot)."
        },
    )
    offset: Literal["auto", "none", "estimated"] = field(
        default="auto",
        metadata={"description": "Whether a constant of each output is estimated, or signals are absolute (`none`)."},
    )
    stable: bool = field(default=True, metadata={"description": "Whether poles are kept in the left half plane."})
    static_gain: Literal["free", "one"] = field(
        default="free", metadata={"description": "Whether the static gain is estimated, or 1 by assumption."}
    )
    speed_references: Literal["integrated", "kept"] = field(
        default="integrated",
        metadata={
            "description": "Whether speed references to a position are integrated to position commands first, which"
            " takes the known integrator out of the model."
        },
    )
    coupling: CouplingOptions = field(
        default_factory=CouplingOptions, metadata={"description": "When channels count as coupled."}
    )
    confidence: float = field(default=0.95, metadata={"description": "Level of the intervals.", "gt": 0, "lt": 1})
    identifiable_relative_std: float = field(
        default=0.2,
        metadata={
            "description": "Predicted relative standard deviation up to which a parameter counts as identifiable.",
            "gt": 0,
        },
    )
