"""Mean motor angles against the stated configurations: swapped files, gear ratios, signs of angles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.stats import t as student

from robid.arrays import BoolArray, FloatArray
from robid.results.finding import Finding
from robid.results.plausible.evidence import Evidence
from robid.robot.description import Robot
from robid.signals.quantities import METRES, RADIANS

_PLACED = {RADIANS: float(np.deg2rad(2.0)), METRES: 0.01}
"""How well a configuration is stated and kept, arm side: a rounded figure, a drift; by unit."""

_STATED = {RADIANS: float(np.deg2rad(0.2)), METRES: 0.001}
"""Least finding of a stated position when a slope is judged."""

_SPREAD = {RADIANS: float(np.deg2rad(5.0)), METRES: 0.025}
"""Least way between configurations from which a slope is judged."""

_SWINGS = 3.0
_LEAST_SLOPE = 0.01
_GROSS_SLOPE = 0.05
_FALSE_ALARM = 1e-6
_SHOWN = 4


@dataclass(frozen=True)
class Angles:
    """What mean angles say."""

    findings: tuple[Finding, ...]  # Strongest first
    notes: tuple[str, ...]  # What is no fault, but worth to know
    sign: FloatArray  # (n_motor,) 1 or -1 where the angles tell a motor's sign, 0 where they do not
    ratio_fits: BoolArray  # (n_motor,) Which motors' gear ratios nothing contradicts
    placed: bool  # Whether nothing says that the robot stood elsewhere than stated


@dataclass(frozen=True)
class _Means:
    """Stated and logged angles of the motors that the log tells of, as arm positions (n_conf, n_motor) [rad, or m]."""

    names: list[str]
    units: list[str]
    stated: FloatArray
    logged: FloatArray
    allowed: FloatArray

    @property
    def least_spread(self) -> FloatArray:
        """Way from which each motor (n_motor,) counts as turned [rad, or m]."""
        return np.array([_SPREAD[unit] for unit in self.units])


def judge_angles(robot: Robot, evidence: Evidence) -> Angles:
    """Compares mean motor angles with the stated configurations.

    What explains all of them is looked for in this order: the configurations as stated, others of the stated ones,
    a slope of each motor (its gear ratio or sign), and the same with a constant offset of each motor, as encoders
    without a reference have it. Angles that stay near zero wherever the robot stands are relative: nobody is accused.
    """
    n_motor = len(evidence.names)
    sign, fits = np.zeros(n_motor), np.ones(n_motor, bool)
    if evidence.mean_angle is None or not n_motor:
        return Angles((), (), sign, fits, placed=True)
    turns = robot.motor_per_arm[evidence.joints(robot)]
    ratio = np.abs(turns[np.arange(n_motor), evidence.joints(robot)])
    swing = np.zeros_like(evidence.mean_angle) if evidence.motion_rms is None else evidence.motion_rms / ratio
    logged, stated = evidence.mean_angle / ratio, evidence.configurations @ turns.T / ratio
    units = [METRES if robot.prismatic[joint] else RADIANS for joint in evidence.joints(robot)]
    placed_within = np.array([_PLACED[unit] for unit in units])
    relative = _relative(logged, stated, swing, ratio, placed_within)
    told = np.flatnonzero(~relative)
    notes = _relative_notes([evidence.names[index] for index in np.flatnonzero(relative)])
    if not told.size:
        return Angles((), notes, sign, fits, placed=True)
    names = [evidence.names[index] for index in told]
    allowed = (placed_within + _SWINGS * swing)[:, told]
    means = _Means(names, [units[index] for index in told], stated[:, told], logged[:, told], allowed)
    findings, slopes, more, placed = _explain(means)
    # Near zero, an angle and the reversed one agree alike.
    telling = (2 * np.abs(means.stated) > means.allowed).any(axis=0)
    sign[told] = np.sign(slopes) * (np.abs(np.abs(slopes) - 1) < 0.5) * telling
    fits[told] = np.abs(np.abs(slopes) - 1) < _LEAST_SLOPE
    return Angles(findings, notes + more, sign, fits, placed)


def _relative(
    logged: FloatArray, stated: FloatArray, swing: FloatArray, ratio: FloatArray, placed_within: FloatArray
) -> BoolArray:
    """Which motors' angles (n_motor,) stay within a turn or the motion itself wherever the robot stands."""
    turn = 2.1 * np.pi / ratio
    reach = np.maximum(2 * _SWINGS * swing.max(axis=0), np.where(ratio > 10, turn, placed_within))
    if len(logged) == 1:
        return np.asarray((np.abs(logged[0]) <= reach) & (np.abs(stated[0]) > 2 * reach))
    return np.asarray((np.ptp(logged, axis=0) <= reach) & (np.ptp(stated, axis=0) > 2 * reach))


