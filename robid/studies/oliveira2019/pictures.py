"""The kinds of the paper's Figs 5 to 8, 10 and 11: chirps, steps, responses, poles and zeros."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.report.section import Beside, Curve, Figure, Part, Section
from robid.studies.oliveira2019.bench import ROTATIONS, Bench, Plant
from robid.studies.oliveira2019.judging import CONFIDENCE, Identified
from robid.studies.settings.parts import PlantsCase

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
    parts: list[Part] = []
    for plant in plants:
        one = found[plant.name]
        reference = bench.step(plant, len(one.step_s))
        sets = [
            ("true poles", _roots(plant.denominator)),
            ("true zeros", _roots(plant.numerator)),
            ("our poles", _roots(one.denominator.tolist())),
            ("our zeros", _roots(one.numerator.tolist())),
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


def _roots(polynomial: Sequence[float]) -> ComplexArray:
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
