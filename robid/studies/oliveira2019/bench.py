"""The paper's transfer functions as plants, measured as its robot was, and each channel identified.

What simulates the plants shares no code with any fit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from scipy.signal import StateSpace, cont2discrete, dlsim, tf2ss
from scipy.stats import norm

from robid.arrays import ComplexArray, FloatArray
from robid.artifacts.kinds import to_datasets
from robid.models.external.fit.data import Shot
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.graphs import Fitted
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.output_error import nrmse, predict
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.fit.transfer import TransferMatrix
from robid.pipeline.graph import Run
from robid.settings.robot_parts import plain_settings
from robid.signals.quantities import Channel
from robid.signals.waveforms import chirp
from robid.studies.experiments import paper_figures
from robid.studies.oliveira2019.judging import CONFIDENCE, Identified, Quality, RootValue, Tried
from robid.studies.settings.parts import PlantsCase
from robid.studies.study import Content, Results, Task

_MILLIMETRE, _DEGREE = 1e-3, float(np.pi / 180)
ROTATIONS = ("A", "B", "C")
PRINTED = {"m": _MILLIMETRE, "rad": _DEGREE}  # Units that the paper prints, millimetres and degrees, in SI units


@dataclass(frozen=True)
class Plant:
    """One channel of the paper's robot."""

    name: str  # Name of the channel
    numerator: tuple[float, ...]  # (n_zero + 1,) of its transfer function, highest power first
    denominator: tuple[float, ...]  # (n_pole + 1,) as the numerator
    amplitude: Mapping[float, float]  # Largest command of a chirp [m or rad] by its highest frequency [Hz]
    resolution: float  # Quantum of the measured position [m or rad]

    @property
    def unit(self) -> str:
        """Unit of command and position."""
        return "rad" if self.name in ROTATIONS else "m"


@dataclass(frozen=True)
class Bench:
    """How the plants are excited and measured."""

    sampling_period_s: float  # Period of commands and measurements [s]
    duration_s: float  # Length of a chirp [s]
    low_hz: float  # Where a chirp begins [Hz]
    repeats: int  # How often each is played
    delay_samples: int  # Transport delay
    moving_average: int  # Samples of the commands that are averaged
    noise_resolutions: float  # Deviation of the noise before quantising, over the resolution

    @property
    def n_sample(self) -> int:
        """Samples of a record."""
        return int(self.duration_s / self.sampling_period_s)

    def command(self, plant: Plant, high_hz: float) -> FloatArray:
        """Returns the chirp (n_sample,) up to a frequency, its amplitude falling to zero [m or rad]."""
        period = self.sampling_period_s
        wave = chirp(self.low_hz * period, high_hz * period, self.n_sample, peak=0.0)
        return plant.amplitude[high_hz] * wave

    def answer(self, plant: Plant, command: FloatArray) -> FloatArray:
        """Returns the true position (n_sample,) of a plant at rest that is told a command [m or rad]."""
        before = self.moving_average - 1
        padded = np.concatenate([np.zeros(before), command])
        averaged = np.lib.stride_tricks.sliding_window_view(padded, self.moving_average).mean(axis=-1)
        late = np.concatenate([np.zeros(self.delay_samples), averaged])[: len(command)]
        system = StateSpace(*tf2ss(plant.numerator, plant.denominator))
        matrices = cont2discrete((system.A, system.B, system.C, system.D), self.sampling_period_s, method="zoh")
        return np.asarray(dlsim(matrices, late[:, None])[1][:, 0])

    def step(self, plant: Plant, n_sample: int) -> FloatArray:
        """Returns the true answer (n_sample,) to a unit step without the moving average, at the samples."""
        return replace(self, moving_average=1).answer(plant, np.ones(n_sample))

    def measure(self, plant: Plant, answer: FloatArray, generator: np.random.Generator) -> FloatArray:
        """Returns what is measured of a position (n_repeat, n_sample): noisy, then quantised [m or rad]."""
        noise = generator.standard_normal((self.repeats, len(answer)))
        steps = answer / plant.resolution + self.noise_resolutions * noise
        return plant.resolution * np.round(steps)

    def response(self, plant: Plant, frequency_hz: FloatArray) -> ComplexArray:
        """Returns the true response (n_freq,) from samples to samples: with hold, average and delay."""
        z = np.exp(2j * np.pi * frequency_hz * self.sampling_period_s)
        above, below, _ = cont2discrete((plant.numerator, plant.denominator), self.sampling_period_s, method="zoh")
        average = np.mean([z**-lag for lag in range(self.moving_average)], axis=0)
        held = np.polyval(np.ravel(above), z) / np.polyval(below, z)
        return np.asarray(held * average * z**-self.delay_samples)

    def continuous(self, plant: Plant, frequency_hz: FloatArray) -> ComplexArray:
        """Returns the true response (n_freq,) of the transfer function, with the delay."""
        s = 2j * np.pi * frequency_hz
        late = np.exp(-s * self.delay_samples * self.sampling_period_s)
        return np.asarray(np.polyval(plant.numerator, s) / np.polyval(plant.denominator, s) * late)


