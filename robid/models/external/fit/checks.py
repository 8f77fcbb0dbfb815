"""The channels of a fit, what keeps one from being fitted, and what makes what comes of it doubtful."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.external.fit.data import Shot
from robid.models.external.fit.etfe import Etfe, moved_inputs
from robid.models.external.fit.options import ExternalOptions
from robid.signals.quantities import Channel, channel_names


@dataclass(frozen=True)
class Block:
    """Channels with common poles and one delay; a single channel mostly."""

    name: str  # its name, which those of its parameters begin with
    inputs: tuple[int, ...]  # indices of its commands
    outputs: tuple[int, ...]  # indices of its outputs

    @property
    def is_single(self) -> bool:
        """Whether it has one command and one output."""
        return len(self.inputs) == len(self.outputs) == 1


def blocks_of(inputs: Sequence[Channel], outputs: Sequence[Channel], options: ExternalOptions) -> tuple[Block, ...]:
    """Returns the channels of a fit.

    Without explicit pairs an input goes with the output of its name, or with that of its arm; a single input goes
    with all outputs.

    Raises:
        DataError: If an explicit pair names a channel that is not there, or no output has an input's name.
    """
    given, found = channel_names(inputs), channel_names(outputs)
    pairs = options.pairs or _by_name(given, found)
    for place, names, known in (("input", [pair[0] for pair in pairs], given), ("output", _second(pairs), found)):
        unknown = [name for name in names if name not in known]
        if unknown:
            message = f"D139 the record has no {place} `{unknown[0]}`; it has {', '.join(known)}"
            raise DataError(message, where="record", remedy="name its own channels in `pairs`")
    if options.matrix == "full":
        everything = tuple(given.index(name) for name in dict.fromkeys(pair[0] for pair in pairs))
        answers = tuple(found.index(name) for name in dict.fromkeys(_second(pairs)))
        return (Block("matrix", everything, answers),)
    alone = len({pair[0] for pair in pairs}) == 1
    return tuple(
        Block(pair_name(one, other, alone=alone), (given.index(one),), (found.index(other),)) for one, other in pairs
    )


def is_own(command: str, answer: str) -> bool:
    """Whether an output is that of a command's own name, or of its arm side."""
    return answer in (command, f"{command}.arm")


def pair_name(command: str, answer: str, *, alone: bool = False) -> str:
    """Returns the name of one channel: its own, or `output/input` where these differ."""
    if alone or is_own(command, answer):
        return answer
    return f"{answer}/{command}"


def _by_name(inputs: Sequence[str], outputs: Sequence[str]) -> tuple[tuple[str, str], ...]:
    if len(inputs) == 1:
        return tuple((inputs[0], output) for output in outputs)
    named = [(one, other) for one in inputs for other in (one, f"{one}.arm") if other in outputs]
    pairs = {one: (one, other) for one, other in reversed(named)}
    if not pairs:
        message = f"D140 no output has the name of a command: {', '.join(inputs)} go in, {', '.join(outputs)} come out"
        raise DataError(message, where="record", remedy="name input and output of each channel in `pairs`")
    return tuple(pairs[one] for one in inputs if one in pairs)


def _second(pairs: Sequence[tuple[str, str]]) -> list[str]:
    return [pair[1] for pair in pairs]


ChannelFindingKind = Literal["left_out", "quantised", "stuck", "mixed", "unsteady"]

_FEWEST_STEPS, _FEW_STEPS = 3.0, 20.0
_STUCK_SAMPLES, _STUCK_MOTION, _DWELL = 4, 0.05, 3.0
_STUCK_SHARE = 0.05
_SAMPLES_PER_PARAMETER = 10
_MIXED = 0.05  # of an output's motion
_UNSTEADY, _TOO_UNSTEADY = 0.01, 0.05  # of an output's motion


@dataclass(frozen=True)
class ChannelFinding:
    """Something about a channel's data that a reader must know."""

    kind: ChannelFindingKind
    channel: str
    message: str  # what was seen, a clause without a full stop
    decisive: bool  # whether nothing that follows may be used while it stands
    strength: float  # how far beyond what is normal


