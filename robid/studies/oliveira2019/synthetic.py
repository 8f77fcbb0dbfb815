"""Random plants, and how often the evidence finds their order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.artifacts.artifact import Artifact, Dataset
from robid.pipeline.graph import Run
from robid.report.section import Section, Table
from robid.studies.oliveira2019.random_plants import MOST_POLES, SIGNAL_TO_NOISE_DB, find_orders
from robid.studies.oliveira2019.section import study_of
from robid.studies.part import Asked, PartFound
from robid.studies.tasks import Content, Task

_ASKED = Asked(lower=0.95)


def synthetic_tasks(run: Run) -> list[Task]:
    """Returns the tasks: some plants each; none where the study leaves them out."""
    case = study_of(run.loaded).synthetic
    if case is None:
        return []
    last = case.first_seed + case.plants
    chunks = [
        range(first, min(first + case.plants_per_task, last))
        for first in range(case.first_seed, last, case.plants_per_task)
    ]
    return [Task(f"plants_{seeds.start}", {"seeds": [seeds.start, seeds.stop]}, seeds) for seeds in chunks]


def find(seeds: range) -> Content:
    """Identifies some random plants."""
    found = find_orders(seeds)
    axes = ("plant", "count")
    return Content(
        {
            "true": Dataset(np.array(found.true), "1", axes, "Numbers of poles and zeros"),
            "found": Dataset(np.array(found.found), "1", axes, "What the evidence chose"),
        }
    )


def conclude_synthetic(run: Run, results: Sequence[Artifact]) -> PartFound | None:
    """Counts how often the order was found."""
    if study_of(run.loaded).synthetic is None:
        return None
    true, found = (np.concatenate([one.datasets[key].values for one in results]) for key in ("true", "found"))
    right = true[:, 0] == found[:, 0]
    figures = {
        "synthetic.plants": float(len(true)),
        "synthetic.order_correct_share": float(right.mean()),
        "synthetic.structure_correct_share": float((true == found).all(axis=1).mean()),
    }
    orders = range(1, MOST_POLES + 1)
    rows = tuple(
        (
            str(order),
            *(str(int(((true[:, 0] == order) & (found[:, 0] == other)).sum())) for other in orders),
        )
        for order in orders
    )
    table = Table(
        ("True poles", *(f"{other} found" for other in orders)),
        rows,
        caption="Number of plants.",
        fit="compact",
    )
    lead = (
        f"Plants with random poles and zeros inside the excited band, at least 20 % apart, measured with"
        f" {SIGNAL_TO_NOISE_DB:g} dB; the delay is known, the evidence chooses the numbers of poles and zeros."
    )
    return PartFound(figures, {"synthetic.order_correct_share": _ASKED}, (Section("Random plants", lead, (table,)),))
