"""Which outputs are fitted to which commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robid.errors import DataError
from robid.models.external.fit.options import ExternalOptions
from robid.signals.quantities import Channel, channel_names


@dataclass(frozen=True)
class Block:
    """Channels with common poles and one delay; a single channel mostly.

    Attributes:
        name: Its name, which those of its parameters begin with.
        inputs: Indices of its commands.
        outputs: Indices of its outputs.
    """

    name: str
    inputs: tuple[int, ...]
    outputs: tuple[int, ...]

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
            message = f"the record has no {place} `{unknown[0]}`; it has {', '.join(known)}"
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
        message = f"no output has the name of a command: {', '.join(inputs)} go in, {', '.join(outputs)} come out"
        raise DataError(message, where="record", remedy="name input and output of each channel in `pairs`")
    return tuple(pairs[one] for one in inputs if one in pairs)


def _second(pairs: Sequence[tuple[str, str]]) -> list[str]:
    return [pair[1] for pair in pairs]