def usable_blocks(
    blocks: Sequence[Block], shots: Sequence[Shot], floor: FloatArray, names: Sequence[str], options: ExternalOptions
) -> tuple[tuple[Block, ...], tuple[ChannelFinding, ...]]:
    """Leaves out channels whose command never moves; refuses what cannot be fitted.

    A command moves from the motion `floor` (n_in,) on.

    Raises:
        DataError: If no channel is left, one that was asked for never moves, an output rests, is quantised to nothing,
            or the record is too short.
    """
    kept, found = [], []
    for whole in blocks:
        block, told = _moving_part(whole, shots, floor, names)
        found += told
        used = shots_for(block, shots, floor)
        if not used and not options.pairs and len(blocks) > 1:
            told = [ChannelFinding("left_out", block.name, "was never excited: left out", decisive=False, strength=0.5)]
            found += told
            continue
        if not used:
            message = f"D141 the command of {block.name} never moves: nothing of it can be identified"
            raise DataError(message, where="record", remedy="excite it, or leave it out of `pairs`")
        for output in block.outputs:
            _refuse_resting(names[output], [shot.outputs[:, output] for shot in used], _quanta(used, output))
        _refuse_short(block, used, options)
        kept.append(block)
    if not kept:
        message = "D142 no command of the record moves: nothing can be identified"
        raise DataError(message, where="record", remedy="excite a channel, or check which inputs are its commands")
    return tuple(kept), tuple(found)


def _moving_part(
    block: Block, shots: Sequence[Shot], floor: FloatArray, names: Sequence[str]
) -> tuple[Block, list[ChannelFinding]]:
    """Leaves out of a matrix the commands that never move, and the outputs that never do."""
    if block.is_single:
        return block, []
    inputs = [index for index in block.inputs if any(moved_inputs(shot, floor)[index] for shot in shots)]
    outputs = [index for index in block.outputs if any(np.ptp(shot.outputs[:, index]) > 0 for shot in shots)]
    found = [
        ChannelFinding("left_out", block.name, f"{names[index]} never moves: left out", decisive=False, strength=0.5)
        for index in block.outputs
        if index not in outputs
    ]
    lost = len(block.inputs) - len(inputs)
    if lost:
        told = f"{lost} of {len(block.inputs)} commands never move: left out"
        found.append(ChannelFinding("left_out", block.name, told, decisive=False, strength=0.5))
    return replace(block, inputs=tuple(inputs), outputs=tuple(outputs)), found


def shots_for(block: Block, shots: Sequence[Shot], floor: FloatArray) -> tuple[Shot, ...]:
    """Returns the shots in which a command of a channel moves."""
    places = list(block.inputs)
    return tuple(shot for shot in shots if moved_inputs(shot, floor)[places].any())


def signal_findings(block: Block, shots: Sequence[Shot], names: Sequence[str]) -> Iterator[ChannelFinding]:
    """Yields what is doubtful about the outputs of a channel in the shots in which it moves."""
    for output in block.outputs:
        steps = max(
            _steps(shot.outputs[:, output], quantum)
            for shot, quantum in zip(shots, _quanta(shots, output), strict=True)
        )
        if steps < _FEW_STEPS:
            told = f"{names[output]} moves by {steps:.3g} steps of its resolution only"
            yield ChannelFinding("quantised", block.name, told, decisive=False, strength=_FEW_STEPS / steps)
        worst = max(shots, key=lambda shot: _stuck(shot, output, block.inputs))
        share = _stuck(worst, output, block.inputs)
        if share > 0:
            told = (
                f"{names[output]} stands still at its extreme for {share:.2g} of `{worst.name}` while its command moves"
                " on, as if it were saturated"
            )
            yield ChannelFinding(
                "stuck", block.name, told, decisive=share > _STUCK_SHARE, strength=1 + share / _STUCK_SHARE
            )


def unsteady_findings(block: Block, shots: Sequence[Shot], names: Sequence[str]) -> Iterator[ChannelFinding]:
    """Yields outputs of a channel whose periods differ by more than noise."""
    for output in block.outputs:
        share = {
            shot.name: float(shot.wander[output]) / max(float(shot.outputs[:, output].std()), 1e-300)
            for shot in shots
            if shot.wander is not None
        }
        worst = max(share, key=lambda name: share[name], default=None)
        if worst is not None and share[worst] > _UNSTEADY:
            told = (
                f"periods of {names[output]} in `{worst}` lie apart by {share[worst]:.2g} of its motion: leave out the "
                "first ones (`drop_periods`) where the robot had not settled"
            )
            decisive, strength = share[worst] > _TOO_UNSTEADY, share[worst] / _UNSTEADY
            yield ChannelFinding("unsteady", block.name, told, decisive=decisive, strength=strength)


