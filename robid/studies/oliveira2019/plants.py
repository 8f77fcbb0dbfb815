"""The paper's channels: figures and what is asked of them, its Tables 1 to 4 and the kinds of its figures with ours."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.artifacts.kinds import from_datasets
from robid.pipeline.graph import Run
from robid.report.numbers import MINUS, MISSING, percent, significant
from robid.report.section import Beside, Curve, Figure, Notes, Row, Section, Table
from robid.studies.experiments import paper_figures
from robid.studies.oliveira2019 import judging
from robid.studies.oliveira2019.bench import ROTATIONS, Bench, Plant, bench_of, identify, plants_of, plants_tasks
from robid.studies.page import Asked, PartFound, curves, table
from robid.studies.settings.parts import PlantsCase
from robid.studies.study import Part, Results

Channels: TypeAlias = Sequence[tuple[Plant, judging.Identified]]  # Each true channel with what was identified of it

_ASKED = {
    "max_band_error_percent": Asked(upper=1.0),
    "max_band_error_degrees": Asked(upper=1.0),
    "max_pole_error_percent": Asked(upper=2.0),
    "poles_judged": Asked(lower=3),
    "max_pole_deviations": Asked(upper=4.0),
}
_LEAST_NRMSE = 0.99
_WINDOW_S = (20.0, 26.0)
_NEAR_RAD_S = 120.0
_UNDERSHOOT = ("B", "C")
_HEIGHT = 280
_MOST_POINTS, _MOST_LINES = 1200, 700
_DIGITS = 4
_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")


def _conclude_plants(run: Run, case: PlantsCase, results: Results) -> PartFound:
    paper = paper_figures(run.loaded)
    bench, plants = bench_of(paper, case), plants_of(paper)
    channels = [(plant, from_datasets(judging.Identified, one)) for plant, one in zip(plants, results, strict=True)]
    low, high = (2 * np.pi * end for end in case.band_hz)
    errors = {
        plant.name: judging.judge_roots(list(found.roots), plant.numerator, plant.denominator, (low, high))
        for plant, found in channels
    }
    every = [error for one in errors.values() for error in one]
    figures = plant_figures(channels, bench, case) | {
        "poles_judged": float(len(every)),
        "max_pole_error_percent": max((error.percent for error in every), default=np.nan),
        "max_pole_deviations": max((error.deviations for error in every), default=np.nan),
    }
    asked = {f"{plant.name}.nrmse": Asked(lower=_LEAST_NRMSE) for plant in plants} | _ASKED
    sections = (
        _table_section(channels, errors, paper, bench),
        _excitation(plants[0], bench, case),
        _undershoots([pair for pair in channels if pair[0].name in _UNDERSHOOT], bench),
        _validation(channels, bench),
        _frequency(channels, bench),
    )
    return PartFound(figures, asked, sections)


def plant_figures(channels: Channels, bench: Bench, case: PlantsCase) -> dict[str, float]:
    """Returns each channel's measures, and the largest errors of responses inside the band."""
    figures: dict[str, float] = {}
    off = []
    for plant, one in channels:
        inside = (one.frequency_hz >= case.band_hz[0]) & (one.frequency_hz <= case.band_hz[1])
        band_hz = one.frequency_hz[inside]
        off.append(judging.band_errors(one.response[inside], bench.response(plant, band_hz)))
        between = judging.band_errors(one.continuous[inside], bench.continuous(plant, band_hz))
        own = {
            **{key: getattr(one.quality, key) for key in ("nrmse", "r2", "fpe")},
            "poles": float(len(one.denominator) - 1),
            "zeros": float(len(one.numerator) - 1),
            "delay_samples": float(one.delay_samples),
            "band_error_percent": off[-1][0],
            "band_error_degrees": off[-1][1],
            "continuous_error_percent": between[0],
            "continuous_error_degrees": between[1],
        }
        # How far a step response is below zero at the samples, where estimate or truth says so.
        index, depth = judging.undershoot(one.step)
        _, true_depth = judging.undershoot(bench.step(plant, len(one.step_s)))
        if max(depth, true_depth) > 0:
            own |= {"undershoot": depth, "undershoot_std": float(one.step_std[index]), "undershoot_true": true_depth}
        figures |= {f"{plant.name}.{name}": value for name, value in own.items()}
    figures["max_band_error_percent"], figures["max_band_error_degrees"] = map(max, zip(*off, strict=True))
    return figures


