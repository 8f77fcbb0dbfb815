"""Torque laws identified blind, from the lines that were not excited."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.blocks import logarithmic
from robid.frf.compensation import Motion, friction_spectrum, record_motion, ripple_spectra
from robid.frf.laws import LawEstimate
from robid.frf.spectra import Blocks, record_blocks
from robid.robot.friction import COORDINATES, EXCESS, LAWS, LEVEL, SINE, STRIBECK, WIDTH, TorqueLaw
from robid.signals.record import Record

MIN_LINES = 14
"""Silent lines that it takes to determine a law: two for each coefficient."""
_MIN_EXCITED = 4
_CONDITION_LIMIT = 1e8
_ITERATIONS = 12
_TOLERANCE = 0.1  # of the standard deviation
_REALIZATIONS = 2
_PRIOR_STD = np.array([coordinate.prior_std for coordinate in COORDINATES])
_LARGEST_STEP = np.array([coordinate.largest_step for coordinate in COORDINATES])
_DIFFERENCE = 0.02
_STRIBECK_RAD_S = 3.0
_ROUNDS = 3
_FLOOR = 1e-3


@dataclass(frozen=True)
class _Silent:
    """Blocks at all lines of the band, and which of these are excited."""

    blocks: Blocks
    motion: Motion
    excited: BoolArray
    laws: tuple[TorqueLaw, ...]
    ripple: ComplexArray

    def inverse_at_silent(self, removed: ComplexArray) -> ComplexArray:
        """G^-1 (n_silent, n_in, n_in), interpolated over the logarithm of frequency."""
        at_excited = self.blocks.select(np.flatnonzero(self.excited))
        corrected = replace(at_excited, inputs=at_excited.inputs - removed[:, self.excited])
        n_in = removed.shape[2]
        # The inverse is interpolated, since it is the torque G^-1 Y that must be silent but for friction.
        inverse = np.linalg.inv(logarithmic(corrected).response[:, :n_in])
        lines = np.log(self.blocks.lines)
        return np.asarray(CubicSpline(lines[self.excited], inverse)(lines[~self.excited]))


def start_laws(record: Record, laws: Sequence[TorqueLaw], delay_s: float) -> tuple[TorqueLaw, ...]:
    """Chooses each motor's kind of law and rough shape: the robot file's, bristles or curves of several widths.

    Args:
        record: Record of a single configuration.
        laws: Laws of the robot file, for the ripple's order and as candidates where they have friction.
        delay_s: Delay from recorded to applied torque, hold excluded [s].

    Raises:
        DataError: If too few lines are silent.
    """
    silent = _silent(record, laws, delay_s)
    generic = [replace(law, coulomb_nm=1.0, static_nm=1.0, stribeck_rad_s=_STRIBECK_RAD_S) for law in laws]
    candidates = [
        [replace(law, law=form, width=width) for law in generic] for form in LAWS.values() for width in form.widths
    ]
    candidates.append([law if law.coulomb_nm > 0 else rough for law, rough in zip(laws, candidates[0], strict=True)])
    levels, costs = zip(*(_level_only(silent, candidate) for candidate in candidates), strict=True)
    best = np.argmin(costs, axis=0)
    chosen = [candidates[pick][motor] for motor, pick in enumerate(best)]
    return tuple(
        replace(law, coulomb_nm=law.coulomb_nm * level, static_nm=law.static_nm * level)
        for law, level in zip(chosen, np.array(levels)[best, np.arange(len(laws))], strict=True)
    )


def identify_laws(record: Record, start: Sequence[TorqueLaw], delay_s: float, oversampling: int = 2) -> LawEstimate:
    """Identifies torque laws in one configuration.

    At a line that is not excited the linear robot is silent but for `G^-1 Y = U - F(law)`, G interpolated from
    the excited lines. F is linearised, the law moved, the response estimated anew, until nothing changes.

    Args:
        record: Record of a single configuration.
        start: Laws to start from, one per motor.
        delay_s: Delay from recorded to applied torque, hold excluded [s].
        oversampling: Grid points per sample of the motion that bristles follow.

    Raises:
        DataError: If too few lines are silent.

    Source:
        docs/methods, sec. 4.
    """
    silent = _silent(record, start, delay_s, oversampling)
    origin = values = np.array([law.coordinates for law in start])
    for _ in range(_ITERATIONS):
        torque, derivative = _linearise(silent, values)
        error = _torque_error(silent, torque)
        solved = [_step(error[:, :, m], derivative[:, :, :, m], values[m] - origin[m]) for m in range(len(values))]
        step = np.clip([step for step, _, _ in solved], -_LARGEST_STEP, _LARGEST_STEP)
        # A level stays positive, and breakaway is never below it.
        step[:, LEVEL] = np.maximum(step[:, LEVEL], -0.7 * values[:, LEVEL])
        values = values + step
        values[:, EXCESS] = np.maximum(values[:, EXCESS], 0)
        deviation = np.sqrt([np.diag(covariance) for _, covariance, _ in solved])
        if np.all(np.abs(step) < _TOLERANCE * deviation):
            break
    return _judged(silent, values, _torque_peak(record))


def _judged(silent: _Silent, values: FloatArray, torque_peak: FloatArray) -> LawEstimate:
    """The laws at their final values (n_in, 7), with covariance and what they explain of the silent torque."""
    torque, derivative = _linearise(silent, values)
    error = _torque_error(silent, torque)
    before, after, noise = _powers(silent, error, torque)
    significance = np.divide(before, noise, out=np.full_like(before, np.inf), where=noise > 0)
    explained = 1 - np.maximum(after - noise, 0) / np.maximum(before - noise, np.finfo(float).tiny)
    solved = [_step(error[:, :, m], derivative[:, :, :, m], np.zeros(len(values[m]))) for m in range(len(values))]
    covariance, form = (np.array(part) for part in list(zip(*solved, strict=True))[1:])
    form_share = np.maximum(after - noise, 0) / np.maximum(after, np.finfo(float).tiny)
    return LawEstimate(values, covariance, form, explained, significance, form_share, torque_peak)


def _silent(record: Record, laws: Sequence[TorqueLaw], delay_s: float, oversampling: int = 2) -> _Silent:
    record = record.realizations(_REALIZATIONS)
    lines = np.arange(record.excited_lines[0], record.excited_lines[-1] + 1)
    excited = np.isin(lines, record.excited_lines)
    telling = telling_count(lines[~excited], lines[excited])
    if telling < MIN_LINES or np.sum(excited) < _MIN_EXCITED:
        raise DataError(
            f"D024 only {telling} lines of the excited band are silent and can show friction, fewer than {MIN_LINES}",
            where="compensation: silent_lines",
            remedy="use `grid: odd` and fewer excited lines, a longer period, or `compensation: nominal`",
        )
    blocks = record_blocks(record, lines)
    _check_blocks(blocks, np.flatnonzero(excited))
    motion = record_motion(record, lines, delay_s, oversampling)
    return _Silent(blocks, motion, excited, tuple(laws), ripple_spectra(motion, laws))


def _check_blocks(blocks: Blocks, excited: IntArray) -> None:
    """Refuses experiments from which no response can be inverted."""
    n_in, n_exp = blocks.inputs.shape[2:]
    problem = "" if n_exp == n_in else f"{n_exp} experiments are no full block of {n_in} motors"
    moved = blocks.outputs[:, excited, :n_in]
    for kind, spectra in (("torque", blocks.inputs[:, excited]), ("motion", moved)):
        # NaN has no condition either.
        if not problem and not (np.isfinite(spectra).all() and np.linalg.cond(spectra).max() < _CONDITION_LIMIT):
            problem = f"the experiments do not tell the motors' {kind} apart"
    if problem:
        raise DataError(
            f"D025 {problem}: friction cannot be identified",
            where="compensation: silent_lines",
            remedy="record full blocks of experiments that move every motor, or use `compensation: nominal` or `none`",
        )


def _torque_peak(record: Record) -> FloatArray:
    """Largest torque (n_in,) of all periods, the mean of each experiment taken off."""
    torque = record.inputs[0]
    return np.asarray(np.abs(torque - torque.mean(axis=(2, 3), keepdims=True)).max(axis=(0, 1, 2, 3)))


def telling_count(silent: IntArray, excited: IntArray) -> int:
    """Counts the silent lines (n_silent,) that can show friction beside excited ones (n_line,)."""
    lines = np.concatenate([silent, excited])
    return int(np.sum(_telling(lines, np.arange(lines.size) >= silent.size)))


def _telling(lines: IntArray, excited: BoolArray) -> BoolArray:
    """Silent lines that friction, an odd function of the motion, reaches: the odd ones where only odd are excited."""
    odd_only = bool(np.all(lines[excited] % 2 == 1))
    return np.asarray(~excited & ((lines % 2 == 1) | (not odd_only)))


def _torque_error(silent: _Silent, removed: ComplexArray) -> ComplexArray:
    """`G^-1 Y - (U - F)` (n_real, n_silent, n_in, n_exp) at the silent lines."""
    quiet = ~silent.excited
    n_in = removed.shape[2]
    # The linear robot's torque for the motion, less the command, with friction taken out of both.
    motion = silent.inverse_at_silent(removed) @ silent.blocks.outputs[:, quiet, :n_in]
    return np.asarray(motion - silent.blocks.inputs[:, quiet] + removed[:, quiet])


def _linearise(silent: _Silent, values: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Torque (n_real, n_freq, n_in, n_exp) of the laws at all lines, and its derivative (7, ...) at the silent ones."""
    quiet = ~silent.excited

    def friction(moved: FloatArray) -> ComplexArray:
        return friction_spectrum(silent.motion, [law.at(row) for law, row in zip(silent.laws, moved, strict=True)])

    level = friction(values)
    slopes = []
    # Levels and lag enter in closed form; what bends the curve is differenced.
    for column in (EXCESS, STRIBECK, WIDTH):
        moved = values.copy()
        moved[:, column] += _DIFFERENCE
        slopes.append((friction(moved)[:, quiet] - level[:, quiet]) / _DIFFERENCE)
    here = level[:, quiet]
    omega = silent.motion.omega[quiet] * silent.motion.sampling_period_s
    derivative = np.stack(
        [here / values[:, LEVEL, None], *slopes, -1j * omega[:, None, None] * here, *silent.ripple[:, :, quiet]]
    )
    return level + np.einsum("iw,wrfie->rfie", values[:, SINE:], silent.ripple), derivative


