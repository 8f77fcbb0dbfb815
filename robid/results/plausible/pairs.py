"""Channels of a record that measure the same motion: how many times one is what the other says."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.robot.description import Robot
from robid.signals.quantities import QUANTITIES
from robid.signals.record import Record

_CARRIED = 0.9
"""Share of a signal's power in the lines that are compared."""

_ALIKE = 0.9
_LONGEST = 1 << 16


@dataclass(frozen=True)
class Pair:
    """Two channels of one joint's motion.

    Attributes:
        first: Index of an output.
        second: Index of another.
        ratio: First over second, brought to the same derivative and side; 1 where both are right.
        relative_std: Its relative standard deviation.
        derivatives: Derivatives of the first less those of the second, by which a wrong time tells.
    """

    first: int
    second: int
    ratio: float
    relative_std: float
    derivatives: int


def pairs_of(record: Record, robot: Robot) -> list[Pair]:
    """Compares all channels of each joint's motion, at the lines that carry the power of their motion.

    Args:
        record: The record.
        robot: The robot, by whose gear ratios sides are compared.
    """
    names = [joint.name for joint in robot.joints]
    found = []
    for joint, ratio in zip(names, robot.gear_ratio.tolist(), strict=True):
        own = list(_motions(record, joint))
        for place, first in enumerate(own):
            for second in own[place + 1 :]:
                pair = _pair(record, first, second, abs(ratio))
                if pair is not None:
                    found.append(pair)
    return found


def _motions(record: Record, joint: str) -> Iterator[int]:
    """Outputs that are motions of a joint: its own and those named after it, `<joint>.arm`, `<joint>.speed`."""
    for index, channel in enumerate(record.output_channels):
        if (
            channel.name.partition(".")[0] == joint
            and channel.side != "tool"
            and QUANTITIES[channel.quantity].derivatives is not None
        ):
            yield index


def _pair(record: Record, first: int, second: int, ratio: float) -> Pair | None:
    channels = record.output_channels[first], record.output_channels[second]
    orders = [2 - (QUANTITIES[channel.quantity].derivatives or 0) for channel in channels]
    spectra = [_spectrum(record, index) for index in (first, second)]
    omega = 2 * np.pi * np.fft.rfftfreq(2 * (spectra[0].shape[-1] - 1), record.sampling_period_s)
    # The one with the higher derivative is compared with the other, differentiated: noise grows in the latter alone.
    low, high = (1, 0) if orders[0] > orders[1] else (0, 1)
    x = spectra[high]
    y = spectra[low] * (1j * omega) ** (orders[high] - orders[low])
    at = _strongest(x)
    x, y = x[..., at], y[..., at]
    power = float((np.abs(x) ** 2).sum())
    size = float(np.sqrt(power * (np.abs(y) ** 2).sum()))
    if size == 0:
        return None
    cross = np.conj(x) * y
    slope = complex(cross.sum()) / power
    if abs(slope) * power < _ALIKE * size:
        return None
    left = float((np.abs(y - slope * x) ** 2).sum()) / max(x.size - 1, 1)
    value, std = abs(slope), float(np.sqrt(left / power)) / abs(slope)
    # `y` is the lower order's motion, differentiated, over the higher order's.
    over = value if low == 0 else 1 / value
    sides = [channel.side for channel in channels]
    side = {("motor", "arm"): 1 / ratio, ("arm", "motor"): ratio}.get((sides[0], sides[1]), 1.0)
    return Pair(first, second, over * side, std, orders[1] - orders[0])


def _spectrum(record: Record, index: int) -> ComplexArray:
    """Spectra (n_shot, n_freq) of a channel of each experiment, windowed, its mean and trend taken out."""
    values = record.outputs[..., index].mean(axis=3)
    values = values.reshape(-1, values.shape[-1])[:, :_LONGEST]
    values = values[:, : values.shape[1] // 2 * 2]
    time = np.linspace(-1, 1, values.shape[1])
    values = values - values.mean(axis=1, keepdims=True)
    values = values - np.outer(values @ time / (time @ time), time)
    return np.asarray(np.fft.rfft(values * np.hanning(values.shape[1])))


def _strongest(values: ComplexArray) -> FloatArray:
    """The lines that carry most of a signal's power, the two lowest left out, which the window fills."""
    power = (np.abs(values) ** 2).sum(axis=0)
    power[:2] = 0
    order = np.argsort(power)[::-1]
    count = int(np.searchsorted(np.cumsum(power[order]), _CARRIED * power.sum())) + 1
    return np.sort(order[:count])
