"""Options of an external fit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid.arrays import group, option

HoldName = Literal["recorded", "zoh", "foh"]
StartName = Literal["auto", "rest", "periodic", "free"]


@dataclass(frozen=True)
class CouplingOptions:
    """When an output counts as coupled to a command of another channel."""

    coherence: float = option(0.70, "Root of the coherence above which signals are related.", gt=0, lt=1)
    ratio: float = option(0.15, "Normalised magnitude ratio above which coupling matters.", gt=0)
    resolution_m: float = option(1e-5, "Resolution of translations [m].", gt=0)
    resolution_rad: float = option(float(np.deg2rad(0.001)), "Resolution of rotations [rad].", gt=0)
    segments: int = option(16, "Segments of Welch's method, which overlap by half.", ge=2, le=10_000)
    level: float = option(0.01, "Chance of a false alarm of one pair.", gt=0, lt=1)


@dataclass(frozen=True)
class ExternalOptions:
    """How transfer functions from commands to positions are estimated."""

    matrix: Literal["diagonal", "full"] = option(
        "diagonal", "One transfer function a channel, or the whole matrix of all channels with common poles."
    )
    pairs: tuple[tuple[str, str], ...] = option(
        (), "Channels as pairs of input and output; when not given, each input with the output of its name."
    )
    poles: int | None = option(None, "Number of poles; chosen from the data when not given.", ge=1, le=100)
    zeros: int | None = option(None, "Number of zeros, below that of poles; chosen when not given.", ge=0, le=100)
    rule: Literal["evidence", "sufficient"] = option(
        "evidence",
        "How the order is chosen: by evidence against overfitting, or the smallest that reaches `sufficient_nrmse`.",
    )
    sufficient_nrmse: float = option(0.9, "Smallest value for the rule `sufficient`.", gt=0, lt=1)
    max_poles: int = option(5, "Largest number of poles to try.", ge=1, le=12)
    delay_samples: int | None = option(None, "Transport delay in samples; searched when not given.", ge=0, le=10_000)
    max_delay_samples: int = option(10, "Longest transport delay that is searched, in samples.", ge=0, le=1_000)
    moving_average: int = option(1, "Samples of the command's moving average, known a priori.", ge=1, le=10_000)
    hold: HoldName = option(
        "recorded", "Course of commands between samples: `zoh`, `foh` (straight lines), or that of the record."
    )
    start: StartName = option(
        "auto",
        "State at the first sample: at rest, that of a steady period, free, or by the record (periodic, or free of one"
        " shot).",
    )
    offset: Literal["auto", "none", "estimated"] = option(
        "auto", "Whether a constant of each output is estimated, or signals are absolute (`none`)."
    )
    stable: bool = option(True, "Whether poles are kept in the left half plane.")
    static_gain: Literal["free", "one"] = option("free", "Whether the static gain is estimated, or 1 by assumption.")
    speed_references: Literal["integrated", "kept"] = option(
        "integrated",
        "Whether speed references to a position are first integrated to position commands, which removes the "
        "known integrator from the model.",
    )
    time: Literal["continuous", "discrete"] = option(
        "continuous", "Of fits to responses: transfer functions in s, or in z of a response between samples."
    )
    integrators: int | None = option(
        None, "Of fits to responses: number of exact integrators; 0, 1 or 2 by evidence when not given.", ge=0, le=4
    )
    relative_degree: int = option(
        0,
        "Of fits to responses: least number of poles less zeros; negative for improper functions, as of torque to "
        "position the other way round.",
        ge=-4,
        le=100,
    )
    coupling: CouplingOptions = group(CouplingOptions, "When channels count as coupled.")
    confidence: float = option(0.95, "Level of the intervals.", gt=0, lt=1)
    identifiable_relative_std: float = option(
        0.2, "Predicted relative standard deviation up to which a parameter counts as identifiable.", gt=0
    )
