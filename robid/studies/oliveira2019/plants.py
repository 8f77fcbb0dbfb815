"""The paper's channels: figures and what is asked of them, its Tables 1 to 4 beside ours."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.pipeline.graph import Run
from robid.report.numbers import MINUS, MISSING, percent, significant
from robid.report.section import Beside, Curve, Figure, Notes, Row, Section, Table
from robid.studies.experiments import paper_figures
from robid.studies.oliveira2019.bench import ROTATIONS, Bench, Plant, bench_of, identify, plants_of, plants_tasks
from robid.studies.oliveira2019.judging import (
    CONFIDENCE,
    Identified,
    RootError,
    band_errors,
    from_content,
    judge_roots,
    root_values,
    undershoot,
    undetermined_roots,
)
from robid.studies.page import Asked, PartFound
from robid.studies.settings.parts import PlantsCase
from robid.studies.study import Part, Results

_WINDOW_S = (20.0, 26.0)
_NEAR_RAD_S = 120.0
_UNDERSHOOT = ("B", "C")


def picture_sections(
    plants: Sequence[Plant], found: Mapping[str, Identified], bench: Bench, case: PlantsCase
) -> tuple[Section, ...]:
    """Returns the figures, each kind a section."""
    named = {plant.name: plant for plant in plants}
    return (
        _excitation(plants[0], bench, case),
        _undershoots([named[name] for name in _UNDERSHOOT if name in named], found, bench),
        _validation(plants, found, bench),
        _frequency(plants, found, bench),
    )


def _excitation(plant: Plant, bench: Bench, case: PlantsCase) -> Section:
    high = max(case.fit_hz)
    command = bench.command(plant, high)
    measured = bench.measure(plant, bench.answer(plant, command), np.random.default_rng(case.first_seed))[0]
    time = np.arange(bench.n_sample) * bench.sampling_period_s
    signals = [("in", command), ("out", measured)]
    figures = (
        over_time(f"Fig. 5a: chirp to {high:g} Hz, channel {plant.name}", plant.unit, time, signals),
        spectra("Fig. 5b: spectra", plant.unit, bench.sampling_period_s, signals, plant.resolution),
    )
    return Section("Excitation: Fig. 5", "One of the repeats.", (Beside(figures, columns=2),))


def _undershoots(plants: Sequence[Plant], found: Mapping[str, Identified], bench: Bench) -> Section:
    parts: list[Figure] = []
    for plant in plants:
        one = found[plant.name]
        reference = bench.step(plant, len(one.step_s))
        sets = [
            ("true poles", _complex_roots(plant.denominator)),
            ("true zeros", _complex_roots(plant.numerator)),
            ("our poles", _complex_roots(one.denominator.tolist())),
            ("our zeros", _complex_roots(one.numerator.tolist())),
        ]
        signals = [("true", reference), ("ours", one.step)]
        signals += [(f"ours {sign} 3 deviations", one.step + factor * one.step_std) for sign, factor in _BAND]
        parts += [
            roots(f"Fig. 6a: channel {plant.name}", sets, _NEAR_RAD_S),
            over_time(f"Fig. 6b: step of channel {plant.name}", "1", one.step_s, signals),
        ]
    lead = (
        f"Poles and zeros within {_NEAR_RAD_S:g} rad/s. Step responses are shown at the samples, where the data can"
        " tell them; between these the fast poles of B and C, which no data at this rate determine, say how deep the"
        " undershoot goes."
    )
    return Section("Undershoot of B and C: Fig. 6", lead, (Beside(tuple(parts), columns=2),))


_BAND = (("+", 3.0), (f"{chr(0x2212)}", -3.0))


def _validation(plants: Sequence[Plant], found: Mapping[str, Identified], bench: Bench) -> Section:
    figures = []
    for plant in plants:
        one = found[plant.name]
        time = np.arange(len(one.measured)) * bench.sampling_period_s
        signals = [
            ("measured", one.measured),
            ("model", one.simulated),
            ("lower", one.simulated - one.bound),
            ("upper", one.simulated + one.bound),
        ]
        number = 7 if plant.name in ROTATIONS else 8
        figures.append(stretch(f"Fig. {number}: channel {plant.name}", plant.unit, time, _WINDOW_S, signals))
    lead = (
        f"Six seconds of the chirp that was not fitted, with the bounds of {100 * CONFIDENCE:g} % of what the model"
        " says; they are narrower than the lines."
    )
    return Section("Validation: Figs 7 and 8", lead, (Beside(tuple(figures), columns=2),))


def _frequency(plants: Sequence[Plant], found: Mapping[str, Identified], bench: Bench) -> Section:
    parts: list[Figure] = []
    for plant in plants:
        one = found[plant.name]
        responses = [
            ("empirical", one.etfe_hz, one.etfe),
            ("model", one.frequency_hz, one.response),
            ("true", one.frequency_hz, bench.response(plant, one.frequency_hz)),
        ]
        number = 10 if plant.name in ROTATIONS else 11
        parts += [
            magnitude(f"Fig. {number}: channel {plant.name}", responses),
            phase(f"Fig. {number}: channel {plant.name}, phase", responses),
        ]
    lead = "From samples to samples: with hold, moving average and delay, which the paper's leave out."
    return Section("Frequency responses: Figs 10 and 11", lead, (Beside(tuple(parts), columns=2),))


def _complex_roots(polynomial: Sequence[float]) -> ComplexArray:
    return np.asarray(np.roots(polynomial), dtype=complex)


_MOST_POINTS = 1200
_HEIGHT = 280


def curve(name: str, x: FloatArray, y: FloatArray, *, points: bool = False) -> Curve:
    """Returns one curve, thinned evenly where it has many points."""
    every = max(1, int(np.ceil(len(x) / _MOST_POINTS)))
    return Curve(name, tuple(x[::every].tolist()), tuple(y[::every].tolist()), points=points)


def over_time(title: str, unit: str, time_s: FloatArray, signals: Sequence[tuple[str, FloatArray]]) -> Figure:
    """Signals over time."""
    curves = tuple(curve(name, time_s, values) for name, values in signals)
    return Figure(title, "Time [s]", f"Position [{unit}]", curves, log_x=False, log_y=False, height=_HEIGHT)


def stretch(
    title: str, unit: str, time_s: FloatArray, window_s: tuple[float, float], signals: Sequence[tuple[str, FloatArray]]
) -> Figure:
    """Signals over a stretch of time."""
    inside = (time_s >= window_s[0]) & (time_s <= window_s[1])
    return over_time(title, unit, time_s[inside], [(name, values[inside]) for name, values in signals])


def spectra(title: str, unit: str, period_s: float, signals: Sequence[tuple[str, FloatArray]], floor: float) -> Figure:
    """Amplitudes of the components of signals, and the resolution."""
    curves: list[Curve] = []
    frequency: FloatArray = np.zeros(0)
    for name, values in signals:
        frequency = np.fft.rfftfreq(len(values), period_s)[1:]
        amplitude = 2 / len(values) * np.abs(np.fft.rfft(values))[1:]
        # On a logarithmic axis the many fast components are thinned, the few slow ones are not.
        kept = np.unique(np.geomspace(1, len(frequency), 700).astype(int)) - 1
        curves.append(Curve(name, tuple(frequency[kept].tolist()), tuple(amplitude[kept].tolist())))
    ends = frequency[[0, -1]]
    curves.append(curve("resolution", ends, np.full(2, floor)))
    return Figure(title, "Frequency [Hz]", f"Amplitude [{unit}]", tuple(curves), height=_HEIGHT)


def magnitude(title: str, responses: Sequence[tuple[str, FloatArray, ComplexArray]]) -> Figure:
    """Magnitudes of responses, each with its frequencies."""
    curves = tuple(curve(name, frequency, _decibels(values)) for name, frequency, values in responses)
    return Figure(title, "Frequency [Hz]", "Magnitude [dB]", curves, log_y=False, height=_HEIGHT)


def phase(title: str, responses: Sequence[tuple[str, FloatArray, ComplexArray]]) -> Figure:
    """Phases of responses, each with its frequencies."""
    curves = tuple(
        curve(name, frequency, np.degrees(np.unwrap(np.angle(values)))) for name, frequency, values in responses
    )
    return Figure(title, "Frequency [Hz]", "Phase [degrees]", curves, log_y=False, height=_HEIGHT)


def roots(title: str, sets: Sequence[tuple[str, ComplexArray]], reach_rad_s: float) -> Figure:
    """Poles and zeros in the complex plane, within a distance of the origin."""
    curves = []
    for name, values in sets:
        near = values[np.abs(values) <= reach_rad_s]
        curves.append(Curve(name, tuple(near.real.tolist()), tuple(near.imag.tolist()), points=True))
    return Figure(title, "Real part [rad/s]", "Imaginary part [rad/s]", tuple(curves), log_x=False, log_y=False)


def _decibels(values: ComplexArray) -> FloatArray:
    return np.asarray(20 * np.log10(np.maximum(np.abs(values), 1e-12)))


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
    tables = (_amplitudes(plants, paper), _functions(plants, found), _root_table(plants, found, errors))
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


def _root_table(
    plants: Sequence[Plant], found: Mapping[str, Identified], errors: Mapping[str, list[RootError]]
) -> Table:
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
