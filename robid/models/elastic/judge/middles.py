"""Why the middle of a physical interval is not the estimate: which nuisances move it, by how much, what would tell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.models.elastic.fit.solution import ElasticSolution, NuisanceEstimates
from robid.results.finding import two_digits

_MATTERS = 0.25  # of the half width of the physical interval: what moves a middle by less is not told
_PART = 0.15  # of what moves a middle: a nuisance that does less is not named
_MOST = 3
PLACED = "springs that the robot file lacks, put in place"
"""What moves a middle beside nuisances whose amounts are small."""

_SETTLED_BY = {
    "gear_nonlinearity": "the same places at two or three amplitudes of the torque",
    "torque_constant": "a known load: several places with it and without it",
    "payload": "the payload weighed, or taken off",
    "masses": "a rigid fit of slow motions (`rigid`)",
    "rotor_inertia": "the motors' data sheets, `inertia_relative_std` as they state it",
    "gear_coupling": "`couplings` of the gears' data sheet",
    "friction": "`compensation: silent_lines`, of a record with silent lines",
    "arm_friction": "a larger torque, which friction hardly damps",
    "missing_spring": "places in which joints beside bend otherwise, or an encoder behind the gear",
    "zero": "the joints' zeros, mastered anew",
    "delay": "the delay of the drives, measured",
}


@dataclass(frozen=True)
class MiddleRow:
    """A parameter whose physical interval does not lie around its estimate."""

    name: str  # The parameter
    kind: str  # Its kind
    moved: float  # Middle of the physical interval over the estimate, less 1
    outside: bool  # Whether the estimate lies outside the interval
    by: tuple[tuple[str, str, float], ...]  # Nuisances with their causes, and what each moves it by; largest first

    @property
    def reason(self) -> str:
        """The nuisances, with what each moves the middle by."""
        return ", ".join(f"{name} {two_digits(100 * size, '+')} %" for name, _, size in self.by)

    @property
    def settled_by(self) -> str:
        """The measurement that would tell the largest of them."""
        return _SETTLED_BY.get(self.by[0][1], "")


def middle_rows(solution: ElasticSolution) -> tuple[MiddleRow, ...]:
    """Finds the springs and dampers whose physical middle nuisances move by a quarter of its half width or more."""
    estimate, doubts = solution.estimate, solution.doubts
    moves = None if doubts is None else doubts.moves
    if doubts is None or moves is None or estimate.physical_value is None:
        return ()
    rows = []
    for index, (name, kind) in enumerate(zip(estimate.names, estimate.kinds, strict=True)):
        ends = np.array([estimate.lower[index], estimate.physical_value[index], estimate.upper[index]])
        if kind not in ("stiffness", "damping") or min(ends.min(), estimate.value[index]) <= 0:
            continue
        half, moved = 0.5 * np.log(ends[2] / ends[0]), float(np.log(ends[1] / estimate.value[index]))
        by = tuple(_by(doubts, moves[index], moved))
        if abs(moved) > _MATTERS * half and by:
            outside = not ends[0] <= estimate.value[index] <= ends[2]
            rows.append(MiddleRow(name, kind, float(np.expm1(moved)), outside, by))
    return tuple(rows)


def _by(doubts: NuisanceEstimates, moves: FloatArray, moved: float) -> Iterator[tuple[str, str, float]]:
    """The nuisances that move a middle most, the same way as all of it; what is no nuisance's are springs put in."""
    found = [(name, cause, float(move)) for name, cause, move in zip(doubts.names, doubts.causes, moves, strict=True)]
    if np.isinf(doubts.prior_std).any():
        found.append((PLACED, "missing_spring", moved - float(moves.sum())))
    told = [each for each in found if each[2] * moved > 0 and abs(each[2]) > _PART * abs(moved)]
    for name, cause, move in sorted(told, key=lambda each: -abs(each[2]))[:_MOST]:
        yield name, cause, float(np.expm1(move))
