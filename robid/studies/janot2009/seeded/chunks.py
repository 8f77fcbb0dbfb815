"""Tasks of the seeded cases: some seeds of a machine with either of its filters, and what is kept of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from robid.arrays import FloatArray, IntArray, Quantity
from robid.artifacts.artifact import Artifact, Attribute, Dataset
from robid.artifacts.mapping import from_datasets, to_datasets
from robid.models.rigid.fit.huber import huber_weights, sweep_bend
from robid.models.rigid.fit.least_squares import Regression, ordinary_least_squares
from robid.models.rigid.fit.options import HuberOptions, PreprocessingOptions
from robid.models.rigid.fit.reduction import reduce_rows, residuals
from robid.models.rigid.fit.verdict import Verdict
from robid.settings.robot_parts import plain_settings
from robid.studies.janot2009.seeded.identification import Identified, Machine, Recording, identify, read
from robid.studies.settings.study import SeededCase
from robid.studies.tasks import Content, Task

FILTERS = ("good", "bad")
"""Filters that suit, and filters that do not."""
BENDS = (HuberOptions.bend, 0.2, 0.01, 1e3)
"""Bends `H` that are shown: the usual one, the paper's 0.2, towards 0 and towards infinity."""
TESTS = ("Huber", "instruments", "normality", "whiteness")
_ITERATIONS = 1000  # towards H = 0 the weights settle slowly


@dataclass(frozen=True)
class Chunk:
    """Some seeds of a case."""

    case: SeededCase
    seeds: range


@dataclass(frozen=True)
class Judged:
    """What seeds gave, and the first of them in detail.

    Attributes:
        size: What their errors are relative to: the magnitude of the truth, of a vector's parts its norm.
        residual: Its residuals of least squares, NaN where a row is not used.
        sentence: The verdict on it.
    """

    names: Annotated[tuple[str, ...], Quantity("1", "parameter", "Names of the parameters")]
    units: Annotated[tuple[str, ...], Quantity("1", "parameter", "Their units")]
    truth: Annotated[FloatArray, Quantity("as in units", "parameter", "Their true values")]
    size: Annotated[FloatArray, Quantity("as in units", "parameter", "What errors are relative to")]
    trust: Annotated[IntArray, Quantity("1", "seed", "Whether least squares was trusted")]
    alarms: Annotated[IntArray, Quantity("1", "seed test", "Which tests spoke against it")]
    plain: Annotated[FloatArray, Quantity("as in units", "seed parameter", "Least squares")]
    instrumental: Annotated[FloatArray, Quantity("as in units", "seed parameter", "Instrumental variables")]
    deviation: Annotated[FloatArray, Quantity("N m", "seed joint", "Deviation of the residuals")]
    value: Annotated[
        FloatArray, Quantity("as in units", "estimate parameter", "First seed: least squares, Huber at several bends")
    ]
    std: Annotated[FloatArray, Quantity("as in units", "estimate parameter", "Their standard deviations")]
    sigma: Annotated[FloatArray, Quantity("N m", "estimate joint", "Deviations of their residuals")]
    iterations: Annotated[IntArray, Quantity("1", "estimate", "Passes that they took")]
    time_s: Annotated[FloatArray, Quantity("s", "row", "Time of the first seed's rows")]
    residual: Annotated[
        FloatArray, Quantity("N m", "row joint", "First seed: residuals of least squares", compact=True)
    ]
    weight: Annotated[FloatArray, Quantity("1", "row joint", "First seed: Huber's weights", compact=True)]
    sentence: str


def chunk_tasks(
    case: SeededCase, name: str, decides: dict[str, Any], argument: Callable[[Chunk], object]
) -> list[Task]:
    """Returns the tasks of a case: its seeds in chunks, with either of the filters.

    Args:
        case: The case.
        name: Its name.
        decides: What decides its results beside its settings.
        argument: Makes what the task's function is given.
    """
    last = case.first_seed + case.seeds
    own = plain_settings(case)
    settings = {key: own[key] for key in own if key not in ("seeds", "seeds_per_task", "first_seed")}
    found = []
    for start in range(case.first_seed, last, case.seeds_per_task):
        chunk = Chunk(case, range(start, min(start + case.seeds_per_task, last)))
        place = {"seeds": [chunk.seeds.start, chunk.seeds.stop], "bends": BENDS}
        found.append(Task(f"{name}_{start}", {**decides, **settings, **place}, argument(chunk)))
    return found


