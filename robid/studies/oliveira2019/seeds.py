"""How often, over many seeds, bounds hold the truth, and the order of random plants is found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete, dlsim, zpk2ss

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.artifacts.artifact import Artifact, Dataset
from robid.artifacts.kinds import from_datasets
from robid.models.external.fit.choice import choose_structure
from robid.models.external.fit.data import Shot
from robid.models.external.fit.graphs import Fitted
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.output_error import fit_block
from robid.models.external.fit.problem import Structure
from robid.models.external.fit.transfer import TransferMatrix
from robid.pipeline.graph import Run
from robid.report.numbers import percent, significant
from robid.report.section import Section, Table
from robid.signals.waveforms import chirp
from robid.studies.oliveira2019.bench import (
    BenchChannel,
    Measuring,
    channels_of,
    decides_of,
    frequencies,
    quantile,
    response_of,
    simulation_of,
)
from robid.studies.oliveira2019.judging import CONFIDENCE, Identified
from robid.studies.page import Asked, PartFound, table
from robid.studies.settings.parts import PlantsCase, SyntheticCase
from robid.studies.study import Content, Part, Results, Task, in_chunks

SAMPLING_PERIOD_S = 0.012
N_SAMPLE = 8192
BAND_HZ = (0.05, 6.0)
SIGNAL_TO_NOISE_DB = 40.0
APART = 0.2  # of the larger magnitude
MOST_POLES = 5
_INSIDE = (2.0, 0.8)  # times the band's ends, poles and zeros lie


@dataclass(frozen=True)
class Plant:
    """A random plant."""

    poles: ComplexArray  # (n_pole,) poles [rad/s]
    zeros: ComplexArray  # (n_zero,) zeros [rad/s]
    gain: float  # Static gain


def draw_plant(rng: np.random.Generator) -> Plant:
    """Draws a stable plant of order 1 to 5 with fewer zeros than poles, all of them well apart."""
    n_pole = int(rng.integers(1, MOST_POLES + 1))
    n_zero = int(rng.integers(0, n_pole))
    while True:
        poles, zeros = _roots(rng, n_pole), _roots(rng, n_zero)
        mirrored = rng.random() < 0.25
        zeros = np.where(zeros.imag == 0, -zeros, zeros) if mirrored else zeros
        if _are_apart(np.concatenate([poles, zeros])):
            return Plant(poles, zeros, float(np.exp(rng.uniform(-1, 1))))


def _roots(rng: np.random.Generator, count: int) -> ComplexArray:
    """Draws stable roots inside the band, in pairs about as often as alone."""
    low, high = 2 * np.pi * BAND_HZ[0] * _INSIDE[0], 2 * np.pi * BAND_HZ[1] * _INSIDE[1]
    found: list[complex] = []
    while len(found) < count:
        size = float(np.exp(rng.uniform(np.log(low), np.log(high))))
        if count - len(found) >= 2 and rng.random() < 0.5:
            damping = rng.uniform(0.1, 0.9)
            root = size * complex(-damping, np.sqrt(1 - damping**2))
            found += [root, root.conjugate()]
        else:
            found.append(complex(-size))
    return np.array(found, dtype=complex)


def _are_apart(roots: ComplexArray) -> bool:
    distance = np.abs(roots[:, None] - roots)
    size = np.maximum(np.abs(roots)[:, None], np.abs(roots))
    np.fill_diagonal(distance, np.inf)
    return bool((distance >= APART * size).all())


def simulate_plant(plant: Plant, rng: np.random.Generator) -> Shot:
    """Answers a chirp, with white noise; the truth's simulation shares no code with the fit's."""
    command = chirp(BAND_HZ[0] * SAMPLING_PERIOD_S, BAND_HZ[1] * SAMPLING_PERIOD_S, N_SAMPLE)[:, None]
    above = plant.gain * np.real(np.prod(-plant.poles) / np.prod(-plant.zeros))
    discrete = cont2discrete(zpk2ss(plant.zeros, plant.poles, above), SAMPLING_PERIOD_S)
    answer: FloatArray = dlsim(discrete, command)[1]
    noise = answer.std() * 10 ** (-SIGNAL_TO_NOISE_DB / 20)
    measured = answer + noise * rng.standard_normal(answer.shape)
    return Shot(command, measured, "rest", None, 1, SAMPLING_PERIOD_S, "synthetic", offset=False)


def find_orders(seeds: Sequence[int]) -> tuple[IntArray, IntArray]:
    """Draws a plant by each seed, simulates it and lets the evidence choose its order, its delay known.

    Returns:
        Numbers of poles and zeros (n_seed, 2) of each plant, and those that were chosen.
    """
    true, found = [], []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        plant = draw_plant(rng)
        shot = simulate_plant(plant, rng)
        choice = choose_structure([shot], [0], [0], ExternalOptions(delay_samples=0, max_poles=MOST_POLES), hold="zoh")
        true.append((len(plant.poles), len(plant.zeros)))
        found.append((choice.structure.poles, choice.structure.zeros))
    return np.array(true), np.array(found)


def _synthetic_tasks(_run: Run, case: SyntheticCase, _earlier: Mapping[str, Results]) -> list[Task]:
    chunks = in_chunks(case.first_seed, case.plants, case.plants_per_task)
    return [Task(f"plants_{seeds.start}", {"seeds": [seeds.start, seeds.stop]}, (seeds,)) for seeds in chunks]


def find(seeds: range) -> Content:
    """Identifies some random plants."""
    true, found = find_orders(seeds)
    axes = ("plant", "count")
    return Content(
        {
            "true": Dataset(true, "1", axes, "Numbers of poles and zeros"),
            "found": Dataset(found, "1", axes, "What the evidence chose"),
        }
    )


def _conclude_synthetic(_run: Run, _case: SyntheticCase, results: Results) -> PartFound:
    true, found = (np.concatenate([one.datasets[key].values for one in results]) for key in ("true", "found"))
    right = true[:, 0] == found[:, 0]
    figures = {
        "synthetic.plants": float(len(true)),
        "synthetic.order_correct_share": float(right.mean()),
        "synthetic.structure_correct_share": float((true == found).all(axis=1).mean()),
    }
    orders = range(1, MOST_POLES + 1)
    rows = tuple(
        (str(order), *(str(int(((true[:, 0] == order) & (found[:, 0] == other)).sum())) for other in orders))
        for order in orders
    )
    shown = Table(
        ("True poles", *(f"{other} found" for other in orders)), rows, caption="Number of plants.", fit="compact"
    )
    lead = (
        f"Plants with random poles and zeros inside the excited band, at least 20 % apart, measured with"
        f" {SIGNAL_TO_NOISE_DB:g} dB; the delay is known, the evidence chooses the numbers of poles and zeros."
    )
    return PartFound(
        figures, {"synthetic.order_correct_share": Asked(lower=0.95)}, (Section("Random plants", lead, (shown,)),)
    )


RANDOM_PLANTS = Part("synthetic", _conclude_synthetic, _synthetic_tasks, find)


COVERAGE = "coverage_97"
_ASKED = Asked(0.94, 0.99)
_SEED = ("seed",)


def coverage_tasks(run: Run, case: PlantsCase, earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the tasks: some seeds of one channel each, at the structure that its own task chose."""
    tasks = []
    for index, channel in enumerate(channels_of(run, case)):
        start = _model(channel, from_datasets(Identified, earlier["plants"][index]))
        chosen = [start.numerator.ravel().tolist(), start.denominator.tolist(), start.delay_samples]
        for seeds in in_chunks(case.first_seed, case.seeds, case.seeds_per_task):
            decides = {**decides_of(channel), "start": chosen, "seeds": [seeds.start, seeds.stop]}
            tasks.append(Task(f"{channel.plant.name}_{seeds.start}", decides, (channel, start, seeds)))
    return tasks