def _table_section(
    channels: Channels, errors: Mapping[str, list[judging.RootError]], paper: Mapping[str, Any], bench: Bench
) -> Section:
    lead = (
        "The functions that the paper identified are the plants here, so its column is also the truth: simulated with"
        f" a transport delay of {bench.delay_samples} samples and a moving average of {bench.moving_average}, measured"
        f" {bench.repeats} times with noise of {bench.noise_resolutions:g} resolution, and rounded to it. The average"
        " is known, the delay is not. A structure is chosen by evidence, of each channel on its own."
    )
    told: list[str] = []
    for plant, one in channels:
        nyquist = math.pi / bench.sampling_period_s
        hidden = judging.undetermined_roots(one.roots, plant.numerator, plant.denominator, nyquist)
        told += [*one.undetermined, *(f"{plant.name}: {sentence}" for sentence in hidden)]
    printed = {"rad": "degrees", "m": "mm"}
    rows = tuple(
        (f"{plant.name} [{printed[plant.unit]}]", *(f"{size:g}" for size in paper["amplitudes"][plant.name]))
        for plant, _ in channels
    )
    heads = ("Channel", *(f"0.01 to {high:g} Hz" for high in paper["high_hz"]))
    caption = "Largest command of each chirp, the paper's and ours; it falls along a straight line to zero."
    tables = (
        Table(heads, rows, title="Table 1: amplitudes", caption=caption, fit="compact"),
        table(_FUNCTIONS, channels, title="Table 3: transfer functions", prose=True),
        _root_table(channels, errors),
    )
    notes = (Notes(tuple(told)),) if told else ()
    return Section("The paper's channels: Tables 1 to 4", lead, (*tables, *notes, _measures(channels, paper)))


_FUNCTIONS = (
    ("Channel", lambda pair: pair[0].name),
    ("Paper, and truth", lambda pair: f"({_polynomial(pair[0].numerator)}) / ({_polynomial(pair[0].denominator)})"),
    ("Ours", lambda pair: f"({_polynomial(pair[1].numerator)}) / ({_polynomial(pair[1].denominator)})"),
    ("Delay [samples]", lambda pair: str(pair[1].delay_samples)),
    ("Chosen", lambda pair: pair[1].reason),
)


def _root_table(channels: Channels, errors: Mapping[str, list[judging.RootError]]) -> Table:
    rows: list[Row] = []
    for plant, found in channels:
        judged, said = {error.name: error for error in errors[plant.name]}, []
        for word, polynomial in (("zeros", plant.numerator), ("poles", plant.denominator)):
            values = [(what, significant(value, _DIGITS)) for what, _, value in judging.root_values(polynomial)]
            said.append(f"{word} {', '.join(value if what == 'rate' else f'{what} {value}' for what, value in values)}")
        for root in found.roots:
            cells = [root.name, significant(root.value, _DIGITS), percent(root.relative_std)]
            if (error := judged.get(root.name)) is None:
                cells += [MISSING] * 3
            else:
                cells += [significant(error.truth, _DIGITS), percent(error.percent / 100)]
                cells += [significant(error.deviations, 2)]
            rows.append(Row(tuple(cells), faint=error is None, group=f"Channel {plant.name}: true {'; '.join(said)}"))
    heads = ("Number", "Ours", "Deviation", "Truth", "Off", "Off, in deviations")
    caption = (
        "Rates of real poles and zeros [rad/s], positive in the left half plane; natural frequency [rad/s] and damping"
        " of pairs. Those inside the band whose predicted deviation is below 0.5 % are judged; the others are faint."
    )
    return Table(heads, tuple(rows), title="Poles and zeros", caption=caption, fit="tall")