def judge_chunk(machine: Machine, recording: Recording, case: SeededCase) -> Content:
    """Identifies every seed of a recording with either of the filters, the first seed in detail."""
    datasets: dict[str, Dataset] = {}
    attributes: dict[str, Attribute] = {}
    for name, cut in zip(FILTERS, (case.good_cut_hz, case.bad_cut_hz), strict=True):
        options = PreprocessingOptions(cut, drop_deviations=case.drop_deviations)
        judged = _judged(machine, identify(machine, recording, options), _detail(machine, recording, options))
        arrays, scalars = to_datasets(judged, f"{name}/")
        datasets, attributes = datasets | arrays, attributes | scalars
    return Content(datasets, attributes)


def gather(results: Sequence[Artifact], filters: str) -> Judged:
    """Joins the seeds of several tasks with one of the filters; the details are those of the first."""
    parts = [from_datasets(Judged, held, f"{filters}/") for held in results]
    joined = {
        key: np.concatenate([getattr(part, key) for part in parts])
        for key in ("trust", "alarms", "plain", "instrumental", "deviation")
    }
    return Judged(**{**vars(parts[0]), **joined})


@dataclass(frozen=True)
class _Detail:
    estimates: tuple[Regression, ...]
    time_s: FloatArray
    residual: FloatArray
    weight: FloatArray


def _detail(machine: Machine, recording: Recording, options: PreprocessingOptions) -> _Detail:
    """The paper's tables of the first seed: rows chosen by the measured speed, equal weights."""
    rows = read(machine, recording, 0, options)
    reduction = reduce_rows(rows)
    plain = ordinary_least_squares(reduction)
    swept = sweep_bend(rows, reduction, BENDS, HuberOptions(covariance="weighted", iteration_limit=_ITERATIONS))
    residual = residuals(rows, plain.parameters)
    period = recording.sampling_period_s * options.decimator(recording.sampling_period_s).factor
    weight = huber_weights(residuals(rows, swept[0].parameters) / swept[0].scale, BENDS[0])
    return _Detail((plain, *swept), np.arange(len(residual)) * period, residual, weight)


def _judged(machine: Machine, found: Identified, detail: _Detail) -> Judged:
    size = np.abs(machine.truth)
    for vector in machine.vectors:
        size[list(vector)] = np.linalg.norm(machine.truth[list(vector)])
    verdicts = [one.verdict for one in found.conclusions]
    instrumental = [one.instruments.parameters for one in found.conclusions if one.instruments is not None]
    return Judged(
        names=tuple(machine.regressor.names),
        units=tuple(machine.regressor.units),
        truth=machine.truth,
        size=size,
        trust=np.array([verdict.trust for verdict in verdicts], int),
        alarms=np.array([_alarms(verdict) for verdict in verdicts], int),
        plain=np.array([one.parameters for one in found.plain]),
        instrumental=np.array(instrumental),
        deviation=np.array([one.deviation for one in found.plain]),
        value=np.array([one.parameters for one in detail.estimates]),
        std=np.array([one.standard_deviation for one in detail.estimates]),
        sigma=np.array([one.deviation for one in detail.estimates]),
        iterations=np.array([one.iterations for one in detail.estimates]),
        time_s=detail.time_s,
        residual=detail.residual,
        weight=detail.weight,
        sentence=verdicts[0].sentence,
    )


def _alarms(verdict: Verdict) -> tuple[bool, ...]:
    against = verdict.instruments is not None and verdict.instruments.alarm
    return verdict.huber.alarm, against, verdict.normality_alarm, verdict.whiteness_alarm
