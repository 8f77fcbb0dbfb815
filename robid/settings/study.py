"""Models of the study section of an experiment file."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args, get_type_hints

from pydantic import Field

from robid.frf.options import EstimateOptions
from robid.settings.base import Name, Section


class FrfStudy(Section):
    """Estimators against the best linear approximation, and what compensation leaves of the bias."""

    kind: Literal["frf"] = Field(description="What is studied.")
    campaign: Name = Field(description="Name of the simulated campaign whose realizations it divides into groups.")
    group: int = Field(default=4, description="Realizations of one estimate.", ge=2)
    groups_per_task: int = Field(default=5, description="Groups that are simulated at once.", ge=1)
    estimators: tuple[str, ...] | None = Field(
        default=None, description="Values of `estimate.estimator` to compare; all when not given.", min_length=1
    )
    compensations: tuple[str, ...] | None = Field(
        default=None, description="Values of `estimate.compensation` to compare; all when not given.", min_length=1
    )
    reference_estimator: str = Field(
        default="joint", description="Estimator of the best linear approximation, from all realizations of a task."
    )
    references: dict[str, float] = Field(
        default_factory=dict, description="Figures to hold ours against, by their name in summary.json."
    )


Study: TypeAlias = FrfStudy


def choices(option: Literal["estimator", "compensation"]) -> tuple[str, ...]:
    """Returns the values that an option of the estimate may have."""
    return get_args(get_type_hints(EstimateOptions)[option])
