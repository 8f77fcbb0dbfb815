"""Which motion of an axis is the motor's and which are behind it: by the response, then names, else a person says.

Torque acts on the motor. Whatever the torque is, the motor reaches the load through the spring alone, so that between
them `motor / load = r (1 + c s + s^2 / w_a^2)`, a polynomial: `w_a` is where the motor stands still in spite of the
torque, its antiresonance, and below the resonance. The other way round is none. Amplitudes do not tell: below `w_a` the
load moves more than the motor, and above the resonance that depends on the inertias.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal, TypeAlias

import numpy as np
from scipy.ndimage import uniform_filter1d

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.logs.inspection.relations import Spectrum
from robid.logs.inspection.roles import Comparison, Signal, derivatives

_NEIGHBOURS = 5  # lines over which a coherence is averaged
_COHERENT = 0.8  # coherence from which a line counts
_FEWEST = 8  # lines that tell something, at least
_HIGHEST = 0.2  # share of the sampling rate up to which delays between two channels leave the polynomial as it is
_BENT = 0.1  # least share by which the spring bends the ratio over the band: less may be noise, or a delay
_BETTER = 0.5  # misfit of the polynomial over that of its inverse, at most
_GOOD = 0.3  # relative misfit of the polynomial up to which it is one
_SURELY_GOOD = 0.15  # the same for a lone motion, of which nothing else tells
_TURNED = 1.5  # square of the highest line over that of the resonance from which the sign has turned within the band
_PARTS = (1.0, 0.5, 0.25)  # parts of the band that are looked at: above, further springs may make it none


@dataclass(frozen=True)
class Order:
    """Which of two motions the motor's is."""

    first: bool  # Whether it is the first of them
    # Angular frequency at which the motor stands still, poorly known where that is beyond the lines [rad/s]
    antiresonance: float
    is_seen: bool  # Whether it is among the lines
    misfit: float  # Relative misfit of what a spring between them gives
    other: float  # The same for the motor on the other side


def find_motor(
    drive: Spectrum, first: Spectrum, second: Spectrum, orders: tuple[int, int], step_s: float
) -> Order | None:
    """Tells which of two motions of a drive is the motor's; None where their responses do not tell.

    `orders` say how often each is to be differentiated so that both are the same quantity.
    """
    x, y = first.derivative(orders[0]), second.derivative(orders[1])
    # Whatever moves them, as the torque of another joint: what they have in common tells.
    judged = [_judge(x[inside], y[inside], drive.omega[inside]) for inside in _common_lines(drive, x, y, step_s)]
    verdicts = [one for one in judged if one is not None]
    if not verdicts or len({one.first for one in verdicts}) > 1:
        return None
    return min(verdicts, key=lambda one: one.misfit / max(one.other, 1e-12))


def _judge(x: ComplexArray, y: ComplexArray, omega: FloatArray) -> Order | None:
    """Tries either one as the motor's."""
    weight = 1 / (np.abs(x) ** 2 / np.median(np.abs(x)) ** 2 + np.abs(y) ** 2 / np.median(np.abs(y)) ** 2)
    (one, bend_one), (two, bend_two) = _misfit(x, y, weight, omega), _misfit(y, x, weight, omega)
    first = one < two
    best, other, bend = (one, two, bend_one) if first else (two, one, bend_two)
    if best > _GOOD or best > _BETTER * other or bend * float(omega.max()) ** 2 < _BENT:
        return None
    still = float(1 / np.sqrt(bend))
    return Order(first, still, bool(omega.min() <= still <= omega.max()), best, other)


def _misfit(motor: ComplexArray, load: ComplexArray, weight: FloatArray, omega: FloatArray) -> tuple[float, float]:
    """Relative misfit of `motor = load r (1 + c s + s^2 / w_a^2)`, and `1 / w_a^2`."""
    scale = float(omega.max())
    s = 1j * omega / scale
    rest, found = _solve(motor, load, weight, np.stack([np.ones(len(s)), s, s**2], axis=1))
    return rest, float(found[2] / found[0] / scale**2) if found[0] else 0.0


def _solve(
    wanted: ComplexArray, other: ComplexArray, weight: FloatArray, powers: ComplexArray
) -> tuple[float, FloatArray]:
    """Real factors of powers of `s` that make one motion of another, and the relative misfit."""
    columns = np.sqrt(weight)[:, None] * other[:, None] * powers
    left = np.sqrt(weight) * wanted
    found, *_ = np.linalg.lstsq(
        np.concatenate([columns.real, columns.imag]), np.concatenate([left.real, left.imag]), rcond=None
    )
    rest = float(np.linalg.norm(left - columns @ found) / max(float(np.linalg.norm(left)), 1e-300))
    return rest, np.asarray(found)


def _common_lines(drive: Spectrum, u: ComplexArray, x: ComplexArray, step_s: float) -> Iterator[IntArray]:
    """Lines of a drive at which two signals are coherent, in ever smaller parts of the band; those that are enough."""
    cross = np.conj(u) * x
    averaged = uniform_filter1d(cross.real, _NEIGHBOURS) ** 2 + uniform_filter1d(cross.imag, _NEIGHBOURS) ** 2
    power = uniform_filter1d(np.abs(u) ** 2, _NEIGHBOURS) * uniform_filter1d(np.abs(x) ** 2, _NEIGHBOURS)
    coherence = averaged / np.maximum(power, 1e-300)
    at = np.flatnonzero((coherence > _COHERENT) & (drive.omega * step_s < 2 * np.pi * _HIGHEST))
    at = np.intersect1d(at, drive.strongest)
    for part in _PARTS:
        inside = at[drive.omega[at] <= part * drive.omega[at[-1]]] if len(at) else at
        if len(inside) >= _FEWEST:
            yield inside


