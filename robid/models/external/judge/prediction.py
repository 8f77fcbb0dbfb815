"""What transfer functions predict of new shots, what is new in these, and fits of several homes compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray, Quantity
from robid.models.external.fit.data import Shot
from robid.models.external.fit.etfe import moved_inputs
from robid.models.external.fit.graphs import output_deviation, response_deviation
from robid.models.external.fit.output_error import predict
from robid.models.external.fit.solution import ExternalSolution
from robid.results.finding import Finding

_ROUNDED = 12**-0.5  # of a step: repeats of what hardly moves are rounded alike

_OUTPUT = "as of the output"


@dataclass(frozen=True)
class NewShots:
    """Shots of a validation that concern one block."""

    block: int  # index of the block
    inputs: tuple[int, ...]  # indices of its commands
    outputs: tuple[int, ...]  # indices of its outputs
    names: tuple[str, ...]  # names of its outputs
    shots: tuple[Shot, ...]  # the shots in which one of its commands moves


@dataclass(frozen=True)
class PredictedShot:
    """One shot as a block predicts it."""

    measured: FloatArray  # (n_sample, n_out): measured outputs less their mean
    predicted: FloatArray  # (n_sample, n_out): predicted ones
    parameter_std: FloatArray  # (n_sample, n_out): standard deviation of these by the model's parameters
    noise_std: FloatArray  # (n_out,): standard deviation of the outputs' noise

    @property
    def std(self) -> FloatArray:
        """Standard deviation (n_sample, n_out) of what is expected of measured less predicted."""
        return np.asarray(np.hypot(self.parameter_std, self.noise_std))


@dataclass(frozen=True)
class PredictedTraces:
    """Measured and predicted outputs, one below the other."""

    names: Annotated[tuple[str, ...], Quantity("1", "output", "The outputs")]
    output: Annotated[IntArray, Quantity("1", "row", "Index into names")]
    shots: Annotated[tuple[str, ...], Quantity("1", "shot", "Names of the shots")]
    shot: Annotated[IntArray, Quantity("1", "row", "Index into shots")]
    time_s: Annotated[FloatArray, Quantity("s", "row")]  # time since the shot began
    measured: Annotated[FloatArray, Quantity(_OUTPUT, "row", "Measured output less its offset", compact=True)]
    predicted: Annotated[FloatArray, Quantity(_OUTPUT, "row", "The model's", compact=True)]
    std: Annotated[FloatArray, Quantity(_OUTPUT, "row", "Deviation of their difference, as expected", compact=True)]


def new_shots(solution: ExternalSolution, shots: Sequence[Shot]) -> tuple[NewShots, ...]:
    """Finds the shots in which the commands of each block move; blocks without any are left out."""
    found = []
    own, quality = solution.transfers, solution.quality
    for block in range(len(own.blocks)):
        channels = own.channels_of(block)
        inputs, outputs = (tuple(dict.fromkeys(which[channels].tolist())) for which in (own.inputs, own.outputs))
        used = tuple(shot for shot in shots if moved_inputs(shot, solution.ports.floor)[list(inputs)].any())
        first = int(quality.first_output[block])
        if used:
            found.append(NewShots(block, inputs, outputs, quality.output_names[first : first + len(outputs)], used))
    return tuple(found)


def predict_shots(solution: ExternalSolution, one: NewShots) -> tuple[PredictedShot, ...]:
    """Predicts the outputs of a block in its shots, with the deviation by its parameters.

    Where a shot has no repeats its noise is what the fit left in the place whose motion was about as large.
    """
    model, root = solution.transfer(one.block), solution.transfers.root_of(one.block)
    found = []
    for shot in one.shots:
        predicted = predict(model, shot, one.inputs, one.outputs)
        settled: Literal["rest", "periodic"] = "periodic" if shot.start == "periodic" else "rest"
        deviation = output_deviation(model, root, shot.inputs[:, list(one.inputs)], settled)
        measured = shot.outputs[:, list(one.outputs)]
        level = measured.mean(axis=0) if shot.offset else np.zeros(len(one.outputs))
        noise = _noise(solution, one, shot)
        found.append(PredictedShot(measured - level, predicted - level, deviation, noise))
    return tuple(found)


def traces_of(
    solution: ExternalSolution, found: Sequence[NewShots], predicted: Sequence[Sequence[PredictedShot]]
) -> PredictedTraces:
    """Writes the predicted shots of all blocks one below the other."""
    names = tuple(dict.fromkeys(name for one in found for name in one.names))
    shots = tuple(dict.fromkeys(shot.name for one in found for shot in one.shots))
    rows = []
    for one, those in zip(found, predicted, strict=True):
        for shot, each in zip(one.shots, those, strict=True):
            time_s = np.arange(len(each.measured)) * solution.ports.sampling_period_s
            for place, name in enumerate(one.names):
                labels = np.full((2, len(time_s)), [[names.index(name)], [shots.index(shot.name)]])
                rows.append(
                    (*labels, time_s, *(values[:, place] for values in (each.measured, each.predicted, each.std)))
                )
    output, shot_index, time, measured, simulated, std = (np.concatenate(each) for each in zip(*rows, strict=True))
    return PredictedTraces(names, output.astype(int), shots, shot_index.astype(int), time, measured, simulated, std)


def _noise(solution: ExternalSolution, one: NewShots, shot: Shot) -> FloatArray:
    """Standard deviation (n_out,) of the outputs' noise in a shot."""
    if shot.noise_std is not None:
        steps = np.zeros(len(shot.noise_std)) if shot.quantum is None else shot.quantum
        return np.asarray(np.maximum(shot.noise_std, _ROUNDED * steps)[list(one.outputs)])
    found = []
    for name, output in zip(one.names, one.outputs, strict=True):
        size = max(float(shot.outputs[:, output].std()), np.finfo(float).tiny)
        own = [each for each in solution.agreements if each.output == name and each.motion_std > 0]
        alike = min(own, key=lambda each: abs(np.log(each.motion_std / size)))
        # The fit's own shots may be averages of several repeats; this one is not.
        found.append(alike.error_std if np.isnan(alike.single_noise_std) else alike.single_noise_std)
    return np.array(found)


