"""How often, over many seeds, bounds hold the truth, and the order of random plants is found."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import cont2discrete, dlsim, zpk2ss

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.artifacts.artifact import Dataset
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
from robid.studies.oliveira2019 import bench
from robid.studies.oliveira2019.judging import CONFIDENCE, Identified
from robid.studies.page import Asked, PartFound, table
from robid.studies.settings.parts import PlantsCase, SyntheticCase
from robid.studies.study import Content, Part, Results, Task, in_chunks, values_of

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
        roots = np.concatenate([poles, zeros])
        size, distance = np.abs(roots), np.abs(roots[:, None] - roots)
        np.fill_diagonal(distance, np.inf)
        if (distance >= APART * np.maximum(size[:, None], size)).all():
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
    rows = []
    for seed in seeds:
        rng = np.random.default_rng(seed)
        plant = draw_plant(rng)
        options, shot = ExternalOptions(delay_samples=0, max_poles=MOST_POLES), simulate_plant(plant, rng)
        found = choose_structure([shot], [0], [0], options, hold="zoh").structure
        rows.append([(len(plant.poles), len(plant.zeros)), (found.poles, found.zeros)])
    true, chosen = np.array(rows).swapaxes(0, 1)
    return true, chosen


def _synthetic_tasks(_run: Run, case: SyntheticCase, _earlier: Mapping[str, Results]) -> list[Task]:
    chunks = in_chunks(case.first_seed, case.plants, case.plants_per_task)
    return [Task(f"plants_{seeds.start}", {"seeds": [seeds.start, seeds.stop]}, (seeds,)) for seeds in chunks]


def find(seeds: range) -> Content:
    """Identifies some random plants."""
    said = {"true": "Numbers of poles and zeros", "found": "What the evidence chose"}
    pairs = zip(said.items(), find_orders(seeds), strict=True)
    return Content({name: Dataset(values, "1", ("plant", "count"), what) for (name, what), values in pairs})


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
    heads = ("True poles", *(f"{other} found" for other in orders))
    shown = Table(heads, rows, caption="Number of plants.", fit="compact")
    lead = (
        f"Plants with random poles and zeros inside the excited band, at least 20 % apart, measured with"
        f" {SIGNAL_TO_NOISE_DB:g} dB; the delay is known, the evidence chooses the numbers of poles and zeros."
    )
    asked = {"synthetic.order_correct_share": Asked(lower=0.95)}
    return PartFound(figures, asked, (Section("Random plants", lead, (shown,)),))


RANDOM_PLANTS = Part("synthetic", _conclude_synthetic, _synthetic_tasks, find)


COVERAGE = "coverage_97"
_ASKED = Asked(0.94, 0.99)
_KEPT = {
    "output": "Share of the validation's samples whose bounds hold the truth",
    "magnitude": "The same of magnitudes inside the band",
    "phase": "The same of phases",
    "error": "Largest relative error of magnitudes inside the band",
}


def coverage_tasks(run: Run, case: PlantsCase, earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the tasks: some seeds of one channel each, at the structure that its own task chose."""
    tasks = []
    for index, channel in enumerate(bench.channels_of(run, case)):
        known, ports = from_datasets(Identified, earlier["plants"][index]), (channel.plant.name,)
        start = TransferMatrix(
            *(ports, ports, known.numerator[None, None], known.denominator, known.delay_samples),
            moving_average=channel.bench.moving_average,
            sampling_period_s=channel.bench.sampling_period_s,
            hold="zoh",
        )
        chosen = [start.numerator.ravel().tolist(), start.denominator.tolist(), start.delay_samples]
        for seeds in in_chunks(case.first_seed, case.seeds, case.seeds_per_task):
            decides = {**bench.decides_of(channel), "start": chosen, "seeds": [seeds.start, seeds.stop]}
            tasks.append(Task(f"{channel.plant.name}_{seeds.start}", decides, (channel, start, seeds)))
    return tasks


