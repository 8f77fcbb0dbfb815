"""The study of fits to responses: its section of an experiment file."""

from __future__ import annotations

from typing import Literal

from robid.settings.base import Section
from robid.studies.experiments import Count, Whole, entry


class RandomPlantsCase(Section):
    """Random plants whose order is to be found from their measured responses."""

    first_seed: Whole = entry("The first seed of each kind; further ones follow it.", 5001)
    plants: Count = entry("Number of plants of each kind, one a seed.", 100)
    plants_per_task: Count = entry("Plants fitted in one task.", 10)


class ResponsesStudy(Section):
    """Transfer functions from measured responses, against random plants."""

    kind: Literal["responses"] = entry("What is studied.")
    plants: RandomPlantsCase = entry("Random plants of five kinds.", default_factory=RandomPlantsCase)
