"""Wrong scales that data may have, which of them the data name, and channels that measure the same motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular

from robid.arrays import ComplexArray, FloatArray
from robid.results.scale import COUNTS, SCALES, Scale
from robid.robot.description import Robot
from robid.signals.quantities import QUANTITIES, Channel
from robid.signals.record import Record

_ACCUSED = 8.0
_LEFT = 0.35
_WITHIN = 2.5
_SEEN = 2.0
"""Standard deviations by which data must see a factor."""
_FARTHEST = 4.5
_ALIKE = 5.0
_MOST = 3
_LEAST_RATIO, _ROUGH = 1.5, 3.0
"""Smallest factor of a robot's own that is a mistake, and up to which a rough robot file is off as much."""

_RARE, _VERY_RARE = 2.0, 4.0
_EXACT = 0.05
_RECOUNTED = (2.0, 4.0, 8.0, 16.0, 64.0, 256.0, 10.0, 10000 / 4096)
"""Counts of a turn over those that were stated: quadrature, other encoders."""


def _both(rare: float, *factors: str) -> tuple[tuple[str, int, float], ...]:
    return tuple((factor, sign, rare) for factor in factors for sign in (1, -1))


_FACTORS: dict[str, tuple[tuple[str, int, float], ...]] = {
    "torque": (*_both(0.0, "1000"), ("9.81", -1, 1.0), ("9.81", 1, 1.0), ("1e6", 1, _VERY_RARE)),
    "angle": (*_both(0.0, "180/pi", "1000"), ("2pi", -1, 1.0), ("2pi", 1, 1.0), *_both(_VERY_RARE, "1e6")),
    "position": (*_both(0.0, "1000"), *_both(_RARE, "1e6")),
    "speed": (*_both(0.0, "60/2pi", "180/pi"), *_both(1.0, "1000"), *_both(_RARE, "6"), ("2pi", -1, _RARE)),
    "acceleration": (*_both(0.0, "180/pi"), ("9.81", -1, 0.0), ("9.81", 1, 0.0), *_both(0.0, "1000")),
    "time": (*_both(0.0, "1000"), *_both(1.0, "1e6"), *_both(_RARE, "60")),
}
"""Factors by quantity: which, whether values come out too large (1) or too small (-1), and how rare the mistake is."""


@dataclass(frozen=True)
class Hypothesis:
    """One mistake of scale."""

    scales: tuple[Scale, ...]  # What it is
    factor: float  # By how much; of a robot's own factors the geometric mean
    log: FloatArray  # (n_state,) Logarithm of read over true values of torques, of motions and of time
    penalty: float  # How rare it is
    exact: bool = False  # Whether only evidence that knows the factor to some per cent may name it


@dataclass(frozen=True)
class Seen:
    """What data say of scales: `rows @ log = value`, within a covariance."""

    rows: FloatArray  # (n_seen, n_state) Exponents
    value: FloatArray  # (n_seen,) Logarithms
    covariance: FloatArray  # (n_seen, n_seen) How far they may be off

    @cached_property
    def _whitened(self) -> tuple[FloatArray, FloatArray]:
        """Rows and values over their deviations: as independent ones of variance 1."""
        if not self.value.size:
            return self.rows, self.value
        factor, both = np.linalg.cholesky(self.covariance), np.column_stack([self.rows, self.value])
        both = solve_triangular(factor, both, lower=True)
        return both[:, :-1], both[:, -1]

    def cost(self, log: FloatArray) -> float:
        """Squared deviations that a hypothesis leaves."""
        rows, value = self._whitened
        left = value - rows @ log
        return float(left @ left)

    def farthest(self, log: FloatArray) -> float:
        """Largest deviation that it leaves."""
        left = self.value - self.rows @ log
        return float((np.abs(left) / np.sqrt(np.diagonal(self.covariance))).max(initial=0.0))

    def share(self, log: FloatArray) -> tuple[float, float]:
        """How much of a hypothesis the data see, with its standard deviation; 1 where all of it."""
        rows, value = self._whitened
        column = rows @ log
        size = float(column @ column)
        return (float(value @ column) / size, 1 / float(np.sqrt(size))) if size > 0 else (0.0, np.inf)