def _relative_notes(names: list[str]) -> tuple[str, ...]:
    if not names:
        return ()
    told = "its mean angle stays" if len(names) == 1 else "their mean angles stay"
    return (f"{', '.join(names)}: {told} the same in every configuration, so the log cannot tell where the robot was",)


def _explain(means: _Means) -> tuple[tuple[Finding, ...], FloatArray, tuple[str, ...], bool]:
    """NuisanceStd, slope of each motor (0 where unknown), notes, and whether the robot stood where stated."""
    n_conf, ones = len(means.stated), np.ones(len(means.names))
    away = np.abs(means.logged - means.stated) > means.allowed
    if not away.any():
        slopes, findings = _slopes(means)
        return findings, slopes, (), True
    order = _permutation(means, np.zeros(len(means.names)))
    if order is not None:
        return (_swapped(means, order),), ones, (), False
    for offset in (False, True) if n_conf > 2 else (False,):
        slopes, findings = _slopes(means, offset=offset)
        if findings and slopes.all():
            return findings, slopes, (), True
    middle = np.median(means.logged - means.stated, axis=0)
    level = np.abs(means.logged - means.stated - middle) <= means.allowed
    if level.all():
        return _offset(means, middle, away)
    order = _permutation(means, middle) if n_conf >= 4 else None
    finding = _elsewhere(means) if order is None else _swapped(means, order)
    return (finding,), np.zeros(len(means.names)), (), False


def _slopes(means: _Means, *, offset: bool | None = None) -> tuple[FloatArray, tuple[Finding, ...]]:
    """Slope of logged over stated angles of each motor, 0 where no line explains them, and what they point to.

    Args:
        means: The angles.
        offset: Whether each motor has an offset of its own; None where the stated angles hold within what is
            allowed, so that only what stands out of the scatter counts.
    """
    slopes, findings = np.ones(len(means.names)), []
    for index, name in enumerate(means.names):
        x, y = means.stated[:, index], means.logged[:, index]
        if offset is not None and (np.abs(y - x) <= means.allowed[:, index]).all():
            continue
        found = _line(x, y, means.units[index], offset=offset is not False)
        if found is None:
            slopes[index] = 1.0 if offset is None else 0.0
            continue
        slope, left, limit = found
        if (np.abs(left) > means.allowed[:, index]).any():
            slopes[index] = 0.0
        elif abs(slope - 1) > limit:
            slopes[index] = slope
            findings.append(_slope_finding(name, slope, abs(slope - 1) / limit, len(x)))
    return slopes, tuple(sorted(findings, key=lambda finding: -finding.strength))


def _line(x: FloatArray, y: FloatArray, unit: str, *, offset: bool) -> tuple[float, FloatArray, float] | None:
    """Slope, what it leaves, and by how much a sound slope may differ from 1; None where too little is turned.

    One angle can only tell a sign; an offset needs a configuration more.
    """
    used = x - x.mean() if offset else x
    freedom = len(x) - 1 - offset
    if np.sqrt((used**2).mean()) < _SPREAD[unit] or freedom < 0 or (offset and freedom < 1):
        return None
    slope = float(used @ y / (used @ used))
    left = y - slope * used - (y.mean() if offset else 0.0)
    if (freedom == 0 or np.ptp(x) < _SPREAD[unit]) and abs(slope + 1) > 2 * _LEAST_SLOPE:
        return None
    scatter = max(float(np.sqrt(left @ left / max(freedom, 1))), _STATED[unit])
    quantile = float(student.isf(_FALSE_ALARM / 2, 10 if scatter == _STATED[unit] else max(freedom, 1)))
    return slope, left, max(_LEAST_SLOPE, quantile * scatter / float(np.sqrt(used @ used)))


