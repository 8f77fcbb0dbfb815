"""The paper's channels: Tables 1 to 4 and the kinds of its Figs 5 to 8, 10 and 11, beside ours."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.pipeline.graph import Run
from robid.studies.oliveira2019.plants.bench import Bench, Plant, bench_of, plants_of
from robid.studies.oliveira2019.plants.identified import Identified, from_content
from robid.studies.oliveira2019.plants.judging import RootError, band_errors, judge_roots, undershoot
from robid.studies.oliveira2019.plants.pictures import picture_sections
from robid.studies.oliveira2019.plants.tables import table_section
from robid.studies.oliveira2019.section import study_of
from robid.studies.paper import paper_figures
from robid.studies.part import Asked, PartFound
from robid.studies.settings.oliveira2019 import PlantsCase

_LEAST_NRMSE = 0.99
_ASKED = {
    "max_band_error_percent": Asked(upper=1.0),
    "max_band_error_degrees": Asked(upper=1.0),
    "max_pole_error_percent": Asked(upper=2.0),
    "poles_judged": Asked(lower=3),
    "max_pole_deviations": Asked(upper=4.0),
}


def conclude_plants(run: Run, results: Sequence[Artifact]) -> PartFound | None:
    """Turns the identified channels into figures, tables beside the paper's, and what is asked of them."""
    study = study_of(run.loaded)
    case = study.plants
    if case is None:
        return None
    paper = paper_figures(study.paper, run.loaded)
    bench, plants = bench_of(paper, case), plants_of(paper)
    found = {plant.name: from_content(one) for plant, one in zip(plants, results, strict=True)}
    errors = {plant.name: root_errors(plant, found[plant.name], case) for plant in plants}
    figures = plant_figures(plants, found, bench, case) | _root_figures(errors)
    asked = {f"{plant.name}.nrmse": Asked(lower=_LEAST_NRMSE) for plant in plants} | _ASKED
    sections = (table_section(plants, found, errors, paper, bench), *picture_sections(plants, found, bench, case))
    return PartFound(figures, asked, sections)


def root_errors(plant: Plant, found: Identified, case: PlantsCase) -> list[RootError]:
    """Judges the poles and zeros of a channel that lie inside the band and are said to be well known."""
    low, high = (2 * np.pi * end for end in case.band_hz)
    return judge_roots(list(found.roots), plant.numerator, plant.denominator, (low, high))


def plant_figures(
    plants: Sequence[Plant], found: Mapping[str, Identified], bench: Bench, case: PlantsCase
) -> dict[str, float]:
    """Returns each channel's measures, and the largest errors of responses inside the band."""
    figures: dict[str, float] = {}
    off = []
    for plant in plants:
        one = found[plant.name]
        inside = (one.frequency_hz >= case.band_hz[0]) & (one.frequency_hz <= case.band_hz[1])
        band_hz = one.frequency_hz[inside]
        off.append(band_errors(one.response[inside], bench.response(plant, band_hz)))
        between = band_errors(one.continuous[inside], bench.continuous(plant, band_hz))
        own = {
            "nrmse": one.quality.nrmse,
            "r2": one.quality.r2,
            "fpe": one.quality.fpe,
            "poles": float(len(one.denominator) - 1),
            "zeros": float(len(one.numerator) - 1),
            "delay_samples": float(one.delay_samples),
            "band_error_percent": off[-1][0],
            "band_error_degrees": off[-1][1],
            "continuous_error_percent": between[0],
            "continuous_error_degrees": between[1],
        }
        figures |= {f"{plant.name}.{name}": value for name, value in own.items()} | _undershoot(plant, one, bench)
    figures["max_band_error_percent"] = max(percent for percent, _ in off)
    figures["max_band_error_degrees"] = max(degrees for _, degrees in off)
    return figures


def _undershoot(plant: Plant, found: Identified, bench: Bench) -> dict[str, float]:
    """How far a step response is below zero at the samples, where estimate or truth says so."""
    true = bench.step(plant, len(found.step_s))
    index, depth = undershoot(found.step)
    _, true_depth = undershoot(true)
    if max(depth, true_depth) == 0:
        return {}
    return {
        f"{plant.name}.undershoot": depth,
        f"{plant.name}.undershoot_std": float(found.step_std[index]),
        f"{plant.name}.undershoot_true": true_depth,
    }


def _root_figures(errors: Mapping[str, list[RootError]]) -> dict[str, float]:
    every = [error for one in errors.values() for error in one]
    return {
        "poles_judged": float(len(every)),
        "max_pole_error_percent": max((error.percent for error in every), default=np.nan),
        "max_pole_deviations": max((error.deviations for error in every), default=np.nan),
    }