def cover(channel: bench.BenchChannel, start: TransferMatrix, seeds: range) -> Content:
    """Refits some seeds of a channel from the model of the first, and tells the share of bounds that hold the truth."""
    measuring, orders = bench.Measuring(channel), (len(start.denominator) - 1, start.numerator.shape[-1] - 1)
    structure = Structure(*orders, start.delay_samples, moving_average=start.moving_average, hold="zoh")
    fits = (fit_block(measuring.measure(seed)[:-1], [0], [0], structure, start) for seed in seeds)
    rows = [_shares(channel, measuring, Fitted(fit.model, fit.covariance_root)) for fit in fits]
    columns = zip(_KEPT.items(), np.array(rows).T, strict=True)
    datasets = {name: Dataset(values, "1", ("seed",), what) for (name, what), values in columns}
    return Content(datasets, {"channel": channel.plant.name})


def _shares(
    channel: bench.BenchChannel, measuring: bench.Measuring, fitted: Fitted
) -> tuple[float, float, float, float]:
    simulated, std = bench.answer_of(fitted, lambda model: model.simulate(measuring.commands[-1][:, None])[:, 0])
    held = _inside(simulated - measuring.answers[-1], std)
    low, high = channel.case.band_hz
    frequency_hz = bench.frequencies(channel.case)
    frequency_hz = frequency_hz[(frequency_hz >= low) & (frequency_hz <= high)]
    response, relative, phase = bench.response_of(fitted, frequency_hz)
    ratio = response / channel.bench.response(channel.plant, frequency_hz)
    size = np.abs(ratio) - 1
    return held, _inside(size, relative), _inside(np.angle(ratio), phase), float(np.max(np.abs(size)))


def _inside(error: FloatArray, std: FloatArray) -> float:
    moving = std > 0  # before a command comes through nothing is uncertain
    return float(np.mean(np.abs(error[moving]) <= bench.quantile() * std[moving]))


def _conclude_coverage(run: Run, case: PlantsCase, results: Results) -> PartFound | None:
    if not len(results):
        return None
    held = [(one.attributes["channel"], values_of(one)) for one in results]
    found = {
        name: {key: np.concatenate([values[key] for owner, values in held if owner == name]) for key in _KEPT}
        for name in (channel.plant.name for channel in bench.channels_of(run, case))
    }
    every = {key: np.concatenate([one[key] for one in found.values()]) for key in _KEPT}
    figures = {
        COVERAGE: float(every["output"].mean()),
        **{f"{COVERAGE}_{key}": float(every[key].mean()) for key in ("magnitude", "phase")},
        "coverage.seeds": float(len(every["output"]) / len(found)),
    }
    for name, one in found.items():
        figures[f"{name}.{COVERAGE}"] = float(one["output"].mean())
        figures[f"{name}.{COVERAGE}_magnitude"] = float(one["magnitude"].mean())
        figures[f"{name}.median_band_error_percent"] = 100 * float(np.median(one["error"]))
    shares = {"Outputs": "output", "Magnitudes": "magnitude", "Phases": "phase"}
    off = {"Largest error of a magnitude, median [%]": np.median, "worst [%]": np.max}
    columns = (
        ("Channel", lambda name: name),
        *((head, lambda name, key=key: percent(float(found[name][key].mean()))) for head, key in shares.items()),
        *((head, lambda name, of=of: significant(100 * float(of(found[name]["error"])))) for head, of in off.items()),
    )
    lead = (
        f"Each channel measured with the noise of {figures['coverage.seeds']:.0f} seeds and refitted at the chosen"
        f" structure: how many of the bounds of {100 * CONFIDENCE:g} % hold the truth. Outputs are the true ones of"
        " the chirp that validates, sample by sample; magnitudes and phases those of the responses inside the band."
        " Bounds know nothing of poles that the chosen structure leaves out."
    )
    section = Section("Do bounds cover?", lead, (table(columns, found, fit="compact"),))
    return PartFound(figures, {COVERAGE: _ASKED}, (section,))


COVERAGE_PART = Part("coverage", _conclude_coverage, coverage_tasks, cover, field="plants")