_OUTSIDE = 0.02  # of a motion's power
_LARGER = 1.2
_SAME = 0.01  # of the motion


def novelty_findings(solution: ExternalSolution, found: Sequence[NewShots]) -> Iterator[Finding]:
    """Yields what the new shots of each block ask of the model that its fit never saw, or saw already."""
    first = solution.quality.first_output
    for one in found:
        name = solution.transfers.blocks[one.block]
        high_hz, low_hz = float(solution.quality.highest_hz[one.block]), float(solution.quality.lowest_hz[one.block])
        share = max(
            _outside(shot.inputs[:, list(one.inputs)], shot.sampling_period_s, low_hz, high_hz) for shot in one.shots
        )
        if share > _OUTSIDE:
            told = (
                f"{share:.0%} of the new motion of {name} lie outside the band of its fit, {low_hz:.3g} to "
                f"{high_hz:.3g} Hz"
            )
            yield Finding("band", told, decisive=False, strength=share / _OUTSIDE)
        before = max(each.amplitude for each in solution.agreements if each.output in one.names)
        ratio = max(float(np.abs(shot.inputs[:, list(one.inputs)]).max()) for shot in one.shots) / before
        if ratio > _LARGER:
            told = f"the new motion of {name} is {ratio:.2g} times as large as any of its fit"
            yield Finding("band", told, decisive=False, strength=ratio / _LARGER)
        if any(_seen(solution, int(first[one.block]) + place, shot.outputs[:, output])
               for shot in one.shots for place, output in enumerate(one.outputs)):  # fmt: skip
            told = f"the validation repeats a motion of the fit of {name}: it says nothing of other motions"
            yield Finding("same_motion", told, decisive=False, strength=2.0)


