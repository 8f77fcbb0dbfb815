"""Records as shots, what was commanded and what came of it, repeats averaged; and how well a model agrees with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.external.fit.options import ExternalOptions
from robid.signals.quantities import QUANTITIES, Channel
from robid.signals.record import Record, place_words

_SAME = 1e-6  # of a command's range
_ROUNDING = 1e-6  # of the largest value, as samples are stored
_STRETCHES = 20
_CHANCE = 3.0  # of what noise from sample to sample does to the level of a stretch
_OFF_GRID, _ON_GRID = 0.1, 0.95


@dataclass(frozen=True)
class Shot:
    """One experiment, its repeats averaged."""

    inputs: FloatArray  # (n_sample, n_in): Commands, without delay or moving average, in SI units
    outputs: FloatArray  # (n_sample, n_out): what came of them, in SI units
    # State at the first sample: `rest` where it is zero, `periodic` where it is that of a steady period, `free` where
    # it is estimated along.
    start: Literal["rest", "periodic", "free"]
    # (n_out,): standard deviation of the averaged outputs, from the scatter of the repeats; None without.
    noise_std: FloatArray | None
    repeats: int  # how many were averaged
    sampling_period_s: float
    name: str  # Campaign, and what else tells it from others, for messages
    offset: bool = True  # whether a constant offset of each output is estimated along
    place: str = ""  # campaign and configuration; shots of one place in which several commands move are read together
    # (n_out,): step between values of a single repeat, 0 where they lie on no grid; None where unknown.
    quantum: FloatArray | None = None
    # (n_out,): how far periods lie apart beyond noise from sample to sample; None without several, and where commands
    # are no positions.
    wander: FloatArray | None = None


@dataclass(frozen=True)
class Commands:
    """What a record's outputs are answers to."""

    channels: tuple[Channel, ...]  # what each command is
    # (n_conf, n_real, n_exp, n_period, n_sample, n_in): Commands, in SI units; one period where all are the same.
    values: FloatArray
    hold: Literal["zoh", "foh"]  # what they do between samples


def commands_of(record: Record, options: ExternalOptions) -> Commands:
    """Returns what was commanded: the references of a record that has some, its inputs else."""
    if record.reference is None:
        channels, values = record.input_channels, record.inputs
        held: Literal["zoh", "foh"] = "zoh" if record.input_hold == "zoh" else "foh"
    else:
        channels, values, held = record.reference_channels, record.reference[:, :, :, None], "zoh"
    if options.hold != "recorded":
        held = options.hold
    speeds = all(channel.quantity in ("speed_reference", "speed") for channel in channels)
    leads = speeds and all(QUANTITIES[channel.quantity].derivatives == 2 for channel in record.output_channels)
    if options.speed_references == "kept" or not leads:
        return Commands(channels, values, held)
    moved = _integrated(values, record.sampling_period_s, held, periodic=not record.is_one_shot)
    units = ("rad" if channel.unit.startswith("rad") else "m" for channel in channels)
    positions = tuple(
        Channel(channel.name, "position_command", unit, channel.side)
        for channel, unit in zip(channels, units, strict=True)
    )
    # A held speed is a position that moves in straight lines.
    return Commands(positions, moved, "foh")


def shots_of(record: Record, options: ExternalOptions, name: str) -> tuple[Shot, ...]:
    """Cuts a record into shots: one for each experiment of each configuration.

    Periods are averaged, and realizations with the same commands. Where an offset is estimated along, commands are
    counted from their first sample, those of a period from their mean: what a constant command does is in the offset.
    """
    commands = commands_of(record, options).values
    # What is moved by speeds or torques need not come back to where it was.
    played = record.input_channels if record.reference is None else record.reference_channels
    holds_position = all(channel.quantity == "position_command" for channel in played)
    absolute = options.offset == "none"
    outputs = record.outputs + record.output_offset[:, None, None, None, None] if absolute else record.outputs
    start = options.start if options.start != "auto" else ("free" if record.is_one_shot else "periodic")
    found = []
    for place, told, repeats in _experiments(commands, outputs):
        answers = repeats.reshape(-1, *repeats.shape[2:])
        zero = 0.0 if absolute else (told.mean(axis=0) if start == "periodic" else told[0])
        shot = Shot(
            inputs=told - zero,
            outputs=answers.mean(axis=0),
            start=start,
            noise_std=_scatter(answers, offset=not absolute),
            repeats=len(answers),
            sampling_period_s=record.sampling_period_s,
            name=", ".join([name, *place_words(place, record.inputs.shape[:3])]),
            offset=not absolute,
            place=", ".join([name, *place_words(place[:1], record.inputs.shape[:1])]),
            quantum=np.array([quantum_of(each) for each in answers[0].T]),
            wander=_wander(repeats) if holds_position else None,
        )
        found.append(shot)
    return tuple(found)


def quantum_of(values: FloatArray) -> float:
    """Returns the step of the grid that values (n_sample,) lie on; 0 where they lie on none."""
    levels = np.unique(values)
    steps = np.diff(levels)
    steps = steps[steps > _ROUNDING * np.abs(levels).max(initial=0.0)]
    if not steps.size:
        return 0.0
    quantum = float(np.median(steps[steps < 1.5 * steps.min()]))
    off = np.abs(steps / quantum - np.round(steps / quantum))
    return quantum if np.mean(off < _OFF_GRID) > _ON_GRID else 0.0