def _measures(channels: Channels, paper: Mapping[str, Any]) -> Table:
    printed = paper["table_4"]
    columns = (
        ("Channel", lambda pair: pair[0].name),
        ("R², paper", lambda pair: f"{printed[pair[0].name]['r2']:.3f}"),
        ("Ours", lambda pair: f"{pair[1].quality.r2:.6f}"),
        ("NRMSE, paper", lambda pair: f"{printed[pair[0].name]['nrmse']:.3f}"),
        ("Ours", lambda pair: f"{pair[1].quality.nrmse:.4f}"),
        ("FPE, paper", lambda pair: f"{printed[pair[0].name]['fpe']:g}"),
        ("Ours", lambda pair: significant(pair[1].quality.fpe)),
    )
    caption = (
        "On the chirp that was not fitted, as in Table 2: R² is 1 less the residual's share of the variance, NRMSE 1"
        " less that of the deviation, FPE the residual's variance times (1 + d/N)/(1 - d/N) [mm² or degrees²]."
        " The paper's are of its robot, ours of plants without anything unmodelled."
    )
    return table(columns, channels, title="Tables 2 and 4: validation", caption=caption, fit="compact")


def _polynomial(coefficients: Iterable[float]) -> str:
    """Writes a polynomial of s, as in `24.08 s + 1362`."""
    terms, values = list[str](), np.asarray(coefficients, float).tolist()
    for power, value in zip(range(len(values) - 1, -1, -1), values, strict=True):
        variable = "" if power == 0 else ("s" if power == 1 else "s" + str(power).translate(_SUPERSCRIPTS))
        size = significant(abs(value), _DIGITS)
        written = variable if variable and abs(value) == 1 else f"{size} {variable}".strip()
        sign = (f"{MINUS}" if value < 0 else "") if not terms else (f" {MINUS} " if value < 0 else " + ")
        terms.append(sign + written)
    return "".join(terms)


def thinned(x: FloatArray, series: Mapping[str, FloatArray]) -> tuple[Curve, ...]:
    """Returns curves over x (n_point,), thinned evenly where they have many points."""
    every = max(1, int(np.ceil(len(x) / _MOST_POINTS)))
    return curves(x[::every], {name: values[::every] for name, values in series.items()})


def _over_time(title: str, unit: str, time_s: FloatArray, signals: Mapping[str, FloatArray]) -> Figure:
    axes = "Time [s]", f"Position [{unit}]"
    return Figure(title, *axes, thinned(time_s, signals), log_x=False, log_y=False, height=_HEIGHT)


def _excitation(plant: Plant, bench: Bench, case: PlantsCase) -> Section:
    high = max(case.fit_hz)
    command = bench.command(plant, high)
    measured = bench.measure(plant, bench.answer(plant, command), np.random.default_rng(case.first_seed))[0]
    time = np.arange(bench.n_sample) * bench.sampling_period_s
    signals = {"in": command, "out": measured}
    frequency = np.fft.rfftfreq(len(time), bench.sampling_period_s)[1:]
    # On a logarithmic axis the many fast components are thinned, the few slow ones are not.
    kept = np.unique(np.geomspace(1, len(frequency), _MOST_LINES).astype(int)) - 1
    amplitudes = {name: (2 / len(time) * np.abs(np.fft.rfft(values))[1:])[kept] for name, values in signals.items()}
    floor = curves(frequency[[0, -1]], {"resolution": np.full(2, plant.resolution)})
    spectra = (*curves(frequency[kept], amplitudes), *floor)
    figures = (
        _over_time(f"Fig. 5a: chirp to {high:g} Hz, channel {plant.name}", plant.unit, time, signals),
        Figure("Fig. 5b: spectra", "Frequency [Hz]", f"Amplitude [{plant.unit}]", spectra, height=_HEIGHT),
    )
    return Section("Excitation: Fig. 5", "One of the repeats.", (Beside(figures, columns=2),))