def _slope_finding(name: str, slope: float, strength: float, n_conf: int) -> Finding:
    where = "in the only configuration" if n_conf == 1 else f"over {n_conf} configurations"
    seen = f"{name}: its mean angles are {slope:.4g} times what configuration and gear ratio give {where}"
    if slope < 0:
        return Finding("angle_sign", seen, decisive=True, strength=strength)
    return Finding("gear_ratio", seen, decisive=abs(slope - 1) > _GROSS_SLOPE, strength=strength)


def _permutation(means: _Means, offset: FloatArray) -> list[int] | None:
    """Stated configuration that each log fits, where others than its own explain all angles."""
    distance = np.abs((means.logged - offset)[:, None] - means.stated) / means.allowed[:, None]
    farthest = distance.max(axis=-1)
    _, order = linear_sum_assignment(np.minimum(farthest, 100.0))
    fits = farthest[np.arange(len(order)), order] <= 1
    return order.tolist() if fits.all() and (order != np.arange(len(order))).any() else None


def _swapped(means: _Means, order: list[int]) -> Finding:
    moved = [f"{log + 1} fits {place + 1}" for log, place in enumerate(order) if log != place]
    more = f" and {len(moved) - _SHOWN} more" if len(moved) > _SHOWN else ""
    told = f"the log of configuration {', of '.join(moved[:_SHOWN])}{more}"
    return _misplaced(means, f"the mean angles contradict the stated configurations; {told}")


def _elsewhere(means: _Means) -> Finding:
    away = np.abs(means.logged - means.stated) / means.allowed
    place, motor = np.unravel_index(int(np.argmax(away)), away.shape)
    off = _off(np.abs(means.logged - means.stated)[place, motor], means.units[motor])
    told = f"by up to {off} ({means.names[motor]} in configuration {place + 1})"
    return _misplaced(means, f"the mean angles contradict the stated configurations {told}")


def _misplaced(means: _Means, message: str) -> Finding:
    strength = float((np.abs(means.logged - means.stated) / means.allowed).max())
    return Finding("configurations", message, decisive=True, strength=strength)


def _off(distance: float, unit: str) -> str:
    return f"{1e3 * distance:.3g} mm" if unit == METRES else f"{np.rad2deg(distance):.3g} deg"


def _most(means: _Means, away: FloatArray) -> str:
    motor = int(np.argmax(np.abs(away)))
    return _off(float(np.abs(away)[motor]), means.units[motor])


def _offset(
    means: _Means, middle: FloatArray, away: BoolArray
) -> tuple[tuple[Finding, ...], FloatArray, tuple[str, ...], bool]:
    """Constant offsets: encoders without a reference, or, where others agree, one joint's zero or configuration."""
    ones = np.ones(len(means.names))
    shifted = np.asarray(away.any(axis=0))
    turned = ~shifted & (np.abs(means.stated).max(axis=0) > means.least_spread)
    if turned.any():
        finding = _elsewhere(means)
        if len(means.stated) == 1:
            return (finding,), np.where(shifted, 0.0, 1.0), (), False
        names = ", ".join(name for name, moved in zip(means.names, shifted.tolist(), strict=True) if moved)
        told = f"{names}: off by the same amount in every configuration ({_most(means, middle)})"
        return (Finding("configurations", told, decisive=False, strength=finding.strength),), ones, (), True
    if len(means.stated) == 1:
        ones = np.zeros(len(means.names))
    told = f"the mean angles differ from the configurations by up to {_most(means, middle)}"
    return (), ones, (f"{told}, alike in all of them, as those of encoders without a reference do",), True
