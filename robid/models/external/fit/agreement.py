"""How well a model agrees with what was measured, output by output and place by place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.fit.data import Shot


@dataclass(frozen=True)
class Agreement:
    """How well one output is described in the shots of one campaign and configuration, taken together."""

    output: str  # name of the channel, or of the output of a matrix
    place: str  # campaign and configuration
    nrmse: float  # normalised root mean square: 1 is perfect
    r_squared: float  # coefficient of determination
    error_std: float  # root mean square of the error, in the output's unit
    motion_std: float  # root mean square of the output about its mean
    noise_std: float  # standard deviation of the noise of the averaged output, from repeats; NaN without
    amplitude: float  # largest deviation of a command from where it is counted from
    single_noise_std: float = float("nan")  # standard deviation of the noise of a single repeat; NaN without repeats


def agreements(
    names: Sequence[str],
    shots: Sequence[Shot],
    outputs: Sequence[int],
    measured: Sequence[FloatArray],
    errors: Sequence[FloatArray],
    inputs: Sequence[int],
) -> tuple[Agreement, ...]:
    """Compares a block's outputs with what was measured.

    Args:
        names: Name of each of its outputs.
        shots: The shots.
        outputs: Indices of its outputs.
        measured: Outputs (n_sample, n_out) of each shot.
        errors: Errors (n_sample, n_out) of each shot.
        inputs: Indices of its commands.

    Source:
        Oliveira et al. (2019), Table 2.
    """
    found = []
    for place in dict.fromkeys(shot.place for shot in shots):
        chosen = [index for index, shot in enumerate(shots) if shot.place == place]
        there = [shots[index] for index in chosen]
        moved = [measured[index] - measured[index].mean(axis=0) for index in chosen]
        error_std, motion_std = (
            np.sqrt(np.mean(np.concatenate(each) ** 2, axis=0)) for each in ([errors[index] for index in chosen], moved)
        )
        noise_std, single = _noise(there, outputs), _noise(there, outputs, single=True)
        amplitude = max(float(np.abs(shot.inputs[:, list(inputs)]).max()) for shot in there)
        for index, name in enumerate(names):
            left = float(error_std[index] / motion_std[index]) if motion_std[index] > 0 else np.inf
            found.append(
                Agreement(
                    output=name,
                    place=place,
                    nrmse=1 - left,
                    r_squared=1 - left**2,
                    error_std=float(error_std[index]),
                    motion_std=float(motion_std[index]),
                    noise_std=float(noise_std[index]),
                    amplitude=amplitude,
                    single_noise_std=float(single[index]),
                )
            )
    return tuple(found)


def _noise(shots: Sequence[Shot], outputs: Sequence[int], *, single: bool = False) -> FloatArray:
    known = [
        shot.noise_std[list(outputs)] * (np.sqrt(shot.repeats) if single else 1.0)
        for shot in shots
        if shot.noise_std is not None
    ]
    return np.sqrt(np.mean(np.square(known), axis=0)) if known else np.full(len(outputs), np.nan)
