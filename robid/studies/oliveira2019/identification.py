"""The tasks of the paper's channels: each measured, identified and put to the test, one seed's noise at a time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import norm

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.fit.data import Shot
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.graphs import Fitted
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.output_error import nrmse, predict
from robid.models.external.fit.solution import ExternalSolution
from robid.pipeline.graph import Run
from robid.settings.robot_parts import plain_settings
from robid.signals.quantities import Channel
from robid.studies.experiments import paper_figures
from robid.studies.oliveira2019.bench import PRINTED, Bench, Plant, bench_of, plants_of
from robid.studies.oliveira2019.judging import CONFIDENCE, Identified, Quality, RootValue, Tried, to_content
from robid.studies.settings.parts import PlantsCase
from robid.studies.tasks import Content, Results, Task

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
    return [
        Task(channel.plant.name, {**decides_of(channel), "seed": channel.case.first_seed}, channel)
        for channel in channels_of(run, case)
    ]


def identify(channel: BenchChannel) -> Content:
    """Identifies one channel."""
    found = identify_channel(channel.plant, channel.bench, channel.case, channel.case.first_seed)
    return to_content(found)


_PER_DECADE, _BEYOND = 40, 2.0
_STEP_SAMPLES = 120
_WHATS = {"": "rate", "_frequency": "frequency", "_damping": "damping"}


@dataclass(frozen=True)
class Measured:
    """What one seed measured of a channel: shots that are fitted, and the one that validates."""

    fitted: tuple[Shot, ...]
    validation: Shot


class Measuring:
    """A channel on the bench; what is the same for all seeds is simulated once.

    Args:
        plant: The channel.
        bench: The bench.
        case: Which chirps are played.
    """

    def __init__(self, plant: Plant, bench: Bench, case: PlantsCase) -> None:
        self._plant, self._bench = plant, bench
        self.commands = [bench.command(plant, high) for high in (*case.fit_hz, case.validation_hz)]
        self.answers = [bench.answer(plant, command) for command in self.commands]
        self._names = [f"chirp to {high:g} Hz" for high in (*case.fit_hz, case.validation_hz)]

    def measure(self, seed: int) -> Measured:
        """Measures all chirps, the noise being that of a seed and of the channel."""
        generator = np.random.default_rng([seed, *self._plant.name.encode()])
        shots = [
            self._shot(index, self._bench.measure(self._plant, answer, generator))
            for index, answer in enumerate(self.answers)
        ]
        return Measured(tuple(shots[:-1]), shots[-1])

    def _shot(self, index: int, repeats: FloatArray) -> Shot:
        count, mean = len(repeats), repeats.mean(axis=0)
        variance = ((repeats - mean) ** 2).sum(axis=0).mean() / (count - 1) if count > 1 else 0.0
        return Shot(
            inputs=self.commands[index][:, None],
            outputs=mean[:, None],
            start="rest",
            noise_std=np.array([np.sqrt(variance / count)]) if count > 1 else None,
            repeats=count,
            sampling_period_s=self._bench.sampling_period_s,
            name=self._names[index],
            offset=False,
        )


def identify_channel(plant: Plant, bench: Bench, case: PlantsCase, seed: int) -> Identified:
    """Measures a channel, lets the evidence choose its structure, and validates the fit on the chirp left out."""
    measured = Measuring(plant, bench, case).measure(seed)
    options = ExternalOptions(
        max_poles=case.max_poles,
        max_delay_samples=case.max_delay_samples,
        moving_average=bench.moving_average,
        confidence=CONFIDENCE,
    )
    solution = fit_external(measured.fitted, *_channels(plant), "zoh", options)
    fitted = Fitted(solution.transfer(0), solution.transfers.root_of(0))
    frequency_hz = frequencies(case)
    response, relative, phase = response_of(fitted, frequency_hz)
    step_s = np.arange(_STEP_SAMPLES) * bench.sampling_period_s
    step, step_std = step_of(fitted, step_s)
    simulated, simulated_std = simulation_of(fitted, measured.validation.inputs)
    quality = solution.quality
    return Identified(
        numerator=fitted.model.numerator[0, 0],
        denominator=fitted.model.denominator,
        covariance=fitted.root @ fitted.root.T,
        delay_samples=fitted.model.delay_samples,
        reason=quality.reason[0],
        status=quality.status[0],
        roots=_roots(solution),
        undetermined=(
            *solution.estimate.undetermined,
            *solution.remarks,
            *(f"{finding.channel}: {finding.message}" for finding in solution.findings),
        ),
        tried=tuple(
            Tried(one.poles, one.zeros, one.delay_samples, one.bic, one.whiteness_p, one.chosen)
            for one in solution.tried
        ),
        quality=_quality(plant, fitted, measured, int(quality.n_parameter[0])),
        frequency_hz=frequency_hz,
        response=response,
        continuous=fitted.model.response(2 * np.pi * frequency_hz)[:, 0, 0],
        relative_std=relative,
        phase_std=phase,
        etfe_hz=solution.etfe.frequency_hz,
        etfe=solution.etfe.response[:, 0, 0],
        etfe_radius=solution.etfe.radius[:, 0, 0],
        command=measured.validation.inputs[:, 0],
        measured=measured.validation.outputs[:, 0],
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


def response_of(fitted: Fitted, frequency_hz: FloatArray) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Returns a response (n_freq,) from samples to samples, and the deviations of its magnitude and phase.

    Args:
        fitted: The model with its uncertainty.
        frequency_hz (n_freq,): Frequencies [Hz].

    Returns:
        The response with hold, average and delay; the relative deviation of its magnitude; that of its phase [rad].
    """
    omega = 2 * np.pi * frequency_hz
    response = fitted.model.sampled_response(omega)[:, 0, 0]
    slopes = np.array(
        [(other.sampled_response(omega)[:, 0, 0] / response - 1) / step for other, step in fitted.nudged()]
    )
    return response, fitted.deviation(slopes.real), fitted.deviation(slopes.imag)


