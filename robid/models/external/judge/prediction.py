"""What transfer functions predict of new shots, with bounds from their parameters and the noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np

from robid.arrays import FloatArray, IntArray, Quantity
from robid.models.external.fit.comparison import predict
from robid.models.external.fit.data import Shot
from robid.models.external.fit.etfe import moved_inputs
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.fit.uncertainty import output_deviation

_ROUNDED = 12**-0.5  # of a step: repeats of what hardly moves are rounded alike


@dataclass(frozen=True)
class NewShots:
    """Shots of a validation that concern one block.

    Attributes:
        block: Index of the block.
        inputs: Indices of its commands.
        outputs: Indices of its outputs.
        names: Names of its outputs.
        shots: The shots in which one of its commands moves.
    """

    block: int
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]
    names: tuple[str, ...]
    shots: tuple[Shot, ...]


@dataclass(frozen=True)
class PredictedShot:
    """One shot as a block predicts it.

    Attributes:
        measured (n_sample, n_out): Measured outputs less their mean.
        predicted (n_sample, n_out): Predicted ones.
        parameter_std (n_sample, n_out): Standard deviation of these by the model's parameters.
        noise_std (n_out,): Standard deviation of the outputs' noise.
    """

    measured: FloatArray
    predicted: FloatArray
    parameter_std: FloatArray
    noise_std: FloatArray

    @property
    def std(self) -> FloatArray:
        """Standard deviation (n_sample, n_out) of what is expected of measured less predicted."""
        return np.asarray(np.hypot(self.parameter_std, self.noise_std))


@dataclass(frozen=True)
class PredictedTraces:
    """Measured and predicted outputs, one below the other.

    Attributes:
        time_s: Time since the shot began.
        std: Standard deviation of what is expected of measured less predicted, by parameters and noise.
    """

    names: Annotated[tuple[str, ...], Quantity("1", "output", "The outputs")]
    output: Annotated[IntArray, Quantity("1", "row", "Index into names")]
    shots: Annotated[tuple[str, ...], Quantity("1", "shot", "Names of the shots")]
    shot: Annotated[IntArray, Quantity("1", "row", "Index into shots")]
    time_s: Annotated[FloatArray, Quantity("s", "row")]
    measured: Annotated[
        FloatArray, Quantity("as of the output", "row", "Measured output less its offset", compact=True)
    ]
    predicted: Annotated[FloatArray, Quantity("as of the output", "row", "The model's", compact=True)]
    std: Annotated[
        FloatArray, Quantity("as of the output", "row", "Deviation of their difference, as expected", compact=True)
    ]


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
