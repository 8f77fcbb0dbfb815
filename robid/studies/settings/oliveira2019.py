"""Models of the study of external dynamics."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from robid.settings.base import Name, Section


class PlantsCase(Section):
    """The paper's transfer functions as plants, excited and measured as its robot was."""

    first_seed: int = Field(
        default=101, description="The seed of the tables' noise; further ones, of the coverage, follow it.", ge=0
    )
    seeds: int = Field(default=100, description="Number of seeds of the coverage; 0 leaves it out.", ge=0)
    seeds_per_task: int = Field(default=25, description="Seeds that are fitted in one go.", ge=1)
    delay_samples: int = Field(default=4, description="True transport delay, which is estimated.", ge=0)
    moving_average: int = Field(default=4, description="Samples of the commands' moving average, known.", ge=1)
    noise_resolutions: float = Field(
        default=1.0, description="Deviation of the noise before quantising, over the resolution.", ge=0
    )
    fit_hz: tuple[float, ...] = Field(
        default=(0.10, 1.04, 5.20), description="Highest frequencies of the chirps that are fitted [Hz].", min_length=1
    )
    validation_hz: float = Field(default=2.08, description="Highest frequency of the chirp that validates [Hz].", gt=0)
    band_hz: tuple[float, float] = Field(
        default=(0.01, 5.2), description="Band in which responses and poles are judged [Hz]."
    )
    max_poles: int = Field(default=5, description="Poles that are tried at most.", ge=1)
    max_delay_samples: int = Field(default=10, description="Longest delay that is searched.", ge=0)


class SyntheticCase(Section):
    """Random plants whose order is to be found."""

    first_seed: int = Field(default=101, description="The first seed; further ones follow it.", ge=0)
    plants: int = Field(default=100, description="Number of plants, one a seed.", ge=1)
    plants_per_task: int = Field(default=10, description="Plants that are identified in one go.", ge=1)


class CartesianCase(Section):
    """The arm of this file, whose Cartesian channels are identified in simulation."""

    fit: Name = Field(description="Name of the external fit, with a campaign to validate on.")
    homes: Name = Field(description="Name of the simulated campaign of pose commands from several home positions.")


class LoopCase(Section):
    """Real data of a closed position loop."""

    experiment: str = Field(description="Experiment file, relative to this one.", min_length=1)
    fit: Name = Field(description="Name of its external fit.")


class OliveiraStudy(Section):
    """Transfer functions from commanded to actual position, against known plants, a simulated arm and real data."""

    kind: Literal["oliveira2019"] = Field(description="What is studied.")
    plants: PlantsCase | None = Field(default=None, description="The paper's transfer functions as plants.")
    synthetic: SyntheticCase | None = Field(default=None, description="Random plants.")
    arm: CartesianCase | None = Field(default=None, description="A simulated arm on a rail.")
    emps: LoopCase | None = Field(
        default=None, description="A real axis in closed loop; skipped where its log is not there."
    )
    paper: str = Field(description="File with the paper's figures, relative to this one.", min_length=1)