def plants_of(paper: Mapping[str, Any]) -> tuple[Plant, ...]:
    """Returns the plants of the paper's Table 3, with the amplitudes of its Table 1."""
    found = []
    for name, function in paper["table_3"].items():
        kind, unit = ("rotation", _DEGREE) if name in ROTATIONS else ("translation", _MILLIMETRE)
        numerator, denominator = (tuple(map(float, function[key])) for key in ("numerator", "denominator"))
        sizes = (unit * size for size in paper["amplitudes"][name])
        amplitude = dict(zip(paper["high_hz"], sizes, strict=True))
        found.append(Plant(name, numerator, denominator, amplitude, unit * paper["resolution"][kind]))
    return tuple(found)


def bench_of(paper: Mapping[str, Any], case: PlantsCase) -> Bench:
    """Returns the paper's experiment with what it leaves open."""
    printed = {key: paper[key] for key in ("sampling_period_s", "duration_s", "low_hz", "repeats")}
    left_open = {key: getattr(case, key) for key in ("delay_samples", "moving_average", "noise_resolutions")}
    return Bench(**printed, **left_open)


_SEEDS = ("first_seed", "seeds", "seeds_per_task")


@dataclass(frozen=True)
class BenchChannel:
    """A channel to be identified."""

    plant: Plant
    bench: Bench
    case: PlantsCase


def channels_of(run: Run, case: PlantsCase) -> tuple[BenchChannel, ...]:
    """Returns the channels."""
    paper = paper_figures(run.loaded)
    return tuple(BenchChannel(plant, bench_of(paper, case), case) for plant in plants_of(paper))


def decides_of(channel: BenchChannel) -> dict[str, Any]:
    """Returns what decides a channel's results, seeds left out."""
    case = {key: value for key, value in plain_settings(channel.case).items() if key not in _SEEDS}
    plant = {**vars(channel.plant), "amplitude": {f"{high:g}": size for high, size in channel.plant.amplitude.items()}}
    return {"plant": plain_settings(plant), "bench": plain_settings(channel.bench), **case}


