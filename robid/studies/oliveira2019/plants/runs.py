"""The tasks of the paper's channels: one each, identified from the first seed's noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from robid.pipeline import Run
from robid.settings.robot_parts import plain_settings
from robid.studies.oliveira2019.plants.bench import Bench, Plant, bench_of, plants_of
from robid.studies.oliveira2019.plants.identification import identify_channel
from robid.studies.oliveira2019.plants.identified import to_content
from robid.studies.oliveira2019.section import study_of
from robid.studies.paper import paper_figures
from robid.studies.settings.oliveira2019 import PlantsCase
from robid.studies.tasks import Content, Task

_SEEDS = ("first_seed", "seeds", "seeds_per_task")


@dataclass(frozen=True)
class Channel:
    """A channel to be identified."""

    plant: Plant
    bench: Bench
    case: PlantsCase


def channels_of(run: Run) -> tuple[Channel, ...]:
    """Returns the channels; none where the study leaves them out."""
    study = study_of(run.loaded)
    if study.plants is None:
        return ()
    paper = paper_figures(study.paper, run.loaded)
    bench = bench_of(paper, study.plants)
    return tuple(Channel(plant, bench, study.plants) for plant in plants_of(paper))


def decides_of(channel: Channel) -> dict[str, Any]:
    """Returns what decides a channel's results, seeds left out."""
    case = {key: value for key, value in plain_settings(channel.case).items() if key not in _SEEDS}
    plant = {**vars(channel.plant), "amplitude": {f"{high:g}": size for high, size in channel.plant.amplitude.items()}}
    return {"plant": plain_settings(plant), "bench": plain_settings(channel.bench), **case}


def plants_tasks(run: Run) -> list[Task]:
    """Returns the tasks of the channels."""
    return [
        Task(channel.plant.name, {**decides_of(channel), "seed": channel.case.first_seed}, channel)
        for channel in channels_of(run)
    ]


def identify(channel: Channel) -> Content:
    """Identifies one channel."""
    found = identify_channel(channel.plant, channel.bench, channel.case, channel.case.first_seed)
    return to_content(found)
