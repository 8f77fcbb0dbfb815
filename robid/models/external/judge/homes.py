"""How far the transfer functions of one home position differ from those of another."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.fit.uncertainty import response_deviation

_FREQUENCIES = 200
_DEVIATIONS = 3.0


@dataclass(frozen=True)
class HomeDifference:
    """Where a channel differs most between two fits, in the band that both excited.

    Attributes:
        channel: Name of the channel.
        relative: Largest distance of the responses over their mean magnitude.
        at_hz: Frequency of it [Hz].
        magnitude_db: Difference of the magnitudes there [dB].
        phase_deg: Difference of the phases there [deg].
        significant: Whether it is beyond three deviations of both.
    """

    channel: str
    relative: float
    at_hz: float
    magnitude_db: float
    phase_deg: float
    significant: bool


def compare_homes(one: ExternalSolution, other: ExternalSolution) -> Iterator[HomeDifference]:
    """Compares the channels that two fits have in common; those without a common band are left out."""
    for name in one.transfers.names:
        if name not in other.transfers.names:
            continue
        bands = [_band(each, name) for each in (one, other)]
        low, high = max(band[0] for band in bands), min(band[1] for band in bands)
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


def _band(solution: ExternalSolution, name: str) -> tuple[float, float]:
    block, _ = _place(solution, name)
    return float(solution.quality.lowest_hz[block]), float(solution.quality.highest_hz[block])


def _response(solution: ExternalSolution, name: str, frequency_hz: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """Response (n_freq,) of a channel from samples to samples, and its deviation over its magnitude."""
    block, place = _place(solution, name)
    model, omega = solution.transfer(block), 2 * np.pi * frequency_hz
    found = response_deviation(model, solution.transfers.root_of(block), omega, sampled=True).largest
    whole = model.sampled_response(omega)
    return whole.reshape(len(omega), -1)[:, place], found.reshape(len(omega), -1)[:, place]
