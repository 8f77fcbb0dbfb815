"""Options of the frequency response estimate."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal


@dataclass(frozen=True)
class EstimateOptions:
    """How a record becomes a frequency response."""

    estimator: Literal["logarithmic", "arithmetic"] = field(
        default="logarithmic", metadata={"description": "How the blocks' responses are averaged."}
    )
    compensation: Literal["none", "nominal", "silent_lines"] = field(
        default="nominal",
        metadata={
            "description": "Friction and ripple subtracted from the torque: none, the robot file's, or what the lines"
            " that are not excited show."
        },
    )
    silent_configurations: int = field(
        default=4,
        metadata={"description": "Configurations, evenly spread, in which `silent_lines` identifies them.", "ge": 1},
    )
    pooled_lines: int = field(
        default=3,
        metadata={"description": "Neighbouring lines (odd number) pooled in the residual covariance.", "ge": 1},
    )