def joined(parts: Sequence[Seen]) -> Seen:
    """Joins what is independent."""
    size = [len(part.value) for part in parts]
    covariance = np.zeros((sum(size), sum(size)))
    ends = np.cumsum(size)
    for part, end in zip(parts, ends.tolist(), strict=True):
        own = slice(end - len(part.value), end)
        covariance[own, own] = part.covariance
    return Seen(
        np.concatenate([part.rows for part in parts]), np.concatenate([part.value for part in parts]), covariance
    )


@dataclass(frozen=True)
class Named:
    """Hypotheses that explain what data say, and how surely."""

    alike: tuple[Hypothesis, ...]  # Those that the data cannot tell apart, the likeliest first
    seen: tuple[float, float, float]  # Factor that the data show of the first, with the ends of its interval
    strength: float  # Squared deviations that it explains over those from which it counts


def name_scales(hypotheses: Sequence[Hypothesis], told: Callable[[FloatArray], Seen], likely: Seen) -> Named | None:
    """Finds the scales that explain what data say; None where nothing is to be explained, or nothing does.

    A factor is accused where the data contradict its absence, where it lies inside what they say, and where what is
    left is no more than robot files are off by.

    Args:
        hypotheses: What may be.
        told: What the data say, seen by a hypothesis, of which a robot file cannot be off by as much.
        likely: What decides only between hypotheses that explain it alike.
    """
    none = np.zeros(likely.rows.shape[1])
    before = told(none).cost(none)
    found = []
    for each in hypotheses if before > _ACCUSED else ():
        seen = told(each.log)
        cost = seen.cost(each.log)
        share, std = seen.share(each.log)
        # What leaves nothing that could contradict it explains nothing: the data must see the factor itself.
        is_inside = abs(share - 1) < _WITHIN * std < _WITHIN * share / _SEEN and seen.farthest(each.log) < _FARTHEST
        is_inside &= not each.exact or std * abs(np.log(each.factor)) < _EXACT
        if before - cost > _ACCUSED + each.penalty and cost < max(_LEFT * before, 1.0) and is_inside:
            found.append((cost + each.penalty + likely.cost(each.log), each, share, std))
    if not found:
        return None
    found.sort(key=lambda one: one[0])
    best, first, share, std = found[0]
    alike = {each.scales: each for cost, each, *_ in reversed(found) if cost - best < _ALIKE}
    size = float(np.log(first.factor)) * (-1 if first.scales[0].inverse else 1)
    low, high = sorted(float(np.exp(size * (share + sign * 1.96 * std))) for sign in (-1, 1))
    strength = (before - told(first.log).cost(first.log)) / _ACCUSED
    return Named(tuple(reversed(alike.values()))[:_MOST], (float(np.exp(size * share)), low, high), strength)


def hypotheses_of(
    names: Sequence[str], moved: Sequence[Channel], ratio: FloatArray, torque_constant: FloatArray
) -> list[Hypothesis]:
    """Lists the mistakes that channels may have: of all of a kind alike, or of one.

    Args:
        names: Motors whose torques are read.
        moved: Motions that are read, of motors and arms.
        ratio (n_motor,): Gear ratios.
        torque_constant (n_motor,): Torque constants, NaN where none is stated [N m/A].
    """
    return [
        *_torques(names, len(moved), ratio, torque_constant),
        *_motions(names, moved, ratio),
        *_other_sides(names, moved, ratio),
        *_times(names, moved),
    ]


