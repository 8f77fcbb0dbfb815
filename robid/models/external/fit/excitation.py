"""What was commanded and what came of it, over time and over frequency, thinned to what a page can draw."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import FloatArray, IntArray, Quantity
from robid.models.external.fit.data import Shot
from robid.models.external.fit.etfe import moved_inputs

_SAMPLES = 2000
_PER_DECADE = 60


@dataclass(frozen=True)
class Excitation:
    """Commands and their own outputs in the shots that move them.

    Attributes:
        time_s: Time since the shot began.
        answer: Output, less its mean in a period, less its first value in a shot, where it has an offset.
    """

    names: Annotated[tuple[str, ...], Quantity("1", "own_channel", "Channels, one a command")]
    shots: Annotated[tuple[str, ...], Quantity("1", "shot", "Names of the shots")]
    time_channel: Annotated[IntArray, Quantity("1", "sample", "Index into names")]
    time_shot: Annotated[IntArray, Quantity("1", "sample", "Index into shots")]
    time_s: Annotated[FloatArray, Quantity("s", "sample")]
    command: Annotated[FloatArray, Quantity("as of the command", "sample", "What was commanded", compact=True)]
    answer: Annotated[FloatArray, Quantity("as of the output", "sample", "What came of it", compact=True)]
    line_channel: Annotated[IntArray, Quantity("1", "component", "Index into names")]
    line_shot: Annotated[IntArray, Quantity("1", "component", "Index into shots")]
    frequency_hz: Annotated[FloatArray, Quantity("Hz", "component")]
    command_amplitude: Annotated[FloatArray, Quantity("as of the command", "component", "Largest around it")]
    answer_amplitude: Annotated[FloatArray, Quantity("as of the output", "component", "Largest around it")]
    command_resolution: Annotated[FloatArray, Quantity("as of the command", "own_channel")]
    answer_resolution: Annotated[FloatArray, Quantity("as of the output", "own_channel")]


@dataclass(frozen=True)
class OwnChannel:
    """A command and the output that it is meant for.

    Attributes:
        name: Name of the channel.
        input: Index of the command.
        output: Index of the output.
    """

    name: str
    input: int
    output: int


def show_excitation(
    shots: Sequence[Shot],
    channels: Sequence[OwnChannel],
    floor: FloatArray,
    input_resolution: FloatArray,
    output_resolution: FloatArray,
) -> Excitation:
    """Gathers what each command did in the shots that move it.

    Args:
        shots: What was recorded.
        channels: A channel of each command.
        floor (n_in,): Amplitude from which on a command counts as moving.
        input_resolution (n_in,): Resolution of each command, in its unit.
        output_resolution (n_out,): The same of each output.

    Source:
        Oliveira et al. (2019), Fig. 5.
    """
    times, lines = [], []
    for place, channel in enumerate(channels):
        for index, shot in enumerate(shots):
            if moved_inputs(shot, floor)[channel.input]:
                command, answer = shot.inputs[:, channel.input], shot.outputs[:, channel.output]
                level = answer.mean() if shot.start == "periodic" else answer[0]
                shown = answer - level if shot.offset else answer
                times.append(_labelled(place, index, _course(command, shown, shot.sampling_period_s)))
                lines.append(_labelled(place, index, _spectrum(command, answer, shot.sampling_period_s)))
    time, line = (np.concatenate(each, axis=1) if each else np.zeros((5, 0)) for each in (times, lines))
    return Excitation(
        names=tuple(channel.name for channel in channels),
        shots=tuple(shot.name for shot in shots),
        time_channel=time[0].astype(int),
        time_shot=time[1].astype(int),
        time_s=time[2],
        command=time[3],
        answer=time[4],
        line_channel=line[0].astype(int),
        line_shot=line[1].astype(int),
        frequency_hz=line[2],
        command_amplitude=line[3],
        answer_amplitude=line[4],
        command_resolution=input_resolution[[channel.input for channel in channels]],
        answer_resolution=output_resolution[[channel.output for channel in channels]],
    )


def _labelled(place: int, shot: int, rows: FloatArray) -> FloatArray:
    """Channel and shot above rows (3, n)."""
    return np.vstack([np.full(rows.shape[1], place), np.full(rows.shape[1], shot), rows])


def _course(command: FloatArray, answer: FloatArray, period_s: float) -> FloatArray:
    """Time, command and output (3, n)."""
    kept = np.arange(0, len(command), max(1, -(-len(command) // _SAMPLES)))
    return np.stack([kept * period_s, command[kept], answer[kept]])


def _spectrum(command: FloatArray, answer: FloatArray, period_s: float) -> FloatArray:
    """Frequency and amplitudes of command and output (3, n), the largest of lines that lie closely."""
    both = np.stack([command, answer])
    size = 2 / len(command) * np.abs(np.fft.rfft(both - both.mean(axis=1, keepdims=True), axis=1))[:, 1:]
    frequency = np.fft.rfftfreq(len(command), period_s)[1:]
    place = np.floor(np.log10(frequency / frequency[0]) * _PER_DECADE)
    first = np.flatnonzero(np.diff(place, prepend=-1))
    return np.stack([frequency[first], *np.maximum.reduceat(size, first, axis=1)])