def simulation_of(fitted: Fitted, command: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns the answer (n_sample,) to a command (n_sample, 1) from rest, and its deviation."""
    simulated = fitted.model.simulate(command)[:, 0]
    slopes = np.array([(other.simulate(command)[:, 0] - simulated) / step for other, step in fitted.nudged()])
    return simulated, fitted.deviation(slopes)


def step_of(fitted: Fitted, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Returns the answer (n_time,) to a unit step of the command, without the moving average, and its deviation."""
    step = fitted.model.step(time_s)[:, 0, 0]
    slopes = np.array([(other.step(time_s)[:, 0, 0] - step) / nudge for other, nudge in fitted.nudged()])
    return step, fitted.deviation(slopes)


def _channels(plant: Plant) -> tuple[Sequence[Channel], Sequence[Channel]]:
    return (Channel(plant.name, "position_command", plant.unit, "tool"),), (
        Channel(plant.name, "position", plant.unit, "tool"),
    )


def _roots(solution: ExternalSolution) -> tuple[RootValue, ...]:
    """Takes what says where poles and zeros lie from the estimate, without the channel's name."""
    estimate = solution.estimate
    sizes: dict[str, float] = {}
    for name, kind, value in zip(estimate.names, estimate.kinds, estimate.value.tolist(), strict=True):
        if not kind.endswith("_damping"):
            sizes[_place(name)] = abs(value)
    return tuple(
        RootValue(
            name=name.partition(".")[2],
            kind=kind.partition("_")[0],
            what=_WHATS[kind.removeprefix("pole").removeprefix("zero")],
            size_rad_s=sizes[_place(name)],
            value=value,
            relative_std=float(std / abs(value)) if value else np.inf,
        )
        for name, kind, value, std in zip(
            estimate.names,
            estimate.kinds,
            estimate.value.tolist(),
            np.sqrt(np.diag(estimate.covariance)),
            strict=True,
        )
        if kind != "gain"
    )


def _place(name: str) -> str:
    """`X.pole2` of `X.pole2.damping`."""
    return name.removesuffix(".frequency").removesuffix(".damping")


def _quality(plant: Plant, fitted: Fitted, measured: Measured, n_parameter: int) -> Quality:
    """Table 2's measures on the chirp left out, the final prediction error in the paper's units."""
    shot = measured.validation
    simulated = predict(fitted.model, shot, [0], [0])
    left = (shot.outputs - simulated) / PRINTED[plant.unit]
    whole = shot.outputs - shot.outputs.mean(axis=0)
    share = n_parameter / len(left)
    return Quality(
        r2=float(1 - np.sum((shot.outputs - simulated) ** 2) / np.sum(whole**2)),
        nrmse=float(nrmse(shot.outputs, simulated)[0]),
        fpe=float(np.mean(left**2)) * (1 + share) / (1 - share),
    )
