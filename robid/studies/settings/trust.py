"""Models of the study of trust in intervals."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from robid.settings.base import Name, Section
from robid.settings.robot_sections import SpringSection


class Defects(Section):
    """What the robots of a set have and their model lacks, each in sizes of its own."""

    robot: Literal["heavy", "light"] = Field(
        default="heavy", description="Whose robots they are: this file's or that of `light`."
    )
    imperfections: dict[str, Any] = Field(
        default_factory=dict, description="`imperfections` that take the place of the campaigns'."
    )
    truth: dict[str, Any] = Field(default_factory=dict, description="`truth` that takes the place of the campaigns'.")
    springs: tuple[SpringSection, ...] = Field(
        default=(), description="Springs that the robot file lacks, from which each robot has some."
    )
    springs_each: int = Field(default=0, description="How many of these a robot has, drawn without return.", ge=0)
    size_factor: float = Field(
        default=1.5,
        description="Sizes of the imperfections that stand here, and stiffness and damping of the springs, are"
        " multiplied log-uniformly by up to this factor.",
        ge=1,
    )
    listed: bool = Field(
        default=False,
        description="Whether the list of doubts has these defects, so that intervals must hold the springs themselves.",
    )
    robots: int = Field(description="Number of robots.", ge=1)
    referenced: int = Field(
        default=0,
        description="How many of them, the first ones, are measured in fresh and in designed places too.",
        ge=0,
    )


class LinearRobots(Section):
    """Robots with exact responses plus noise, in as many random places as the others."""

    drawn: int = Field(default=40, description="Robots whose doubted values are drawn from their priors.", ge=0)
    file: int = Field(
        default=10, description="Robots that are, but for springs and dampers, what their file says.", ge=0
    )
    relative_noise: float = Field(
        default=0.01,
        description="Standard deviation of an element's noise over the median response of its output.",
        gt=0,
    )


class CauseKind(Section):
    """A defect that the tool is to name."""

    named: tuple[str, ...] = Field(
        description="Causes that count as right: several where they cannot be told apart.", min_length=1
    )
    imperfections: dict[str, Any] = Field(
        default_factory=dict, description="`imperfections` that take the place of the campaigns'."
    )
    truth: dict[str, Any] = Field(default_factory=dict, description="`truth` that takes the place of the campaigns'.")


class TrustSeeds(Section):
    """Seeds of true robots, places and noise, consecutive over all robots of the study."""

    first: int = Field(description="The first seed.", ge=0)
    robots: int | None = Field(
        default=None, description="At most as many robots of each set and kind; all when not given.", ge=1
    )


class TrustSeedChoice(Section):
    """Two disjoint sets of seeds: everything is chosen with one, the stated figures come from the other."""

    judge: TrustSeeds = Field(description="Those of the stated figures.")
    choose: TrustSeeds = Field(description="Those that everything is chosen with.")


class TrustStudy(Section):
    """Whether intervals hold, on robots whose defects their model does not contain."""

    kind: Literal["trust"] = Field(description="What is studied.")
    fit: Name = Field(
        description="Name of the fit: its campaign has the random places of a robot, the one to validate on the fresh"
        " places of the reference. Each robot's places are drawn anew."
    )
    designed: Name | None = Field(
        default=None,
        description="Name of the campaign in designed places, which all robots share; none when not given.",
    )
    validated_in: int = Field(
        default=4, description="Fresh places, the first ones, in which every robot is validated.", ge=1
    )
    light: str | None = Field(
        default=None,
        description="Experiment file, relative to this one, of a light robot, fit and campaigns named alike.",
        min_length=1,
    )
    sets: dict[Name, Defects] = Field(description="The sets of robots, by name.", min_length=1)
    linear: LinearRobots | None = Field(default=None, description="Linear robots; none when not given.")
    causes: dict[Name, CauseKind] = Field(default_factory=dict, description="Defects that are to be named, by name.")
    cause_robots: int = Field(default=5, description="Robots of each of these.", ge=1)
    cause_places: int = Field(
        default=4, description="Random places, the first ones, in which these are measured.", ge=1
    )
    seeds: TrustSeedChoice = Field(description="Seeds of the robots.")
    use: Literal["judge", "choose"] = Field(default="judge", description="Which of the seeds are used.")

    @property
    def chosen(self) -> TrustSeeds:
        """The seeds that are used."""
        return self.seeds.judge if self.use == "judge" else self.seeds.choose