def _torques(
    names: Sequence[str], n_moved: int, ratio: FloatArray, torque_constant: FloatArray
) -> Iterator[Hypothesis]:
    n_state = len(names) + n_moved + 1
    for joints, rows, rare in _subsets(names, range(len(names))):
        for factor, sign, penalty in _FACTORS["torque"]:
            yield _alike("torque", factor, sign, joints, rows, n_state, penalty + rare)
        own = (
            ("gear_ratio", np.log(np.abs(ratio)), False, 1.0),
            ("torque_constant", -np.log(torque_constant), True, 1.0),
        )
        for factor, log, inverse, penalty in own:
            if np.isfinite(log[rows]).all() and _differs(log[rows]):
                yield _own("torque", factor, joints, rows, log[rows], n_state, penalty + rare, inverse=inverse)


def _motions(names: Sequence[str], moved: Sequence[Channel], ratio: FloatArray) -> Iterator[Hypothesis]:
    n_state = len(names) + len(moved) + 1
    kinds = {(one.quantity, one.side, one.unit) for one in moved}
    yield from _both_sides(moved, len(names), n_state)
    for quantity, side, unit in sorted(kinds):
        own = [index for index, one in enumerate(moved) if (one.quantity, one.side, one.unit) == (quantity, side, unit)]
        joints_of = [moved[index].name.partition(".")[0] for index in own]
        channel = f"{side}_{quantity}" if quantity == "angle" and side in ("motor", "arm") else quantity
        for joints, places, rare in _subsets(joints_of, range(len(own))):
            rows = [len(names) + own[place] for place in places]
            for factor, sign, penalty in _FACTORS.get(quantity, ()):
                yield _alike(channel, factor, sign, joints, rows, n_state, penalty + rare)
            if quantity == "angle":
                yield from _counted(channel, joints, rows, n_state, rare)
            log = np.array([np.log(abs(ratio[list(names).index(joints_of[place])])) for place in places])
            if _differs(log) and quantity in ("angle", "speed", "acceleration"):
                sign = 1 if side == "arm" else -1
                yield _own(channel, "gear_ratio", joints, rows, sign * log, n_state, 1.0 + rare, inverse=sign < 0)


def _both_sides(moved: Sequence[Channel], n_torque: int, n_state: int) -> Iterator[Hypothesis]:
    """Motors and arms alike, where one quantity of both is read: who mistakes a unit does so for the whole file."""
    for quantity, unit in sorted({(one.quantity, one.unit) for one in moved}):
        own = [index for index, one in enumerate(moved) if (one.quantity, one.unit) == (quantity, unit)]
        if len({moved[index].side for index in own}) < 2:
            continue
        channels = ("motor_angle", "arm_angle") if quantity == "angle" else (quantity,)
        for factor, sign, penalty in _FACTORS.get(quantity, ()):
            scales = tuple(Scale(channel, factor, inverse=sign < 0, joints=()) for channel in channels)
            log = _log([n_torque + index for index in own], sign * np.log(SCALES[factor]), n_state)
            yield Hypothesis(scales, SCALES[factor], log, penalty + 1.0)


def _other_sides(names: Sequence[str], moved: Sequence[Channel], ratio: FloatArray) -> Iterator[Hypothesis]:
    """Torques and motions of all joints that are read as their motors', or the other way around: logs have either."""
    sides, rows = {one.side for one in moved}, range(len(names), len(names) + len(moved))
    turns = all(one.quantity in ("angle", "speed", "acceleration") for one in moved)
    size, sign = np.log(np.abs(ratio)), 1 if sides == {"motor"} else -1
    if len(sides) != 1 or not sides <= {"motor", "arm"} or not turns or not _differs(size):
        return
    # The torque of a joint is larger by its ratio than the motor's, its motion smaller.
    of = [list(names).index(one.name.partition(".")[0]) for one in moved]
    log = _log([*range(len(names)), *rows], sign * np.concatenate([size, -size[of]]), len(names) + len(moved) + 1)
    channels = dict.fromkeys(f"{one.side}_angle" if one.quantity == "angle" else one.quantity for one in moved)
    scales = Scale("torque", "gear_ratio", sign < 0), *(Scale(each, "gear_ratio", sign > 0) for each in channels)
    yield Hypothesis(scales, float(np.exp(size.mean())), log, 1.0)


