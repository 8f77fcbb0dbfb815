"""How often bounds hold the truth: channels refitted at the chosen structure, a seed's noise at a time."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact, Dataset
from robid.models.external.fit.graphs import Fitted
from robid.models.external.fit.output_error import fit_block
from robid.models.external.fit.problem import Structure
from robid.models.external.fit.transfer import TransferMatrix
from robid.pipeline.graph import Run
from robid.report.numbers import percent, significant
from robid.report.section import Section, Table
from robid.studies.oliveira2019.identification import (
    BenchChannel,
    Measuring,
    channels_of,
    decides_of,
    frequencies,
    quantile,
    response_of,
    simulation_of,
)
from robid.studies.oliveira2019.judging import CONFIDENCE, Identified, from_content
from robid.studies.settings.parts import PlantsCase
from robid.studies.study import Asked, Part, PartFound
from robid.studies.tasks import Content, Results, Task, in_chunks

COVERAGE = "coverage_97"
_ASKED = Asked(0.94, 0.99)
_SEED = ("seed",)


@dataclass(frozen=True)
class Chunk:
    """Some seeds of a channel, with the model of the first to start from."""

    channel: BenchChannel
    start: TransferMatrix
    seeds: range


def coverage_tasks(run: Run, case: PlantsCase, earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the tasks: some seeds of one channel each, at the structure that its own task chose."""
    tasks = []
    for index, channel in enumerate(channels_of(run, case)):
        start = _model(channel, from_content(earlier["plants"][index]))
        chosen = [start.numerator.ravel().tolist(), start.denominator.tolist(), start.delay_samples]
        for seeds in in_chunks(case.first_seed, case.seeds, case.seeds_per_task):
            decides = {**decides_of(channel), "start": chosen, "seeds": [seeds.start, seeds.stop]}
            tasks.append(Task(f"{channel.plant.name}_{seeds.start}", decides, Chunk(channel, start, seeds)))
    return tasks


def cover(chunk: Chunk) -> Content:
    """Refits some seeds of a channel, and tells which share of their bounds holds the truth."""
    channel, start = chunk.channel, chunk.start
    measuring = Measuring(channel.plant, channel.bench, channel.case)
    structure = Structure(
        poles=len(start.denominator) - 1,
        zeros=start.numerator.shape[-1] - 1,
        delay_samples=start.delay_samples,
        moving_average=start.moving_average,
        hold="zoh",
    )
    rows = []
    for seed in chunk.seeds:
        fit = fit_block(measuring.measure(seed).fitted, [0], [0], structure, start)
        rows.append(_shares(channel, measuring, Fitted(fit.model, fit.covariance_root)))
    output, magnitude, phase, error = np.array(rows).T
    return Content(
        {
            "output": Dataset(output, "1", _SEED, "Share of the validation's samples whose bounds hold the truth"),
            "magnitude": Dataset(magnitude, "1", _SEED, "The same of magnitudes inside the band"),
            "phase": Dataset(phase, "1", _SEED, "The same of phases"),
            "error": Dataset(error, "1", _SEED, "Largest relative error of magnitudes inside the band"),
        },
        {"channel": channel.plant.name},
    )


def _shares(channel: BenchChannel, measuring: Measuring, fitted: Fitted) -> tuple[float, float, float, float]:
    """Shares of true outputs, magnitudes and phases within their bounds, and the largest error of a magnitude."""
    simulated, std = simulation_of(fitted, measuring.commands[-1][:, None])
    held = _inside(simulated - measuring.answers[-1], std)
    low, high = channel.case.band_hz
    frequency_hz = frequencies(channel.case)
    frequency_hz = frequency_hz[(frequency_hz >= low) & (frequency_hz <= high)]
    response, relative, phase = response_of(fitted, frequency_hz)
    ratio = response / channel.bench.response(channel.plant, frequency_hz)
    size = np.abs(ratio) - 1
    return held, _inside(size, relative), _inside(np.angle(ratio), phase), float(np.max(np.abs(size)))


def _inside(error: FloatArray, std: FloatArray) -> float:
    moving = std > 0  # before a command comes through nothing is uncertain
    return float(np.mean(np.abs(error[moving]) <= quantile() * std[moving]))


def _model(channel: BenchChannel, known: Identified) -> TransferMatrix:
    return TransferMatrix(
        inputs=(channel.plant.name,),
        outputs=(channel.plant.name,),
        numerator=known.numerator[None, None],
        denominator=known.denominator,
        delay_samples=known.delay_samples,
        moving_average=channel.bench.moving_average,
        sampling_period_s=channel.bench.sampling_period_s,
        hold="zoh",
    )


def conclude_coverage(run: Run, case: PlantsCase, results: Results) -> PartFound | None:
    """Counts how often bounds held the truth."""
    if not len(results):
        return None
    found = {channel.plant.name: _joined(results, channel.plant.name) for channel in channels_of(run, case)}
    output, magnitude, phase = (
        np.concatenate([one[key] for one in found.values()]) for key in ("output", "magnitude", "phase")
    )
    figures = {
        COVERAGE: float(output.mean()),
        f"{COVERAGE}_magnitude": float(magnitude.mean()),
        f"{COVERAGE}_phase": float(phase.mean()),
        "coverage.seeds": float(len(output) / len(found)),
    }
    for name, one in found.items():
        figures[f"{name}.{COVERAGE}"] = float(one["output"].mean())
        figures[f"{name}.{COVERAGE}_magnitude"] = float(one["magnitude"].mean())
        figures[f"{name}.median_band_error_percent"] = 100 * float(np.median(one["error"]))
    return PartFound(figures, {COVERAGE: _ASKED}, (_section(found, figures),))


def _joined(results: Iterable[Artifact], name: str) -> dict[str, FloatArray]:
    own = [each for each in results if each.attributes["channel"] == name]
    return {
        key: np.concatenate([each.datasets[key].values for each in own])
        for key in ("output", "magnitude", "phase", "error")
    }


def _section(found: Mapping[str, Mapping[str, FloatArray]], figures: Mapping[str, float]) -> Section:
    rows = tuple(
        (
            name,
            percent(float(one["output"].mean())),
            percent(float(one["magnitude"].mean())),
            percent(float(one["phase"].mean())),
            significant(100 * float(np.median(one["error"]))),
            significant(100 * float(np.max(one["error"]))),
        )
        for name, one in found.items()
    )
    heads = ("BenchChannel", "Outputs", "Magnitudes", "Phases", "Largest error of a magnitude, median [%]", "worst [%]")
    lead = (
        f"Each channel measured with the noise of {figures['coverage.seeds']:.0f} seeds and refitted at the chosen"
        f" structure: how many of the bounds of {100 * CONFIDENCE:g} % hold the truth. Outputs are the true ones of"
        " the chirp that validates, sample by sample; magnitudes and phases those of the responses inside the band."
        " Bounds know nothing of poles that the chosen structure leaves out."
    )
    return Section("Do bounds cover?", lead, (Table(heads, rows, fit="compact"),))


COVERAGE_PART = Part("coverage", conclude_coverage, coverage_tasks, cover, field="plants")