def mixed_findings(block: Block, shots: Sequence[Shot], floor: FloatArray, etfe: Etfe) -> Iterator[ChannelFinding]:
    """Yields shots in which commands of other channels move an output too, which a fit of its own cannot know."""
    worst: tuple[float, Shot, int] | None = None
    for shot in shots:
        others = np.setdiff1d(np.flatnonzero(moved_inputs(shot, floor)), block.inputs)
        for output, other in ((output, other) for output in block.outputs for other in others.tolist()):
            share = _reaching(shot, output, other, etfe) / max(float(shot.outputs[:, output].std()), 1e-300)
            if worst is None or share > worst[0]:
                worst = share, shot, other
    if worst is not None and worst[0] > _MIXED:
        told = (
            f"another command moves along in `{worst[1].name}` and makes {worst[0]:.2g} of the output's motion: fit "
            "them together (`matrix: full`), or move one after the other"
        )
        yield ChannelFinding("mixed", block.name, told, decisive=False, strength=worst[0] / _MIXED)


def _reaching(shot: Shot, output: int, command: int, etfe: Etfe) -> float:
    """Root mean square of what of an output is another command's doing, by the empirical response."""
    told = shot.inputs[:, command]
    amplitude = np.abs(np.fft.rfft(told - told.mean())) / len(told)
    frequency_hz = np.fft.rfftfreq(len(told), shot.sampling_period_s)
    gain = np.abs(etfe.response[:, output, command])
    known = np.isfinite(gain)
    if not known.any():
        return 0.0
    there = np.interp(frequency_hz, etfe.frequency_hz[known], gain[known], left=0.0, right=0.0)
    return float(np.sqrt(2 * np.sum((amplitude * there) ** 2)))


def _refuse_resting(name: str, signals: Sequence[FloatArray], quanta: Sequence[float]) -> None:
    largest = max(np.abs(signal).max() for signal in signals)
    if max(np.ptp(signal) for signal in signals) <= 1e-9 * largest:
        message = f"D143 {name} never moves although its command does: nothing of it can be identified"
        raise DataError(message, where="record", remedy="check the channel's mapping, or leave it out of `pairs`")
    steps = max(_steps(signal, quantum) for signal, quantum in zip(signals, quanta, strict=True))
    if steps < _FEWEST_STEPS:
        message = f"D144 {name} moves by {steps:.2g} steps of its resolution: quantised to nothing"
        remedy = "excite it with a larger amplitude, see whether channels are swapped, or leave it out of `pairs`"
        raise DataError(message, where="record", remedy=remedy)


def _refuse_short(block: Block, shots: Sequence[Shot], options: ExternalOptions) -> None:
    poles = options.poles or 1
    zeros = poles - 1 if options.zeros is None else options.zeros
    n_parameter = poles + len(block.inputs) * len(block.outputs) * ((zeros if options.poles else 0) + 1)
    n_sample = sum(len(shot.outputs) for shot in shots) * len(block.outputs)
    delay = options.max_delay_samples if options.delay_samples is None else options.delay_samples
    reach = delay + options.moving_average
    needed = max(_SAMPLES_PER_PARAMETER * n_parameter, 4 * reach)
    if n_sample < needed:
        message = f"D145 {n_sample} samples of {block.name} are too short a record for {n_parameter} parameters"
        fewer = ", or ask for fewer poles" if options.poles else ""
        raise DataError(message, where="record", remedy=f"record at least {needed} samples{fewer}")


def _quanta(shots: Sequence[Shot], output: int) -> list[float]:
    return [0.0 if shot.quantum is None else float(shot.quantum[output]) for shot in shots]


def _steps(signal: FloatArray, quantum: float) -> float:
    return float(np.ptp(signal)) / quantum if quantum > 0 else np.inf


def _stuck(shot: Shot, output: int, inputs: Sequence[int]) -> float:
    """Share of a shot that an output stands still at an extreme while its commands move by more than it would show."""
    answer, quantum = shot.outputs[:, output], _quanta([shot], output)[0]
    size, told = np.ptp(answer), shot.inputs[:, list(inputs)]
    moved = np.ptp(told, axis=0).max()
    if not size or not moved:
        return 0.0
    # An unsaturated motion dwells at a turning point for as long as it changes by less than a step.
    allowed = max(_STUCK_MOTION, _DWELL * np.sqrt(0.5 * quantum / size))
    most = 0
    for extreme in (answer.min(), answer.max()):
        flags = np.abs(answer - extreme) <= max(0.5 * quantum, 1e-9 * size)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int))).tolist()
        for first, last in zip(edges[::2], edges[1::2], strict=True):
            if last - first >= _STUCK_SAMPLES and np.ptp(told[first:last], axis=0).max() / moved > allowed:
                most += last - first
    return most / len(answer)
