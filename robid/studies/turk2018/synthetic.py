"""Systems of known structure, and how often exactly that is found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np

from robid.arrays import BoolArray
from robid.artifacts.artifact import Artifact, Dataset
from robid.models.lpv.fit.blocks import block_names
from robid.models.lpv.fit.options import LpvOptions
from robid.pipeline import Run
from robid.report.section import Section, Table
from robid.settings.robot_parts import plain_settings
from robid.studies.part import Asked, PartFound
from robid.studies.tasks import Content, Task
from robid.studies.turk2018.known_structure import ORDER, STRUCTURE, fit_synthetic
from robid.studies.turk2018.section import study_of

_ASKED = Asked(lower=0.95)


def synthetic_tasks(run: Run) -> list[Task]:
    """Returns the tasks: some systems each; none where the study leaves them out."""
    case = study_of(run.loaded).synthetic
    if case is None:
        return []
    last = case.first_seed + case.runs
    chunks = [
        range(first, min(first + case.runs_per_task, last))
        for first in range(case.first_seed, last, case.runs_per_task)
    ]
    options = plain_settings(LpvOptions(order=ORDER))
    return [Task(f"runs_{seeds.start}", {"seeds": [*seeds], "options": options}, seeds) for seeds in chunks]


def find(seeds: range) -> Content:
    """Identifies some systems with the default options."""
    kept = np.array([fit_synthetic(seed, LpvOptions(order=ORDER)).kept for seed in seeds])
    return Content({"kept": Dataset(kept, "1", ("run", "matrix", "function"), "Blocks of A, B, C, D that were found")})


def conclude_synthetic(run: Run, results: Sequence[Artifact]) -> PartFound | None:
    """Counts how often exactly the true blocks were found."""
    if study_of(run.loaded).synthetic is None:
        return None
    kept = np.concatenate([one.datasets["kept"].values for one in results])
    found = count_structures(kept)
    share = found.get(", ".join(STRUCTURE), 0) / len(kept)
    figures = {"synthetic.runs": float(len(kept)), "synthetic.exact_structure_share": share}
    rows = tuple((name, str(count)) for name, count in found.items())
    table = Table(("Blocks found", "Runs"), rows, fit="compact")
    lead = (
        f"Three states, two outputs, A affine in the scheduling parameter, one quadratic block of B, constant C and D:"
        f" of 16 blocks {' and '.join(STRUCTURE)} are there. Each run has noise of 40 dB and another basis of states."
    )
    section = Section("Systems of known structure", lead, (table,))
    return PartFound(figures, {"synthetic.exact_structure_share": _ASKED}, (section,))


def count_structures(kept: BoolArray) -> dict[str, int]:
    """Counts the structures (n_run, 4, n_function) by the names of their blocks, the most frequent first."""
    return dict(Counter(", ".join(block_names(one)) or "none" for one in kept).most_common())