def _outside(commands: FloatArray, sampling_period_s: float, low_hz: float, high_hz: float) -> float:
    """Share of the commands' power (n_sample, n_in) outside a band."""
    power = (np.abs(np.fft.rfft(commands - commands.mean(axis=0), axis=0)) ** 2).sum(axis=1)
    frequency_hz = np.fft.rfftfreq(len(commands), sampling_period_s)
    slack = frequency_hz[1]
    outside = (frequency_hz > high_hz + slack) | (frequency_hz < low_hz - slack)
    return float(power[outside].sum() / max(power.sum(), np.finfo(float).tiny))


def _seen(solution: ExternalSolution, output: int, measured: FloatArray) -> bool:
    """Whether an output (n_sample,) did the same in a shot of the fit."""
    traces, moved = solution.traces, measured - measured.mean()
    for shot in np.unique(traces.shot[traces.output == output]):
        before = traces.measured[(traces.output == output) & (traces.shot == shot)]
        if len(before) == len(moved) and np.std(before - before.mean() - moved) < _SAME * moved.std():
            return True
    return False


_FREQUENCIES = 200
_DEVIATIONS = 3.0


@dataclass(frozen=True)
class HomeDifference:
    """Where a channel differs most between two fits, in the band that both excited."""

    channel: str
    relative: float  # largest distance of the responses over their mean magnitude
    at_hz: float  # frequency of it [Hz]
    magnitude_db: float  # difference of the magnitudes there [dB]
    phase_deg: float  # difference of the phases there [deg]
    significant: bool  # whether it is beyond three deviations of both


def compare_homes(one: ExternalSolution, other: ExternalSolution) -> Iterator[HomeDifference]:
    """Compares the channels that two fits have in common; those without a common band are left out."""
    for name in one.transfers.names:
        if name not in other.transfers.names:
            continue
        qualities = [(each.quality, _place(each, name)[0]) for each in (one, other)]
        low = max(float(quality.lowest_hz[block]) for quality, block in qualities)
        high = min(float(quality.highest_hz[block]) for quality, block in qualities)
        if not low < high:
            continue
        frequency_hz = np.geomspace(low, high, _FREQUENCIES)
        (first, std), (second, other_std) = (_response(each, name, frequency_hz) for each in (one, other))
        size = 0.5 * (np.abs(first) + np.abs(second))
        distance = np.abs(first - second) / size
        worst = int(np.argmax(distance))
        ratio = second[worst] / first[worst]
        spread = np.hypot(std * np.abs(first), other_std * np.abs(second)) / size
        yield HomeDifference(
            channel=name,
            relative=float(distance[worst]),
            at_hz=float(frequency_hz[worst]),
            magnitude_db=float(20 * np.log10(np.abs(ratio))),
            phase_deg=float(np.degrees(np.angle(ratio))),
            significant=bool((distance > _DEVIATIONS * spread).any()),
        )


def _place(solution: ExternalSolution, name: str) -> tuple[int, int]:
    """Block of a channel, and its place in it."""
    channel = solution.transfers.names.index(name)
    block = int(solution.transfers.block_of[channel])
    return block, int(np.flatnonzero(solution.transfers.channels_of(block) == channel)[0])


def _response(solution: ExternalSolution, name: str, frequency_hz: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Response (n_freq,) of a channel from samples to samples, and its deviation over its magnitude."""
    block, place = _place(solution, name)
    model, omega = solution.transfer(block), 2 * np.pi * frequency_hz
    found = response_deviation(model, solution.transfers.root_of(block), omega, sampled=True).largest
    whole = model.sampled_response(omega)
    return whole.reshape(len(omega), -1)[:, place], found.reshape(len(omega), -1)[:, place]
