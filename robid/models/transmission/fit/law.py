"""The law of a gear: deflection over torque and its past, and what data sheets say of it.

The torque is `k (x + s x^3) + h(x)` of the deflection `x`, with Dahl's hysteresis `h`: along a motion in one sense it
goes to its slip torque `H` exponentially over a deflection. In place of the cube, the stiffness may rise in steps at
some torques, as data sheets state it. In series with it is a narrow band about zero torque in
which the deflection changes its side by the backlash `b`: `b/2 tanh(torque / band)`.

Source:
    Dahl (1968); docs/methods, sec. 15. Lost motion and hysteresis as gear makers measure them.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from robid.arrays import FloatArray, IntArray

LOST_MOTION_SHARE = 0.03
"""Of the rated torque, at which lost motion is measured."""
BAND_SHARE = 0.01
"""Of the rated torque, over which the deflection changes its side by the backlash."""
_NEWTON_STEPS = 30
_CLOSE = 1e-10  # of a deflection
_CYCLE_ROWS = 150  # of a quarter of a loop


@dataclass(frozen=True)
class GearLaw:
    """Laws of some gears or of variants of one, each number or array of the same shape (n_series,)."""

    stiffness: FloatArray  # k [N m/rad, or N/m]
    stiffening: FloatArray  # s, over the square of the deflection [1/rad^2, or 1/m^2]
    slip: FloatArray  # H [N m, or N]
    reach: FloatArray  # Deflection over which hysteresis builds up [rad, or m]
    backlash: FloatArray  # b [rad, or m]
    torques: FloatArray = field(default_factory=lambda: np.zeros(0))  # (n_step,) Where stiffness rises [N m, or N]
    # (n_series, n_step) By how much, over the stiffness without load
    rises: FloatArray = field(default_factory=lambda: np.zeros((1, 0)))

    def bent(self, deflection: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Torque of the spring alone over its stiffness without load, and its slope, at deflections (..., n_series)."""
        square = deflection**2
        found, slope = deflection * (1 + self.stiffening * square), 1 + 3 * self.stiffening * square
        size, side = np.abs(deflection), np.sign(deflection)
        start, before = np.zeros(len(self.rises)), 0.0
        for torque, rise, total in zip(self.torques.tolist(), self.rises.T, self._before, strict=True):
            start = start + (torque - before) / (self.stiffness * total)
            beyond = size - start
            found, slope = found + rise * side * np.maximum(beyond, 0.0), slope + rise * (beyond > 0)
            before = torque
        return found, slope

    @property
    def _before(self) -> FloatArray:
        """Stiffness before each step over that without load (n_step, n_series)."""
        return np.asarray(1 + np.cumsum(self.rises, axis=1).T - self.rises.T)

    def varied(self, name: str, by: FloatArray) -> GearLaw:
        """Returns the laws with one of their numbers changed by a summand."""
        return replace(self, **{name: getattr(self, name) + by})


def deflections(law: GearLaw, torque: FloatArray, band: float, start: FloatArray) -> FloatArray:
    """Returns deflections (n_row, n_series) along torques (n_row, n_series).

    Args:
        law: The gears.
        torque: Torques behind them, rows in the order of time [N m, or N].
        band: Torque over which the deflection changes its side by the backlash.
        start (n_series,): Hysteresis at the first row, from -1 to 1.
    """
    stretched = np.empty(torque.shape)
    memory: FloatArray = start * law.slip
    last = _static(law, np.asarray(torque[0] - memory))
    for row, load in enumerate(torque):
        last, memory = _step(law, load, last, memory)
        stretched[row] = last
    return np.asarray(stretched + 0.5 * law.backlash * np.tanh(torque / band))


def _static(law: GearLaw, torque: FloatArray) -> FloatArray:
    """Deflections (n_series,) of the springs alone."""
    found = torque / law.stiffness
    for _ in range(_NEWTON_STEPS):
        bent, slope = law.bent(found)
        step = (law.stiffness * bent - torque) / (law.stiffness * slope)
        found = found - step
        if np.all(np.abs(step) <= _CLOSE * (np.abs(found) + 1e-9)):
            break
    return found


