"""Options of the frequency response estimate."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from robid.arrays import option

IDENTIFYING = frozenset({"auto", "silent_lines"})  # Compensations that look at the silent lines


@dataclass(frozen=True)
class FittedFriction:
    """Friction that a fit of rigid dynamics found, subtracted from the torque."""

    fit: str = field(metadata={"description": "Name of the fit, which estimates Coulomb friction.", "min_length": 1})


@dataclass(frozen=True)
class EstimateOptions:
    """How a record becomes a frequency response."""

    estimator: Literal[
        "logarithmic", "arithmetic", "joint", "h1", "indirect", "robust_local", "local", "local_periodic"
    ] = option(
        "logarithmic",
        "Estimator. `logarithmic`, `arithmetic`: means of Y U^-1 over the blocks. `joint`: least squares with "
        "the recorded reference as instrument. `h1`: the same with the torque as instrument, biased in closed "
        "loop. `indirect`: closed-loop responses from the recorded reference. `robust_local`: `logarithmic` "
        "after the transient between the lines of several periods is removed. `local`: a polynomial through "
        "neighbouring bins of any signal. `local_periodic`: one through neighbouring excited lines, for fewer "
        "experiments than motors.",
    )
    outputs: Literal["auto", "acceleration", "measured"] = option(
        "auto",
        "Whether angles, positions and speeds become accelerations or stay as measured. `auto`: accelerations "
        "where the inputs are torques, currents or forces, as measured for all others.",
    )
    local_order: int = option(2, "Order of the local polynomials of response and transient.", ge=0, le=20)
    local_denominator: int = option(
        0,
        "Order of the denominator of `local` and `local_periodic`; 0 is a polynomial, 2 follows a resonance.",
        ge=0,
        le=4,
    )
    local_half_width_lines: int | None = option(
        None,
        "Bins or lines that a local fit uses on each side of the estimated one. When not given, the smallest "
        "number that leaves enough degrees of freedom.",
        ge=0,
        le=100_000,
    )
    compensation: Literal["auto", "none", "nominal", "silent_lines"] | FittedFriction = option(
        "nominal",
        "Friction and ripple subtracted from the torque. `none`: nothing. `nominal`: the robot file's. "
        "`silent_lines`: what the lines that are not excited show. `{fit: NAME}`: the friction of a rigid fit. "
        "`auto`, the default of logs: `silent_lines` where possible, else `nominal`.",
    )
    silent_configurations: int = option(
        4, "Configurations, evenly spread, in which `silent_lines` identifies them.", ge=1, le=10_000
    )
    pooled_lines: int = option(3, "Neighbouring lines (odd number) pooled in the residual covariance.", ge=1, le=10_001)

    weak_line_std: float = option(
        0.5,
        "Limit of the standard deviation of an input's best known response, over the response's usual size "
        "around the line. A line above it is left out for this input.",
        gt=0,
    )

    @property
    def friction_fit(self) -> str | None:
        """Name of the fit whose friction is subtracted, if one's is."""
        return self.compensation.fit if isinstance(self.compensation, FittedFriction) else None

    @property
    def compensation_kind(self) -> str:
        """What is subtracted, in a word."""
        return "fit" if isinstance(self.compensation, FittedFriction) else self.compensation
