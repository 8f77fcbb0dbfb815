"""Models of the study of dynamics that change with position."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from robid.settings.base import Name, Section


class KnownStructureCase(Section):
    """Systems of known structure, measured with noise, each in a basis of states of its own."""

    first_seed: int = Field(default=101, description="The first seed; further ones follow it.", ge=0)
    runs: int = Field(default=100, description="Number of systems, one a seed.", ge=1)
    runs_per_task: int = Field(default=10, description="Systems that are identified in one go.", ge=1)


class RestCase(Section):
    """The model of this file, held against responses at rest."""

    fit: Name = Field(description="Name of the position-dependent fit, with a campaign to validate on.")


class TravelCase(Section):
    """A model while the slide moves."""

    fit: Name = Field(description="Name of the position-dependent fit.")
    uncompensated: Name | None = Field(
        default=None, description="Name of a fit to responses with friction in them, whose error is printed beside."
    )
    campaign: Name = Field(description="Name of the simulated campaign in which the slide travels.")
    fixed: Name = Field(description="Name of the simulated campaign with the same lines at one position (eq. 20).")


class TurkStudy(Section):
    """Sparse position-dependent models: of known systems, of a simulated ball screw at rest, and while it moves."""

    kind: Literal["turk2018"] = Field(description="What is studied.")
    synthetic: KnownStructureCase | None = Field(default=None, description="Systems of known structure.")
    local: RestCase | None = Field(default=None, description="The model of this file at rest.")
    travel: TravelCase | None = Field(default=None, alias="global", description="A model while the slide moves.")
    paper: str = Field(description="File with the paper's figures, relative to this one.", min_length=1)