def _step(
    error: ComplexArray, derivative: ComplexArray, moved: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Gauss-Newton step of one motor with lines weighted by what is left there, and what to make of it.

    Its sandwich covariance (7, 7) adds the powers of what the lines pull. An error of the law's form is no noise: at
    the excited lines, which no fit has balanced, it may pull one way at all of them. Then amplitudes add, and no
    coefficient is known worse than beforehand: the deviation (7,) that such an error gives.

    Args:
        error (n_real, n_silent, n_exp): Torque error.
        derivative (7, n_real, n_silent, n_exp): Its derivative.
        moved (7,): How far the values are from where they started, which the prior counts.
    """
    # Coefficients without effect, such as a ripple that the motor lacks, keep prior and value.
    used = np.flatnonzero(np.abs(derivative).max(axis=(1, 2, 3)) > 0)
    columns = derivative[used]
    prior = np.zeros(len(used))
    np.divide(1.0, _PRIOR_STD[used] ** 2, out=prior, where=np.isfinite(_PRIOR_STD[used]))
    step = np.zeros(len(used))
    # Sums over experiments once: only the weight of each line changes from round to round.
    gram = np.real(np.einsum("irfe,jrfe->fij", columns.conj(), columns))
    slope = np.real(np.einsum("irfe,rfe->fi", columns.conj(), error))
    count = error.shape[0] * error.shape[2]
    for _ in range(_ROUNDS):
        # Lines weigh by what is left there (iterated reweighting), with a floor against lines that fit by chance.
        left = np.mean(np.abs(error + np.tensordot(step, columns, 1)) ** 2, axis=(0, 2))
        weight = 2 / (left + _FLOOR * np.median(left)) / count
        hessian = np.einsum("f,fij->ij", weight, gram) + np.diag(prior)
        step = -np.linalg.solve(hessian, weight @ slope + prior * moved[used])
    # Scores of single lines: their sum of squares is the meat of the sandwich.
    score = weight[:, None] * (slope + gram @ step)
    inverse = np.linalg.inv(hessian)
    full_step, covariance, form = np.zeros(len(moved)), np.eye(len(moved)), np.ones(len(moved))
    full_step[used] = step
    covariance[np.ix_(used, used)] = inverse @ (score.T @ score + np.diag(prior)) @ inverse
    # An error of form may pull one way at all lines: amplitudes add, not powers.
    together = np.abs(score @ inverse).sum(axis=0) ** 2 + np.diag(inverse @ np.diag(prior) @ inverse)
    form[used] = np.minimum(np.sqrt(together), _PRIOR_STD[used])
    return full_step, covariance, form


def _level_only(silent: _Silent, laws: Sequence[TorqueLaw]) -> tuple[FloatArray, FloatArray]:
    """Levels (n_in,) over the laws' own that fit best, and the share of each motor's silent torque left (n_in,)."""
    quiet = ~silent.excited
    unit = friction_spectrum(silent.motion, laws)
    level = np.zeros(len(laws))
    for _ in range(_ROUNDS):
        removed = level[:, None] * unit
        torque = _torque_error(silent, removed) - removed[:, quiet]
        weight = 1 / np.mean(np.abs(torque) ** 2, axis=(0, 3))
        shape = unit[:, quiet]
        # Weighted least squares of one number for each motor, a positive one.
        level = -np.einsum("fi,rfie->i", weight, np.real(shape.conj() * torque))
        level /= np.einsum("fi,rfie->i", weight, np.abs(shape) ** 2)
        level = np.maximum(level, np.finfo(float).eps)
    left = np.einsum("fi,rfie->i", weight, np.abs(torque + level[:, None] * shape) ** 2)
    return level, left / np.einsum("fi,rfie->i", weight, np.abs(torque) ** 2)


def _powers(silent: _Silent, error: ComplexArray, removed: ComplexArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Power (n_in,) of the telling lines' torque before and after compensation and of its noise, weighted as fitted."""
    quiet = ~silent.excited
    before = np.mean(np.abs(error - removed[:, quiet]) ** 2, axis=(0, 3))
    after = np.mean(np.abs(error) ** 2, axis=(0, 3))
    noise = np.zeros_like(before)
    blocks = silent.blocks
    if blocks.scatter_freedom:
        n_in = removed.shape[2]
        motion = silent.inverse_at_silent(removed) @ blocks.output_scatter[:, :, quiet, :n_in]
        deviation = motion - blocks.input_scatter[:, :, quiet]
        noise = np.mean(np.sum(np.abs(deviation) ** 2, axis=1), axis=(0, 3)) / blocks.scatter_freedom
    weight = 1 / (after + _FLOOR * np.median(after, axis=0))
    weight *= _telling(blocks.lines, silent.excited)[quiet, None]
    return (weight * before).sum(axis=0), (weight * after).sum(axis=0), (weight * noise).sum(axis=0)