def plants_tasks(run: Run, case: PlantsCase, _earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the tasks of the channels."""
    seed = {"seed": case.first_seed}
    return [Task(one.plant.name, {**decides_of(one), **seed}, (one,)) for one in channels_of(run, case)]


_PER_DECADE, _BEYOND = 40, 2.0
_STEP_SAMPLES = 120
_WHATS = {"": "rate", "_frequency": "frequency", "_damping": "damping"}


class Measuring:
    """A channel on the bench; what is the same for all seeds is simulated once."""

    def __init__(self, channel: BenchChannel) -> None:
        """Simulates the answers to all chirps, the last one that which validates."""
        self._plant, self._bench, case = channel.plant, channel.bench, channel.case
        highest_hz = (*case.fit_hz, case.validation_hz)
        self.commands = [self._bench.command(self._plant, high) for high in highest_hz]
        self.answers = [self._bench.answer(self._plant, command) for command in self.commands]
        self._names = [f"chirp to {high:g} Hz" for high in highest_hz]

    def measure(self, seed: int) -> list[Shot]:
        """Measures all chirps, the last one to validate, the noise being that of a seed and of the channel."""
        generator = np.random.default_rng([seed, *self._plant.name.encode()])
        found, period_s = [], self._bench.sampling_period_s
        for name, command, answer in zip(self._names, self.commands, self.answers, strict=True):
            repeats = self._bench.measure(self._plant, answer, generator)
            count, mean = len(repeats), repeats.mean(axis=0)
            variance = ((repeats - mean) ** 2).sum(axis=0).mean() / (count - 1) if count > 1 else 0.0
            std = np.array([np.sqrt(variance / count)]) if count > 1 else None
            found.append(Shot(command[:, None], mean[:, None], "rest", std, count, period_s, name, offset=False))
        return found


def identify(channel: BenchChannel) -> Content:
    """Measures a channel, lets the evidence choose its structure, and validates the fit on the chirp left out."""
    plant, case = channel.plant, channel.case
    *fitted_shots, left_out = Measuring(channel).measure(case.first_seed)
    options = ExternalOptions(max_poles=case.max_poles, max_delay_samples=case.max_delay_samples, confidence=CONFIDENCE)
    options = replace(options, moving_average=channel.bench.moving_average)
    told, seen = (Channel(plant.name, what, plant.unit, "tool") for what in ("position_command", "position"))
    solution = fit_external(fitted_shots, (told,), (seen,), "zoh", options)
    fitted = Fitted(solution.transfer(0), solution.transfers.root_of(0))
    return Content(*to_datasets(_identified(channel, solution, fitted, left_out)))


def _identified(channel: BenchChannel, solution: ExternalSolution, fitted: Fitted, left_out: Shot) -> Identified:
    frequency_hz, quality = frequencies(channel.case), solution.quality
    response, relative, phase = response_of(fitted, frequency_hz)
    step_s = np.arange(_STEP_SAMPLES) * channel.bench.sampling_period_s
    # The answer to a unit step of the command is without the moving average.
    step, step_std = answer_of(fitted, lambda model: model.step(step_s)[:, 0, 0])
    simulated, simulated_std = answer_of(fitted, lambda model: model.simulate(left_out.inputs)[:, 0])
    told = (f"{finding.channel}: {finding.message}" for finding in solution.findings)
    return Identified(
        numerator=fitted.model.numerator[0, 0],
        denominator=fitted.model.denominator,
        covariance=fitted.root @ fitted.root.T,
        delay_samples=fitted.model.delay_samples,
        reason=quality.reason[0],
        status=quality.status[0],
        roots=_roots(solution),
        undetermined=(*solution.estimate.undetermined, *solution.remarks, *told),
        tried=tuple(Tried(*(getattr(one, each.name) for each in fields(Tried))) for one in solution.tried),
        quality=_quality(channel.plant, fitted, left_out, int(quality.n_parameter[0])),
        frequency_hz=frequency_hz,
        response=response,
        continuous=fitted.model.response(2 * np.pi * frequency_hz)[:, 0, 0],
        relative_std=relative,
        phase_std=phase,
        etfe_hz=solution.etfe.frequency_hz,
        etfe=solution.etfe.response[:, 0, 0],
        etfe_radius=solution.etfe.radius[:, 0, 0],
        command=left_out.inputs[:, 0],
        measured=left_out.outputs[:, 0],
        simulated=simulated,
        bound=quantile() * simulated_std,
        step_s=step_s,
        step=step,
        step_std=step_std,
    )


def quantile() -> float:
    """Returns the half width of an interval of `CONFIDENCE`, in standard deviations."""
    return float(norm.ppf(0.5 + 0.5 * CONFIDENCE))


def frequencies(case: PlantsCase) -> FloatArray:
    """Returns frequencies (n_freq,) of the band, its ends included, and beyond [Hz]."""
    low, high = case.band_hz
    count = int(np.ceil(_PER_DECADE * np.log10(high / low))) + 1
    inside = np.geomspace(low, high, count)
    ratio = inside[1] / inside[0]
    return np.concatenate([inside, high * ratio ** np.arange(1, int(np.log(_BEYOND) / np.log(ratio)) + 1)])


def answer_of(fitted: Fitted, answer: Callable[[TransferMatrix], FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Returns what a fitted model answers (n_time,), and its deviation."""
    own = answer(fitted.model)
    return own, fitted.deviation(np.array([(answer(other) - own) / step for other, step in fitted.nudged()]))


def response_of(fitted: Fitted, frequency_hz: FloatArray) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Returns a response (n_freq,) from samples to samples, with hold, average and delay, and its deviations.

    Returns:
        The response; the relative deviation of its magnitude; that of its phase [rad].
    """

    def sampled(model: TransferMatrix) -> ComplexArray:
        return model.sampled_response(2 * np.pi * frequency_hz)[:, 0, 0]

    response = sampled(fitted.model)
    slopes = np.array([(sampled(other) / response - 1) / step for other, step in fitted.nudged()])
    return response, fitted.deviation(slopes.real), fitted.deviation(slopes.imag)


def _roots(solution: ExternalSolution) -> tuple[RootValue, ...]:
    """Takes what says where poles and zeros lie from the estimate, without the channel's name."""
    estimate = solution.estimate
    std = np.sqrt(np.diag(estimate.covariance)).tolist()
    # Both numbers of a pair, as `X.pole2.frequency` and `X.pole2.damping`, have its place.
    places = [name.removesuffix(".frequency").removesuffix(".damping") for name in estimate.names]
    rows = list(zip(places, estimate.names, estimate.kinds, estimate.value.tolist(), std, strict=True))
    sizes = {place: abs(value) for place, _, kind, value, _ in rows if not kind.endswith("_damping")}
    return tuple(
        RootValue(
            name=name.partition(".")[2],
            kind=kind.partition("_")[0],
            what=_WHATS[kind.removeprefix("pole").removeprefix("zero")],
            size_rad_s=sizes[place],
            value=value,
            relative_std=std / abs(value) if value else np.inf,
        )
        for place, name, kind, value, std in rows
        if kind != "gain"
    )


def _quality(plant: Plant, fitted: Fitted, shot: Shot, n_parameter: int) -> Quality:
    simulated = predict(fitted.model, shot, [0], [0])
    left = (shot.outputs - simulated) / PRINTED[plant.unit]
    whole = shot.outputs - shot.outputs.mean(axis=0)
    share = n_parameter / len(left)
    return Quality(
        r2=float(1 - np.sum((shot.outputs - simulated) ** 2) / np.sum(whole**2)),
        nrmse=float(nrmse(shot.outputs, simulated)[0]),
        fpe=float(np.mean(left**2)) * (1 + share) / (1 - share),
    )
