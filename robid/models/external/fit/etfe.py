"""The empirical response where commands excite, with a confidence radius, and what the commands contain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.stats import f as f_distribution

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray, Quantity
from robid.models.external.fit.data import Shot

_PER_DECADE = 60
_ORDER = 2  # of the local polynomials
_FREEDOM = 10  # rows beyond the coefficients of a window
_DENSE = 0.5
_RANK = 1e-9
_ROUNDING = 1e-9
_LARGEST = 0.1  # of a command's largest component

_RESPONSE = "frequency output input"


@dataclass(frozen=True)
class Etfe:
    """Empirical response of every output to every command; NaN where a command was not excited."""

    frequency_hz: Annotated[FloatArray, Quantity("Hz", "frequency")]
    # Output over command
    response: Annotated[ComplexArray, Quantity("output over input", _RESPONSE, "Empirical response")]
    radius: Annotated[FloatArray, Quantity("output over input", _RESPONSE, "Its confidence radius")]


@dataclass(frozen=True)
class _Group:
    """DFT amplitudes of shots that are read together."""

    inputs: ComplexArray  # (n_shot, n_line, n_in)
    outputs: ComplexArray  # (n_shot, n_line, n_out)
    spacing_hz: float
    settled: bool  # whether shots are periods, without a transient
    lines: IntArray  # those that are used
    moved: IntArray  # indices of the commands that move

    @property
    def n_column(self) -> int:
        return (_ORDER + 1) * (len(self.moved) + (0 if self.settled else len(self.inputs)))


def estimate_etfe(shots: Sequence[Shot], floor: FloatArray, confidence: float) -> Etfe:
    """Estimates the empirical response over the band that was excited.

    Around each frequency the ratio of the spectra is a polynomial of second order; what a state at the beginning of a
    single shot adds is another one. What both leave is the noise. Shots are merged by the inverse of their variance. A
    component counts as excited from the amplitude `floor` (n_in,) on, in the commands' units.

    Source:
        Oliveira et al. (2019), sec. 3.3, with local polynomials after Pintelon and Schoukens (2012), ch. 7.
    """
    groups = [_group(group, floor) for group in together(shots, floor)]
    grid = _grid(groups)
    n_out, n_in = shots[0].outputs.shape[1], shots[0].inputs.shape[1]
    weighted, weight = np.zeros((grid.size, n_out, n_in), complex), np.zeros((grid.size, n_out, n_in))
    freedom = np.zeros_like(weight)
    for group in groups:
        for index in np.flatnonzero(_within(grid, group)):
            local = _local(group, grid[index] / group.spacing_hz)
            if local is not None:
                response, variance, left = local
                weighted[index][:, group.moved] += response / variance
                weight[index][:, group.moved] += 1 / variance
                freedom[index][:, group.moved] += left
    known = weight > 0
    response = np.divide(weighted, weight, out=np.full_like(weighted, np.nan), where=known)
    # |G_hat - G|^2 over an estimated variance is F distributed with 2 and 2 nu degrees of freedom: the radius of a
    # circle.
    quantile = f_distribution.ppf(confidence, 2, 2 * np.maximum(freedom, 1))
    radius = np.sqrt(np.divide(quantile, weight, out=np.full_like(weight, np.nan), where=known))
    return Etfe(grid, response, radius)


def floors(shots: Sequence[Shot], resolution: FloatArray) -> FloatArray:
    """Returns the amplitude (n_in,) of a component from which on it counts as excited.

    It is the robot's resolution, but no more than a tenth of the command's largest component. The resolutions (n_in,)
    are infinite where there are none.
    """
    largest = np.max([np.abs(_amplitudes(shot.inputs)).max(axis=0) for shot in shots], axis=0)
    return np.asarray(np.minimum(resolution, _LARGEST * largest))


def moved_inputs(shot: Shot, floor: FloatArray) -> BoolArray:
    """Tells which commands (n_in,) move in a shot by more than a floor (n_in,)."""
    return np.asarray(np.ptp(shot.inputs, axis=0) > floor)


def together(shots: Sequence[Shot], floor: FloatArray) -> list[list[Shot]]:
    """Groups shots that only together tell commands apart: those of one place with several moving commands."""
    groups: dict[tuple[object, ...], list[Shot]] = {}
    for index, shot in enumerate(shots):
        alone = moved_inputs(shot, floor).sum() <= 1
        key = (index,) if alone else (shot.place, len(shot.inputs), shot.start)
        groups.setdefault(key, []).append(shot)
    return list(groups.values())


def _group(shots: Sequence[Shot], floor: FloatArray) -> _Group:
    inputs, outputs = (
        np.array([_amplitudes(values) for values in each])
        for each in zip(*((s.inputs, s.outputs) for s in shots), strict=True)
    )
    above = (np.abs(inputs) > floor).any(axis=(0, 2))
    above[0] = False
    lines, settled = np.flatnonzero(above), shots[0].start == "periodic"
    # Between the lines of a single shot there is signal too.
    if lines.size and (not settled or lines.size > _DENSE * (lines[-1] - lines[0] + 1)):
        lines = np.arange(lines[0], lines[-1] + 1)
    moved = np.flatnonzero(np.any([moved_inputs(shot, floor) for shot in shots], axis=0))
    spacing_hz = 1 / (len(shots[0].inputs) * shots[0].sampling_period_s)
    return _Group(inputs, outputs, spacing_hz, settled, lines, moved)


def _amplitudes(values: FloatArray) -> ComplexArray:
    return np.asarray(2 / len(values) * np.fft.rfft(values - values.mean(axis=0), axis=0))


def _grid(groups: Sequence[_Group]) -> FloatArray:
    """Frequencies (n_freq,) of all bands: lines where these are sparse, evenly on a logarithmic axis else [Hz]."""
    every = [group.spacing_hz * group.lines for group in groups if group.lines.size]
    if not every:
        return np.zeros(0)
    frequency = np.unique(np.concatenate(every))
    place = np.floor(np.log10(frequency / frequency[0]) * _PER_DECADE + _ROUNDING)
    return np.asarray(frequency[np.unique(place, return_index=True)[1]])


def _within(grid: FloatArray, group: _Group) -> BoolArray:
    if not group.lines.size:
        return np.zeros(grid.size, bool)
    low, high = (group.lines[[0, -1]] + [-0.5, 0.5]) * group.spacing_hz
    return np.asarray((grid >= low) & (grid <= high))


def _local(group: _Group, centre: float) -> tuple[ComplexArray, FloatArray, int] | None:
    """Fits the local polynomials around one place among the lines.

    Returns response and variance (n_out, n_moved) and the degrees of freedom of that; None where there are too few
    lines, or commands cannot be told apart.
    """
    width = int(np.ceil((group.n_column + _FREEDOM) / len(group.inputs)))
    if width > group.lines.size:
        return None
    first = min(max(int(np.searchsorted(group.lines, centre)) - width // 2, 0), group.lines.size - width)
    window = group.lines[first : first + width]
    offset = (window - centre) / np.abs(window - centre).max()
    # Y(k) = sum_i G_i(k) U_i(k) + T(k), G_i and the transient T each a polynomial of second order in the distance from
    # the centre.
    regressor = _regressor(group, window, offset[:, None] ** np.arange(_ORDER + 1))
    measured = group.outputs[:, window].reshape(-1, group.outputs.shape[2])
    scale = np.linalg.norm(regressor, axis=0)
    if not scale.all():
        return None
    left, values, right = np.linalg.svd(regressor / scale, full_matrices=False)
    if values[-1] < _RANK * values[0]:
        return None
    inverse = (right.conj().T / values) @ left.conj().T / scale[:, None]
    freedom = len(measured) - regressor.shape[1]
    found = inverse @ measured
    # What is left over the degrees of freedom is the noise of a line; the constant terms of G_i are its responses at
    # the centre.
    noise = (np.abs(measured - regressor @ found) ** 2).sum(axis=0) / freedom
    constant = np.arange(len(group.moved)) * (_ORDER + 1)
    gain = (np.abs(inverse[constant]) ** 2).sum(axis=1)
    return found[constant].T, np.maximum(noise[:, None] * gain, np.finfo(float).tiny), freedom


def _regressor(group: _Group, window: IntArray, powers: FloatArray) -> ComplexArray:
    """Columns of the commands' polynomials, then those of each shot's transient; rows shot by shot."""
    told = group.inputs[:, window][:, :, group.moved, None] * powers[:, None, :]
    columns = told.reshape(-1, told.shape[2] * told.shape[3])
    if group.settled:
        return np.asarray(columns)
    return np.asarray(np.hstack([columns, np.kron(np.eye(len(group.inputs)), powers)]))


_SAMPLES = 2000


@dataclass(frozen=True)
class Excitation:
    """Commands and their own outputs in the shots that move them."""

    names: Annotated[tuple[str, ...], Quantity("1", "own_channel", "Channels, one a command")]
    shots: Annotated[tuple[str, ...], Quantity("1", "shot", "Names of the shots")]
    time_channel: Annotated[IntArray, Quantity("1", "sample", "Index into names")]
    time_shot: Annotated[IntArray, Quantity("1", "sample", "Index into shots")]
    time_s: Annotated[FloatArray, Quantity("s", "sample")]  # time since the shot began
    command: Annotated[FloatArray, Quantity("as of the command", "sample", "What was commanded", compact=True)]
    # Output, less its mean in a period, less its first value in a shot, where it has an offset.
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
    """A command and the output that it is meant for."""

    name: str  # name of the channel
    input: int  # index of the command
    output: int  # index of the output


def show_excitation(
    shots: Sequence[Shot],
    channels: Sequence[OwnChannel],
    floor: FloatArray,
    input_resolution: FloatArray,
    output_resolution: FloatArray,
) -> Excitation:
    """Gathers what each command did in the shots that move it.

    A command moves from the amplitude `floor` (n_in,) on; resolutions (n_in,) and (n_out,) are in the signals' units.

    Source:
        Oliveira et al. (2019), Fig. 5.
    """
    times, lines = [], []
    for place, channel in enumerate(channels):
        for index, shot in enumerate(shots):
            if moved_inputs(shot, floor)[channel.input]:
                course, spectrum = _course(shot, channel)
                times.append(_labelled(place, index, course))
                lines.append(_labelled(place, index, spectrum))
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


def _course(shot: Shot, channel: OwnChannel) -> tuple[FloatArray, FloatArray]:
    """Command and answer of a channel over time, thinned (3, n_time), and their spectra (3, n_line)."""
    command, answer = shot.inputs[:, channel.input], shot.outputs[:, channel.output]
    level = answer.mean() if shot.start == "periodic" else answer[0]
    shown = answer - level if shot.offset else answer
    kept = np.arange(0, len(command), max(1, -(-len(command) // _SAMPLES)))
    course = np.stack([kept * shot.sampling_period_s, command[kept], shown[kept]])
    return course, _spectrum(command, answer, shot.sampling_period_s)


def _labelled(place: int, shot: int, rows: FloatArray) -> FloatArray:
    return np.vstack([np.full(rows.shape[1], place), np.full(rows.shape[1], shot), rows])


def _spectrum(command: FloatArray, answer: FloatArray, period_s: float) -> FloatArray:
    """Frequency and amplitudes of command and output (3, n), the largest of lines that lie closely."""
    both = np.stack([command, answer])
    size = 2 / len(command) * np.abs(np.fft.rfft(both - both.mean(axis=1, keepdims=True), axis=1))[:, 1:]
    frequency = np.fft.rfftfreq(len(command), period_s)[1:]
    place = np.floor(np.log10(frequency / frequency[0]) * _PER_DECADE)
    first = np.flatnonzero(np.diff(place, prepend=-1))
    return np.stack([frequency[first], *np.maximum.reduceat(size, first, axis=1)])