def is_behind_spring(drive: Spectrum, motion: Spectrum, order: int, step_s: float) -> bool:
    """Returns whether a lone motion is surely that of a load: its acceleration turns against the torque for good.

    A motor's acceleration goes with the torque at low lines and at high ones, and stands still between; a load's has no
    such line, `torque = acceleration J (d / s + 1 + c s + s^2 / w_r^2)`, and its sign changes at the resonance.
    """
    a, u = motion.derivative(order), drive.values
    lines = _common_lines(drive, u, a, step_s)
    return any(_turns(u[inside], a[inside], drive.omega[inside]) for inside in lines)


def _turns(u: ComplexArray, a: ComplexArray, omega: FloatArray) -> bool:
    """Whether an acceleration follows its torque as a load's does, with the resonance well among the lines."""
    s = 1j * omega / float(omega.max())
    weight = 1 / np.abs(u) ** 2
    rest, found = _solve(u, a, weight, np.stack([1 / s, np.ones(len(s)), s, s**2], axis=1))
    plain, _ = _solve(u, a, weight, np.stack([1 / s, np.ones(len(s)), s], axis=1))
    return bool(rest < _SURELY_GOOD and rest < _BETTER * plain and found[1] and found[3] / found[1] > _TURNED)


Where: TypeAlias = Literal["motor", "arm", "other"]

SIDES = {"motor": 0, "": 1, "arm": 2, "tool": 3}
"""Order of sides along an axis, as names say them."""

_EXCHANGE = "exchange them where it is the other way round, and take the marks away"


@dataclass(frozen=True)
class Place:
    """Where a motion of an axis was measured, and what says so; open where nothing does, so that a person has to."""

    signal: Signal
    side: Where
    told: tuple[str, ...] = ()
    is_open: bool = False


def find_sides(drive: Signal, own: Sequence[Signal], comparison: Comparison) -> list[Place]:
    """Finds the motor's motion among those of an axis, and puts the others behind it."""
    if len(own) == 1:
        return [_lone(drive, own[0], comparison)]
    named = sorted(own, key=lambda one: SIDES[one.hint.side])
    verdicts = _verdicts(drive, named, comparison)
    lead, why, is_open = _motor(named, verdicts)
    others = [one for one in named if one is not lead]

    def rank(one: Signal) -> tuple[int, int]:  # of two behind the motor, the one that moves the other comes first
        return SIDES[one.hint.side], sum(verdicts.get((other.name, one.name)) is not None for other in others)

    places = [Place(lead, "motor", why, is_open)]
    for index, one in enumerate(sorted(others, key=rank)):
        told = () if is_open else _behind(lead, one, verdicts.get((lead.name, one.name)))
        places.append(Place(one, "other" if index else "arm", told, is_open))
    return places


def _verdicts(drive: Signal, own: Sequence[Signal], comparison: Comparison) -> dict[tuple[str, str], Order]:
    """Where the response tells which of two motions is nearer to the drive: by the names of that one and the other."""
    found: dict[tuple[str, str], Order] = {}
    torque = comparison.spectrum(drive)
    for first, second in combinations(own, 2):
        orders = derivatives(first.role), derivatives(second.role)
        spectra = comparison.spectrum(first), comparison.spectrum(second)
        order = find_motor(torque, *spectra, (orders[0], orders[1]), comparison.step_s)
        if order is not None:
            found[(first.name, second.name) if order.first else (second.name, first.name)] = order
    return found


def _motor(named: Sequence[Signal], verdicts: Mapping[tuple[str, str], Order]) -> tuple[Signal, tuple[str, ...], bool]:
    """The motor's motion, what says so where its name does not, and whether that is left to a person."""
    for lead in named:
        others = [one for one in named if one is not lead]
        if all((lead.name, one.name) in verdicts for one in others):
            by_name = [one.name for one in named if one.hint.side == "motor" and one is not lead]
            if by_name or lead.hint.side in ("arm", "tool"):
                against = f"`{by_name[0]}`" if by_name else "another one"
                told = f"by the response `{lead.name}` is the motor's, by its name {against}: {_EXCHANGE}"
                return lead, (told,), True
            return lead, (), False
    first, second = named[:2]
    if SIDES[first.hint.side] != SIDES[second.hint.side] and not any(name == second.name for name, _ in verdicts):
        return first, (), False
    told = f"neither response nor names tell whether `{first.name}` or `{second.name}` is the motor's: {_EXCHANGE}"
    return first, (told,), True


def _behind(motor: Signal, one: Signal, verdict: Order | None) -> tuple[str, ...]:
    if one.hint.side and motor.hint.side:
        return ()
    if verdict is None:
        return (f"taken for a side behind `{motor.name}` by the names alone: the response does not tell",)
    told = "taken for the load's side: by the response it moves behind a spring"
    if verdict.is_seen:
        told += f" on which `{motor.name}` stands still at {verdict.antiresonance / (2 * np.pi):.3g} Hz"
    return (told,)


def _lone(drive: Signal, one: Signal, comparison: Comparison) -> Place:
    torque, motion, by_name = comparison.spectrum(drive), comparison.spectrum(one), one.hint.side
    behind = is_behind_spring(torque, motion, derivatives(one.role), comparison.step_s)
    if behind and by_name == "motor":
        told = f"its name says the motor's side, but it turns against `{drive.name}` behind a resonance, as a load does"
        return Place(one, "motor", (f"{told}: add `.arm` to its name if it is, and take the mark away",), is_open=True)
    if behind and not by_name:
        return Place(one, "arm", (f"taken for the load's side: it turns against `{drive.name}` behind a resonance",))
    return Place(one, "arm" if by_name in ("arm", "tool") else "motor")
