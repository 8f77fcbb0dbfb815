"""How often the order of random plants is found from their measured responses, and how often intervals contain them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from robid.artifacts.artifact import Dataset
from robid.pipeline.graph import Run
from robid.report.numbers import percent, significant
from robid.report.section import Section
from robid.studies.page import Asked, PartFound, table
from robid.studies.responses.plants import KINDS
from robid.studies.responses.trials import Outcome, summary, trial
from robid.studies.settings.responses import RandomPlantsCase
from robid.studies.study import Content, Part, Results, Task, in_chunks

_TOLD = {
    "siso": "one element",
    "delay": "one element with a delay",
    "integrators": "one or two integrators",
    "mimo": "2 x 3 elements with common poles",
    "noncollocated": "two or three masses, driven at one end and seen at the other",
}
_ASKED = {
    "order": Asked(lower=0.95),
    "worst_order": Asked(lower=0.90),
    "coverage": Asked(lower=0.92, upper=0.98),
    "pole_coverage": Asked(lower=0.92, upper=0.98),
}


def _tasks(_run: Run, case: RandomPlantsCase, _earlier: Mapping[str, Results]) -> list[Task]:
    chunks = in_chunks(case.first_seed, case.plants, case.plants_per_task)
    return [
        Task(f"{kind}_{seeds.start}", {"kind": kind, "seeds": [seeds.start, seeds.stop]}, (kind, seeds))
        for kind in KINDS
        for seeds in chunks
    ]


def fit_plants(kind: str, seeds: range) -> Content:
    """Fits some random plants of a kind."""
    every = [trial(kind, seed) for seed in seeds]
    counts = [(one.n_true, one.n_found, *one.integrators) for one in every]
    inside = [(sum(one.response), len(one.response), sum(one.poles), len(one.poles)) for one in every]
    return Content(
        {
            "kind": Dataset(np.array([kind], dtype=str), "1", ("kind",)),
            "counts": Dataset(
                np.array(counts), "1", ("plant", "count"), "Poles and integrators: true, found; -1: refused"
            ),
            "inside": Dataset(np.array(inside), "1", ("plant", "count"), "Intervals that contain the truth, and all"),
            "seconds": Dataset(np.array([one.seconds for one in every]), "s", ("plant",)),
        }
    )


def _outcomes(results: Results) -> dict[str, list[Outcome]]:
    found: dict[str, list[Outcome]] = {kind: [] for kind in KINDS}
    for one in results:
        kind = str(one.datasets["kind"].values[0])
        rows = zip(*(one.datasets[name].values.tolist() for name in ("counts", "inside", "seconds")), strict=True)
        for (true, order, own, told), (held, every, poles, all_poles), seconds in rows:
            response = (True,) * held + (False,) * (every - held)
            of_poles = (True,) * poles + (False,) * (all_poles - poles)
            found[kind].append(Outcome(true, order, (own, told), response, of_poles, seconds))
    return found


def _conclude(_run: Run, _case: RandomPlantsCase, results: Results) -> PartFound:
    every = {kind: summary(outcomes) for kind, outcomes in _outcomes(results).items()}
    pooled = summary([one for outcomes in _outcomes(results).values() for one in outcomes])
    figures = {f"response.{name}": value for name, value in pooled.items()}
    figures["response.worst_order"] = min(found["order"] for found in every.values())
    figures |= {f"response.{kind}.{name}": value for kind, found in every.items() for name, value in found.items()}
    columns = (
        ("Plants", lambda kind: _TOLD[kind]),
        ("Right order", lambda kind: percent(every[kind]["order"])),
        ("Right integrators", lambda kind: percent(every[kind]["integrators"])),
        ("Response in its interval", lambda kind: percent(every[kind]["coverage"])),
        ("Poles in theirs", lambda kind: percent(every[kind]["pole_coverage"])),
        ("Time [s]", lambda kind: significant(every[kind]["seconds"])),
    )
    lead = (
        "Plants of 2 to 12 poles, measured on 150 to 300 lines with noise that depends on frequency. Removing any pole"
        " would raise the cost by more than 4 ln N. Intervals are of 95 %, those of poles where the order is right."
    )
    asked = {f"response.{name}": wanted for name, wanted in _ASKED.items()}
    return PartFound(figures, asked, (Section("Random plants", lead, (table(columns, list(KINDS)),)),))


RANDOM_RESPONSES = Part("plants", _conclude, _tasks, fit_plants)