def _undershoots(channels: Channels, bench: Bench) -> Section:
    parts: list[Figure] = []
    for plant, one in channels:
        sets = {"true poles": plant.denominator, "true zeros": plant.numerator}
        sets |= {"our poles": tuple(one.denominator.tolist()), "our zeros": tuple(one.numerator.tolist())}
        signals = {"true": bench.step(plant, len(one.step_s)), "ours": one.step}
        for sign, factor in (("+", 3.0), (chr(0x2212), -3.0)):
            signals[f"ours {sign} 3 deviations"] = one.step + factor * one.step_std
        drawn: list[Curve] = []
        for name, polynomial in sets.items():
            roots = np.asarray(np.roots(polynomial), complex)
            near = roots[np.abs(roots) <= _NEAR_RAD_S]
            drawn += curves(near.real, {name: near.imag}, points=True)
        title, axes = f"Fig. 6a: channel {plant.name}", ("Real part [rad/s]", "Imaginary part [rad/s]")
        parts.append(Figure(title, *axes, tuple(drawn), log_x=False, log_y=False))
        parts.append(_over_time(f"Fig. 6b: step of channel {plant.name}", "1", one.step_s, signals))
    lead = (
        f"Poles and zeros within {_NEAR_RAD_S:g} rad/s. Step responses are shown at the samples, where the data can"
        " tell them; between these the fast poles of B and C, which no data at this rate determine, say how deep the"
        " undershoot goes."
    )
    return Section("Undershoot of B and C: Fig. 6", lead, (Beside(tuple(parts), columns=2),))


def _validation(channels: Channels, bench: Bench) -> Section:
    figures = []
    for plant, one in channels:
        time = np.arange(len(one.measured)) * bench.sampling_period_s
        inside = (time >= _WINDOW_S[0]) & (time <= _WINDOW_S[1])
        measured, model, bound = (each[inside] for each in (one.measured, one.simulated, one.bound))
        shown = {"measured": measured, "model": model, "lower": model - bound, "upper": model + bound}
        title = f"Fig. {7 if plant.name in ROTATIONS else 8}: channel {plant.name}"
        figures.append(_over_time(title, plant.unit, time[inside], shown))
    lead = (
        f"Six seconds of the chirp that was not fitted, with the bounds of {100 * judging.CONFIDENCE:g} % of what the"
        " model says; they are narrower than the lines."
    )
    return Section("Validation: Figs 7 and 8", lead, (Beside(tuple(figures), columns=2),))


_WRITTEN: Mapping[str, Callable[[ComplexArray], FloatArray]] = {
    "Magnitude [dB]": lambda values: 20 * np.log10(np.maximum(np.abs(values), 1e-12)),
    "Phase [degrees]": lambda values: np.degrees(np.unwrap(np.angle(values))),
}


def _frequency(channels: Channels, bench: Bench) -> Section:
    parts: list[Figure] = []
    for plant, one in channels:
        responses = (
            ("empirical", one.etfe_hz, one.etfe),
            ("model", one.frequency_hz, one.response),
            ("true", one.frequency_hz, bench.response(plant, one.frequency_hz)),
        )
        title = f"Fig. {10 if plant.name in ROTATIONS else 11}: channel {plant.name}"
        for name, (y_title, write) in zip((title, f"{title}, phase"), _WRITTEN.items(), strict=True):
            drawn = tuple(one for word, hz, values in responses for one in thinned(hz, {word: write(values)}))
            parts.append(Figure(name, "Frequency [Hz]", y_title, drawn, log_y=False, height=_HEIGHT))
    lead = "From samples to samples: with hold, moving average and delay, which the paper's leave out."
    return Section("Frequency responses: Figs 10 and 11", lead, (Beside(tuple(parts), columns=2),))


PLANTS = Part("plants", _conclude_plants, plants_tasks, identify)
