"""Models of the study of fleets."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from robid.settings.base import Name, Section


class FleetFaults(Section):
    """What is wrong with some of the robots: six kinds, as many robots of each."""

    each: int = Field(default=5, description="Robots of each kind.", ge=0)
    seed: int = Field(default=1, description="Seed of which robots these are, and of what is wrong where.", ge=0)
    stiffness_factor: float = Field(
        default=0.7, description="`spring`: true stiffness of a joint's transmission over that of a sound one.", gt=0
    )
    payload_kg: float = Field(
        default=5.0, description="`payload`: what is mounted beyond what the manifest says [kg].", gt=0
    )
    lost_samples: tuple[int, int] = Field(
        default=(3, 200), description="`gap`: fewest and most samples that are lost inside an experiment."
    )


class FleetSpeed(Section):
    """How the speed of `robid reprocess` is measured: backends in turn, again and again."""

    rows: int = Field(default=100, description="Rows of each run, all of sound robots.", ge=3)
    repeats: int = Field(default=5, description="Runs of each backend.", ge=1)


class FleetStudy(Section):
    """Logs of many simulated robots, some with faults, through `robid reprocess`."""

    kind: Literal["fleet"] = Field(description="What is studied.")
    campaign: Name = Field(description="Name of the simulated campaign that is logged of each robot.")
    experiment: str = Field(
        description="Experiment file, relative to this one, that reads these logs: its rows have `id`, `log` and"
        " `payload_kg`.",
        min_length=1,
    )
    robots: int = Field(default=1000, description="Number of robots.", ge=1)
    robots_per_task: int = Field(default=10, description="Robots that are simulated in one go.", ge=1)
    first_seed: int = Field(default=1, description="Seed of the first robot and its noise; the others follow.", ge=0)
    faults: FleetFaults = Field(default_factory=FleetFaults, description="What is wrong with some of them.")
    speed: FleetSpeed | None = Field(
        default_factory=FleetSpeed, description="How speed is measured; not at all when null."
    )
    scheduled: int = Field(
        default=0,
        description="Rows without work that a local Dask cluster is fed with, to see what it bears; 0 leaves it out.",
        ge=0,
    )
