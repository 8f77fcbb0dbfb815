"""Whether new motions are what the fit has seen: band, amplitude, the motion itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.judge.prediction import NewShots
from robid.results.doubt import Doubt

_OUTSIDE = 0.02  # of a motion's power
_LARGER = 1.2
_SAME = 0.01  # of the motion


def novelty_doubts(solution: ExternalSolution, found: Sequence[NewShots]) -> Iterator[Doubt]:
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
            yield Doubt("band", told, decisive=False, strength=share / _OUTSIDE)
        before = max(each.amplitude for each in solution.agreements if each.output in one.names)
        ratio = max(float(np.abs(shot.inputs[:, list(one.inputs)]).max()) for shot in one.shots) / before
        if ratio > _LARGER:
            told = f"the new motion of {name} is {ratio:.2g} times as large as any of its fit"
            yield Doubt("band", told, decisive=False, strength=ratio / _LARGER)
        if any(_seen(solution, int(first[one.block]) + place, shot.outputs[:, output])
               for shot in one.shots for place, output in enumerate(one.outputs)):  # fmt: skip
            told = f"the validation repeats a motion of the fit of {name}: it says nothing of other motions"
            yield Doubt("same_motion", told, decisive=False, strength=2.0)


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