def refuse_unlike(shots: Sequence[Shot]) -> None:
    """Refuses shots that are not sampled alike.

    Raises:
        DataError: If there are such.
    """
    periods = sorted({round(shot.sampling_period_s, 9) for shot in shots})
    if len(periods) > 1:
        message = f"D147 the records of one fit are sampled every {periods[0]:g} and every {periods[-1]:g} s"
        raise DataError(message, where="record", remedy="fit them one by one, or log them alike")


def _experiments(
    commands: FloatArray, outputs: FloatArray
) -> Iterator[tuple[tuple[int, int, int], FloatArray, FloatArray]]:
    """Yields configuration, realization and experiment, the command (n_sample, n_in), and all answers to it.

    These are (n_alike, n_period, n_sample, n_out): periods of one log follow each other, logs do not.
    """
    n_conf, n_real, n_exp = outputs.shape[:3]
    for configuration, experiment in np.ndindex(n_conf, n_exp):
        left = list(range(n_real))
        while left:
            first = left[0]
            told = commands[configuration, :, experiment].mean(axis=1)
            limit = _SAME * np.ptp(told[first], axis=0)
            alike = [one for one in left if (np.abs(told[one] - told[first]) <= limit).all()]
            yield (
                (configuration, first, experiment),
                told[alike].mean(axis=0),
                outputs[configuration, alike, experiment],
            )
            left = [one for one in left if one not in alike]


def _scatter(answers: FloatArray, *, offset: bool) -> FloatArray | None:
    """Standard deviation (n_out,) of the mean of some repeats (n_repeat, n_sample, n_out)."""
    count = len(answers)
    if count < 2:
        return None
    apart = answers - answers.mean(axis=0)
    if offset:
        apart = apart - apart.mean(axis=1, keepdims=True)
    deviation = np.sqrt((apart**2).sum(axis=0).mean(axis=0) / (count - 1) / count)
    return np.asarray(deviation) if deviation.any() else None


def _wander(repeats: FloatArray) -> FloatArray | None:
    """Standard deviation (n_out,) of slow differences between a log's periods (n_alike, n_period, n_sample, n_out)."""
    count, length = repeats.shape[1], repeats.shape[2] // _STRETCHES
    if count < 2 or length < 2:
        return None
    apart = (repeats - repeats.mean(axis=1, keepdims=True))[:, :, : length * _STRETCHES]
    stretches = apart.reshape(-1, _STRETCHES, length, apart.shape[3])
    # Means over stretches keep what is slow; noise from sample to sample leaves 1/length of its variance in them, which
    # is subtracted. One of n periods is taken by their mean.
    levels = stretches.mean(axis=2)
    alone = count / (count - 1) * (levels**2).mean(axis=(0, 1))
    by_noise = stretches.var(axis=2, ddof=1).mean(axis=(0, 1)) * count / (count - 1) / length
    return np.asarray(np.where(alone > _CHANCE * by_noise, np.sqrt(np.maximum(alone - by_noise, 0.0)), 0.0))


def _integrated(values: FloatArray, sampling_period_s: float, hold: str, *, periodic: bool) -> FloatArray:
    """Integrates speeds (..., n_sample, n_in) from zero on; over a whole period they move nowhere."""
    if periodic:
        values = values - values.mean(axis=-2, keepdims=True)
    # A held speed v adds T v until the next sample, one that moves in straight lines the trapezoid.
    ends = values[..., :-1, :]
    steps = ends if hold == "zoh" else 0.5 * (ends + values[..., 1:, :])
    start = np.zeros_like(values[..., :1, :])
    return np.concatenate([start, sampling_period_s * np.cumsum(steps, axis=-2)], axis=-2)


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
    """Compares a block's outputs with what was measured: outputs and errors (n_sample, n_out) of each shot.

    Source:
        Oliveira et al. (2019), Table 2.
    """
    found: list[Agreement] = []
    for place in dict.fromkeys(shot.place for shot in shots):
        chosen = [index for index, shot in enumerate(shots) if shot.place == place]
        there = [shots[index] for index in chosen]
        moved = [measured[index] - measured[index].mean(axis=0) for index in chosen]
        error_std, motion_std = (
            np.sqrt(np.mean(np.concatenate(each) ** 2, axis=0)) for each in ([errors[index] for index in chosen], moved)
        )
        # NRMSE = 1 - |error| / |motion|, and R^2 = 1 - |error|^2 / |motion|^2.
        left = np.divide(error_std, motion_std, out=np.full(len(names), np.inf), where=motion_std > 0)
        noise = _noise(there, outputs), _noise(there, outputs, single=True)
        amplitude = max(float(np.abs(shot.inputs[:, list(inputs)]).max()) for shot in there)
        columns = (each.tolist() for each in (left, error_std, motion_std, *noise))
        found += [
            Agreement(name, place, 1 - off, 1 - off**2, error, motion, scatter, amplitude, single)
            for name, off, error, motion, scatter, single in zip(names, *columns, strict=True)
        ]
    return tuple(found)


def _noise(shots: Sequence[Shot], outputs: Sequence[int], *, single: bool = False) -> FloatArray:
    known = [
        shot.noise_std[list(outputs)] * (np.sqrt(shot.repeats) if single else 1.0)
        for shot in shots
        if shot.noise_std is not None
    ]
    return np.sqrt(np.mean(np.square(known), axis=0)) if known else np.full(len(outputs), np.nan)