def _counted(channel: str, joints: tuple[str, ...], rows: list[int], n_state: int, rare: float) -> Iterator[Hypothesis]:
    """Counts that are read as angles, and turns with other counts than said, which only exact evidence shows."""
    for counts in COUNTS:
        size = counts / (2 * np.pi)
        scale = Scale(channel, "counts", inverse=False, joints=joints)
        yield Hypothesis((scale,), size, _log(rows, np.log(size), n_state), _RARE + rare)
    for size, inverse in ((size, inverse) for size in _RECOUNTED for inverse in (False, True)):
        scale = Scale(channel, "counts", inverse, joints)
        log = _log(rows, float(np.log(size)) * (-1 if inverse else 1), n_state)
        yield Hypothesis((scale,), size, log, _RARE + rare, exact=True)


def _times(names: Sequence[str], moved: Sequence[Channel]) -> Iterator[Hypothesis]:
    n_state = len(names) + len(moved) + 1
    for factor, sign, penalty in _FACTORS["time"]:
        yield _alike("time", factor, sign, (), [n_state - 1], n_state, penalty)


def _subsets(names: Sequence[str], rows: range) -> Iterator[tuple[tuple[str, ...], list[int], float]]:
    """All channels of a kind, then each of them, which is rarer."""
    yield (tuple(names) if len(rows) == 1 else ()), list(rows), 0.0
    if len(rows) > 1:
        for row in rows:
            yield (names[row],), [row], 1.0


def _alike(
    channel: str, factor: str, sign: int, joints: tuple[str, ...], rows: list[int], n_state: int, penalty: float
) -> Hypothesis:
    scale = Scale(channel, factor, inverse=sign < 0, joints=joints)
    return Hypothesis((scale,), SCALES[factor], _log(rows, sign * np.log(SCALES[factor]), n_state), penalty)


def _own(
    channel: str,
    factor: str,
    joints: tuple[str, ...],
    rows: list[int],
    log: FloatArray,
    n_state: int,
    penalty: float,
    *,
    inverse: bool,
) -> Hypothesis:
    size = float(np.exp(log.mean() * (-1 if inverse else 1)))
    scale, is_small = Scale(channel, factor, inverse, joints), bool(np.abs(log).max() < np.log(_ROUGH))
    return Hypothesis((scale,), size, _log(rows, log, n_state), penalty, exact=is_small)


def _differs(log: FloatArray) -> bool:
    """Whether a factor of a robot's own is far enough from 1 to be a mistake."""
    return bool(np.abs(log).max() > np.log(_LEAST_RATIO))


def _log(rows: list[int], values: FloatArray | float, n_state: int) -> FloatArray:
    log = np.zeros(n_state)
    log[rows] = values
    return log


_CARRIED = 0.9
"""Share of a signal's power in the lines that are compared."""

_COHERENT = 0.9
_LONGEST = 1 << 16


@dataclass(frozen=True)
class Pair:
    """Two channels of one joint's motion."""

    first: int  # Index of an output
    second: int  # Index of another
    ratio: float  # First over second, brought to the same derivative and side; 1 where both are right
    relative_std: float  # Its relative standard deviation
    derivatives: int  # Derivatives of the first less those of the second, by which a wrong time tells


def pairs_of(record: Record, robot: Robot) -> list[Pair]:
    """Compares all channels of each joint's motion, at the lines that carry the power of their motion.

    Args:
        record: The record.
        robot: The robot, by whose gear ratios sides are compared.
    """
    names = [joint.name for joint in robot.joints]
    found = []
    for joint, ratio in zip(names, robot.gear_ratio.tolist(), strict=True):
        own = list(_channels_of(record, joint))
        for place, first in enumerate(own):
            for second in own[place + 1 :]:
                pair = _pair(record, first, second, abs(ratio))
                if pair is not None:
                    found.append(pair)
    return found


def _channels_of(record: Record, joint: str) -> Iterator[int]:
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
    if abs(slope) * power < _COHERENT * size:
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