def cover(channel: BenchChannel, start: TransferMatrix, seeds: range) -> Content:
    """Refits some seeds of a channel from the model of the first, and tells the share of bounds that hold the truth."""
    measuring = Measuring(channel)
    structure = Structure(
        poles=len(start.denominator) - 1,
        zeros=start.numerator.shape[-1] - 1,
        delay_samples=start.delay_samples,
        moving_average=start.moving_average,
        hold="zoh",
    )
    rows = []
    for seed in seeds:
        fit = fit_block(measuring.measure(seed)[:-1], [0], [0], structure, start)
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


def _conclude_coverage(run: Run, case: PlantsCase, results: Results) -> PartFound | None:
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
    columns = (
        ("Channel", lambda name: name),
        ("Outputs", lambda name: percent(float(found[name]["output"].mean()))),
        ("Magnitudes", lambda name: percent(float(found[name]["magnitude"].mean()))),
        ("Phases", lambda name: percent(float(found[name]["phase"].mean()))),
        (
            "Largest error of a magnitude, median [%]",
            lambda name: significant(100 * float(np.median(found[name]["error"]))),
        ),
        ("worst [%]", lambda name: significant(100 * float(np.max(found[name]["error"])))),
    )
    lead = (
        f"Each channel measured with the noise of {figures['coverage.seeds']:.0f} seeds and refitted at the chosen"
        f" structure: how many of the bounds of {100 * CONFIDENCE:g} % hold the truth. Outputs are the true ones of"
        " the chirp that validates, sample by sample; magnitudes and phases those of the responses inside the band."
        " Bounds know nothing of poles that the chosen structure leaves out."
    )
    return Section("Do bounds cover?", lead, (table(columns, found, fit="compact"),))


COVERAGE_PART = Part("coverage", _conclude_coverage, coverage_tasks, cover, field="plants")
