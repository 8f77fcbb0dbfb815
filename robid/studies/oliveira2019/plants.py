"""The paper's channels: figures and what is asked of them, its Tables 1 to 4 beside ours."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robid.pipeline.graph import Run
from robid.report.numbers import MINUS, MISSING, percent, significant
from robid.report.section import Notes, Row, Section, Table
from robid.studies.experiments import paper_figures
from robid.studies.oliveira2019.bench import ROTATIONS, Bench, Plant, bench_of, plants_of
from robid.studies.oliveira2019.identification import identify, plants_tasks
from robid.studies.oliveira2019.judging import (
    Identified,
    RootError,
    band_errors,
    from_content,
    judge_roots,
    root_values,
    undershoot,
    undetermined_roots,
)
from robid.studies.oliveira2019.pictures import picture_sections
from robid.studies.settings.parts import PlantsCase
from robid.studies.study import Asked, Part, PartFound
from robid.studies.tasks import Results

_LEAST_NRMSE = 0.99
_ASKED = {
    "max_band_error_percent": Asked(upper=1.0),
    "max_band_error_degrees": Asked(upper=1.0),
    "max_pole_error_percent": Asked(upper=2.0),
    "poles_judged": Asked(lower=3),
    "max_pole_deviations": Asked(upper=4.0),
}


def conclude_plants(run: Run, case: PlantsCase, results: Results) -> PartFound:
    """Turns the identified channels into figures, tables beside the paper's, and what is asked of them."""
    paper = paper_figures(run.loaded)
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


_DIGITS = 4
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def table_section(
    plants: Sequence[Plant],
    found: Mapping[str, Identified],
    errors: Mapping[str, list[RootError]],
    paper: Mapping[str, Any],
    bench: Bench,
) -> Section:
    """Returns the tables of all channels."""
    lead = (
        "The functions that the paper identified are the plants here, so its column is also the truth: simulated with"
        f" a transport delay of {bench.delay_samples} samples and a moving average of {bench.moving_average}, measured"
        f" {bench.repeats} times with noise of {bench.noise_resolutions:g} resolution, and rounded to it. The average"
        " is known, the delay is not. A structure is chosen by evidence, of each channel on its own."
    )
    tables = (_amplitudes(plants, paper), _functions(plants, found), _roots(plants, found, errors))
    nyquist = math.pi / bench.sampling_period_s
    told = tuple(
        sentence
        for plant in plants
        for sentence in (
            *found[plant.name].undetermined,
            *(
                f"{plant.name}: {hidden}"
                for hidden in undetermined_roots(found[plant.name].roots, plant.numerator, plant.denominator, nyquist)
            ),
        )
    )
    notes = (Notes(told),) if told else ()
    return Section("The paper's channels: Tables 1 to 4", lead, (*tables, *notes, _measures(plants, found, paper)))


def _amplitudes(plants: Sequence[Plant], paper: Mapping[str, Any]) -> Table:
    rows = tuple(
        (f"{plant.name} [{_printed_unit(plant)}]", *(f"{size:g}" for size in paper["amplitudes"][plant.name]))
        for plant in plants
    )
    heads = ("Channel", *(f"0.01 to {high:g} Hz" for high in paper["high_hz"]))
    caption = "Largest command of each chirp, the paper's and ours; it falls along a straight line to zero."
    return Table(heads, rows, title="Table 1: amplitudes", caption=caption, fit="compact")


def _functions(plants: Sequence[Plant], found: Mapping[str, Identified]) -> Table:
    rows = []
    for plant in plants:
        one = found[plant.name]
        rows.append(
            (
                plant.name,
                _fraction(plant.numerator, plant.denominator),
                _fraction(one.numerator.tolist(), one.denominator.tolist()),
                str(one.delay_samples),
                one.reason,
            )
        )
    heads = ("Channel", "Paper, and truth", "Ours", "Delay [samples]", "Chosen")
    return Table(tuple(heads), tuple(rows), title="Table 3: transfer functions", prose=True)


def _roots(plants: Sequence[Plant], found: Mapping[str, Identified], errors: Mapping[str, list[RootError]]) -> Table:
    rows: list[Row] = []
    for plant in plants:
        group = f"Channel {plant.name}: true {_true_roots(plant)}"
        judged = {error.name: error for error in errors[plant.name]}
        for root in found[plant.name].roots:
            error = judged.get(root.name)
            cells = (
                root.name,
                significant(root.value, _DIGITS),
                percent(root.relative_std),
                MISSING if error is None else significant(error.truth, _DIGITS),
                MISSING if error is None else percent(error.percent / 100),
                MISSING if error is None else significant(error.deviations, 2),
            )
            rows.append(Row(cells, faint=error is None, group=group))
    heads = ("Number", "Ours", "Deviation", "Truth", "Off", "Off, in deviations")
    caption = (
        "Rates of real poles and zeros [rad/s], positive in the left half plane; natural frequency [rad/s] and damping"
        " of pairs. Those inside the band whose predicted deviation is below 0.5 % are judged; the others are faint."
    )
    return Table(heads, tuple(rows), title="Poles and zeros", caption=caption, fit="tall")


def _measures(plants: Sequence[Plant], found: Mapping[str, Identified], paper: Mapping[str, Any]) -> Table:
    rows = []
    for plant in plants:
        printed, own = paper["table_4"][plant.name], found[plant.name].quality
        rows.append(
            (
                plant.name,
                f"{printed['r2']:.3f}",
                f"{own.r2:.6f}",
                f"{printed['nrmse']:.3f}",
                f"{own.nrmse:.4f}",
                f"{printed['fpe']:g}",
                significant(own.fpe),
            )
        )
    heads = ("Channel", "R², paper", "Ours", "NRMSE, paper", "Ours", "FPE, paper", "Ours")
    caption = (
        "On the chirp that was not fitted, as in Table 2: R² is 1 less the residual's share of the variance, NRMSE 1"
        " less that of the deviation, FPE the residual's variance times (1 + d/N)/(1 - d/N) [mm² or degrees²]."
        " The paper's are of its robot, ours of plants without anything unmodelled."
    )
    return Table(tuple(heads), tuple(rows), title="Tables 2 and 4: validation", caption=caption, fit="compact")


def _printed_unit(plant: Plant) -> str:
    return "degrees" if plant.name in ROTATIONS else "mm"


def _true_roots(plant: Plant) -> str:
    return "; ".join(
        f"{word} {', '.join(_one_root(what, value) for what, _, value in root_values(polynomial))}"
        for word, polynomial in (("zeros", plant.numerator), ("poles", plant.denominator))
    )


def _one_root(what: str, value: float) -> str:
    number = significant(value, _DIGITS)
    return number if what == "rate" else f"{what} {number}"


def _fraction(numerator: Sequence[float], denominator: Sequence[float]) -> str:
    return f"({_polynomial(numerator)}) / ({_polynomial(denominator)})"


def _polynomial(coefficients: Sequence[float]) -> str:
    """Writes a polynomial of s, as in `24.08 s + 1362`."""
    terms: list[str] = []
    degree = len(coefficients) - 1
    for place, value in enumerate(coefficients):
        power = degree - place
        variable = "" if power == 0 else ("s" if power == 1 else "s" + str(power).translate(_SUPERSCRIPTS))
        size = significant(abs(value), _DIGITS)
        written = variable if variable and abs(value) == 1 else f"{size} {variable}".strip()
        sign = (f"{MINUS}" if value < 0 else "") if not terms else (f" {MINUS} " if value < 0 else " + ")
        terms.append(sign + written)
    return "".join(terms)


PLANTS = Part("plants", conclude_plants, plants_tasks, identify)
