"""What one gear's parameters are estimated from: its motions, and what loads it with the doubts about that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from robid.arrays import FloatArray
from robid.models.transmission.fit.load import Load
from robid.models.transmission.fit.tracks import Track

_TELLING = 0.02  # of the largest effect of a doubt


@dataclass(frozen=True)
class GearData:
    """What one gear's parameters are estimated from, of each motion."""

    tracks: tuple[Track, ...]
    column: int  # Which of the gears it is
    joint: int  # Which of the joints
    ratio: float
    torque: tuple[FloatArray, ...]  # (n_row,) each [N m, or N]
    doubts: tuple[FloatArray, ...]  # (n_row, n_doubt) each
    coulomb: float  # Friction of its motor [N m]
    viscous: float
    rated: float  # Rated torque [N m, or N]
    steps: FloatArray  # (n_step,) Torques at which its stiffness rises, as a data sheet states it [N m, or N]

    @property
    def largest(self) -> float:
        """The largest torque of all motions."""
        return max(float(np.abs(own).max()) for own in self.torque)

    @property
    def rows(self) -> tuple[slice, ...]:
        """Which rows are each motion's, all one after the other."""
        ends = np.cumsum([0, *(len(own) for own in self.torque)]).tolist()
        return tuple(slice(*pair) for pair in pairwise(ends))


def gear_data(
    tracks: Sequence[Track],
    load: Load,
    gears: Sequence[int],
    column: int,
    ratio: float,
    rated: float,
    steps: Sequence[float] = (),
) -> GearData:
    """Returns what one of the gears is estimated from, with the few doubts that say it all of this one."""
    doubts = [own[:, column] for own in load.doubts]
    values, axes = np.linalg.eigh(np.sum([own.T @ own for own in doubts], axis=0))
    kept = axes[:, values > _TELLING**2 * values[-1]][:, ::-1]
    return GearData(
        tracks=tuple(tracks),
        column=column,
        joint=gears[column],
        ratio=ratio,
        torque=tuple(own[:, column] for own in load.torque),
        doubts=tuple(own @ kept for own in doubts),
        coulomb=float(load.coulomb[column]),
        viscous=float(load.viscous[column]),
        rated=rated,
        steps=np.array(steps, float),
    )