def _step(law: GearLaw, torque: FloatArray, last: FloatArray, memory: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Deflections and hysteresis (n_series,) under the torques of the next row.

    The torque rises with the deflection in either sense, so that the sense is known and Newton's steps stay in it.
    """
    lacking = torque - law.stiffness * law.bent(last)[0] - memory
    sense = np.sign(lacking)
    limit, found = sense * law.slip, last
    for _ in range(_NEWTON_STEPS):
        left = (memory - limit) * np.exp(-np.abs(found - last) / law.reach)
        bent, rising = law.bent(found)
        excess = law.stiffness * bent + limit + left - torque
        slope = law.stiffness * rising - sense * left / law.reach
        moved = found - excess / slope
        # Never back over where the motion began.
        moved = np.where(sense * (moved - last) < 0, last, moved)
        step, found = moved - found, moved
        if np.all(np.abs(step) <= _CLOSE * (np.abs(found) + 1e-9)):
            break
    return found, limit + (memory - limit) * np.exp(-np.abs(found - last) / law.reach)


def memories(deflection: FloatArray, reach: FloatArray, start: FloatArray, noise: float) -> FloatArray:
    """Returns Dahl's hysteresis over its slip torque (n_sample, n_variant), from -1 to 1, along a deflection.

    Between two turns it is an exponential, so that only turns are gone through one by one.

    Args:
        deflection (n_sample,): Deflections in the order of time [rad, or m].
        reach (n_variant,): Deflection over which it builds up.
        start (n_variant,): What it begins with.
        noise: Changes of the deflection that are no motion: it has to turn back by twice as much before that counts.
    """
    turns = _turns(deflection)
    ends = _counted(deflection[turns], noise)
    moved = np.diff(ends)
    sense, decay = np.sign(moved), np.exp(-np.abs(moved)[:, None] / reach)
    at_turns = np.stack([_along(sense, *pair) for pair in zip(decay.T, start.tolist(), strict=True)], axis=1)
    # In between: which stretch a sample is in, and how far it has come there.
    stretch = np.repeat(np.arange(len(moved)), np.diff(turns))
    begun, rising = ends[stretch], sense[stretch]
    inner = deflection[:-1]
    come = np.maximum(rising * (inner - begun) - noise, 0.0)
    aim = rising[:, None]
    found = aim + (at_turns[stretch] - aim) * np.exp(-come[:, None] / reach)
    found = np.where(aim == 0, at_turns[stretch], found)
    return np.concatenate([found, at_turns[-1:]])


def _turns(deflection: FloatArray) -> IntArray:
    """Indices (n_turn,) at which a course turns back, its two ends with them."""
    sense = np.sign(np.diff(deflection))
    turned = np.flatnonzero(sense[1:] != sense[:-1]) + 1
    return np.concatenate([[0], turned, [len(deflection) - 1]])


def _counted(values: FloatArray, noise: float) -> FloatArray:
    """Where a course with these turns (n_turn,) is, less what is noise: it follows behind by that."""
    found, place = [], float(values[0])
    for value in values.tolist():
        place = max(min(place, value + noise), value - noise)
        found.append(place)
    return np.array(found)


def _along(sense: FloatArray, decay: FloatArray, start: float) -> FloatArray:
    """Hysteresis (n_turn,) at the turns, of stretches (n_turn - 1,) that go one way each."""
    found = [start]
    for aim, left in zip(sense.tolist(), decay.tolist(), strict=True):
        found.append(aim + (found[-1] - aim) * left if aim else found[-1])
    return np.array(found)


@dataclass(frozen=True)
class Loop:
    """A closed loop of torque over deflection, from minus to plus its largest torque and back."""

    torque: FloatArray  # (n_row,)
    deflection: FloatArray  # (n_row, n_series)

    @property
    def _branches(self) -> tuple[tuple[FloatArray, FloatArray], tuple[FloatArray, FloatArray]]:
        half = len(self.torque) // 2
        up, down = slice(0, half + 1), slice(half, None)
        rising = self.torque[up], self.deflection[up]
        return rising, (self.torque[down][::-1], self.deflection[down][::-1])

    def at(self, torque: float) -> tuple[FloatArray, FloatArray]:
        """Deflections (n_series,) at a torque, while it rises and while it falls."""
        first, second = (
            np.array([np.interp(torque, rows, column) for column in values.T]) for rows, values in self._branches
        )
        return first, second

    def lost_motion(self, rated: float) -> FloatArray:
        """How far the centre line of the loop is apart at plus and minus 3 % of the rated torque (n_series,)."""
        share = LOST_MOTION_SHARE * rated
        return np.asarray(0.5 * (np.add(*self.at(share)) - np.add(*self.at(-share))))

    def width(self) -> FloatArray:
        """How wide the loop is at zero torque (n_series,)."""
        rising, falling = self.at(0.0)
        return np.asarray(falling - rising)


def data_sheet_loop(law: GearLaw, rated: float, band: float) -> Loop:
    """Returns the loop that a gear maker measures: slowly to the rated torque and back, both ways."""
    quarter = rated * np.sin(np.linspace(0, np.pi / 2, _CYCLE_ROWS))
    first = np.concatenate([quarter, quarter[-2::-1]])
    loading = np.concatenate([-first[1:], first[1:]])
    # Begun at minus the rated torque, after a loop that makes the past forgotten.
    whole = np.concatenate([quarter, quarter[-2::-1], loading, loading])
    series = np.repeat(whole[:, None], len(law.stiffness), axis=1)
    found = deflections(law, series, band, np.zeros(len(law.stiffness)))
    lowest = int(np.argmin(whole[-2 * len(first) :])) + len(whole) - 2 * len(first)
    start = lowest - len(loading)
    rows = slice(start, lowest + 1)
    return Loop(whole[rows], found[rows])
