"""Tracks: a motion's angles, torques and deflections behind one low pass, at the instants that are fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.models.transmission.fit.motions import Motion
from robid.models.transmission.fit.options import TransmissionFitOptions
from robid.robot.description import Robot
from robid.signals.filters import low_pass, low_pass_reach

_STILL = 1e-6  # rad, or m
_OTHER, _FOLLOWS = 0.02, 0.9999
_FINEST = 0.2  # of the sampling rate
_LOWEST = 1.5  # of the cut-off of the rows: what the arms' encoders are smoothed to at most
_QUIET = 0.02  # of a deflection: noise that may stay
_ROWS_PER_CUT = 8  # rows a second, over the cut-off


@dataclass(frozen=True)
class Course:
    """Positions of something and their derivatives by time, each (n_row, n)."""

    position: FloatArray  # [rad, or m]
    speed: FloatArray
    acceleration: FloatArray
    jerk: FloatArray

    def later(self, lag_s: float, column: int) -> tuple[FloatArray, FloatArray]:
        """Returns one column (n_row,) some time later, and its slope by that time.

        What has passed the low pass is smooth: three derivatives are exact to rounding for lags of some milliseconds.
        """
        rows = [each[:, column] for each in (self.position, self.speed, self.acceleration, self.jerk)]
        moved = rows[0] + lag_s * (rows[1] + lag_s * (rows[2] / 2 + lag_s * rows[3] / 6))
        return moved, rows[1] + lag_s * (rows[2] + lag_s * rows[3] / 2)


@dataclass(frozen=True)
class Fine:
    """What hysteresis remembers: a motion up to the frequencies of transmission errors, from its first sample on."""

    period_s: float
    rows: IntArray  # (n_row,) Which of its samples the rows of the track are
    geared: FloatArray  # (n_fine, n_gear) Arms as their motors show them [rad, or m]
    shown: FloatArray  # (n_fine, n_gear) Arms as their encoders show them [rad, or m]
    waves: FloatArray  # (n_fine, n_gear, n_order, 2) Sine and cosine of the motors' angles times the orders
    noise: FloatArray  # (n_gear,) Deviation of the encoders' noise in their difference

    def later(self, lag_s: float, column: int) -> FloatArray:
        """Returns what an arm's encoder shows (n_fine,) some time later; what is not known stays as it was last."""
        time_s = self.period_s * np.arange(len(self.shown))
        at = np.clip(time_s + lag_s, 0.0, time_s[-1])
        return np.asarray(CubicSpline(time_s, self.shown[:, column])(at))


@dataclass(frozen=True)
class Track:
    """A motion at the instants that are fitted."""

    name: str
    period_s: float  # Time between rows
    time_s: FloatArray  # (n_row,)
    motor: Course  # Of all motors
    arm: Course  # Of all arms: as their encoders show them, where they have one, else as their motors do
    geared: Course  # Of the arms with an encoder, as their motors show them
    shown: Course  # Of these, as their own encoders show them
    torque: FloatArray  # (n_row, n_joint) Motor torques [N m]
    sense: FloatArray  # (n_row, n_joint) Signs of the motors' speeds
    fine: Fine


def tracks_of(motions: Sequence[Motion], robot: Robot, options: TransmissionFitOptions) -> tuple[Track, ...]:
    """Filters motions and keeps some rows a second.

    Raises:
        DataError: If sampling is too slow, or a motion too short, for the cut-off; or motions differ in their gears.
    """
    if len({motion.gears for motion in motions}) > 1:
        message = "D674 the records of one fit have link encoders on different joints"
        raise DataError(message, where="record", remedy="fit them one by one, or log them alike")
    tracks = [_track(motion, robot, options) for motion in motions]
    _refuse_other_turns(tracks, [robot.joints[gear].name for gear in motions[0].gears])
    return aligned(tracks, motions[0].gears)


def _refuse_other_turns(tracks: Sequence[Track], names: Sequence[str]) -> None:
    """Refuses arms that move another way than their motors."""
    for column, name in enumerate(names):
        motor, arm = (
            np.concatenate([course.position[:, column] - course.position[:, column].mean() for course in courses])
            for courses in ([track.geared for track in tracks], [track.shown for track in tracks])
        )
        if np.ptp(motor) <= _STILL or np.ptp(arm) <= _STILL:
            message = f"D677 {name} does not move, or its arm's encoder does not"
            raise DataError(message, where="record", remedy="move all joints with two encoders, or leave that one out")
        turns = float(motor @ arm / (motor @ motor))
        follows = float(abs(motor @ arm) / np.sqrt((motor @ motor) * (arm @ arm)))
        # Near resonances an arm moves otherwise, too, but not in proportion.
        if abs(turns - 1) > _OTHER and follows > _FOLLOWS:
            message = f"D678 the arm of {name} moves {turns:.4g} times as its motor says through the gear"
            remedy = "check sign and unit of its angle in the log, and the robot file's gear ratio and couplings"
            raise DataError(message, where="record", remedy=remedy)


def aligned(tracks: Sequence[Track], gears: Sequence[int]) -> tuple[Track, ...]:
    """Returns the tracks with arms as they are, not as their encoders show them some milliseconds later.

    The lag that a straight line gives is good enough for what loads the gears; the fit itself estimates it anew.
    """
    lags = []
    for column in range(len(gears)):
        speed = np.concatenate([track.shown.speed[:, column] for track in tracks])
        behind = np.concatenate([(track.geared.position - track.shown.position)[:, column] for track in tracks])
        rows = np.stack([speed, np.ones(len(speed))], axis=1)
        lags.append(float(np.linalg.lstsq(rows, behind, rcond=None)[0][0]))
    return tuple(_with_arms(track, gears, lags) for track in tracks)


def _with_arms(track: Track, gears: Sequence[int], lags: Sequence[float]) -> Track:
    arm = [each.copy() for each in (track.arm.position, track.arm.speed, track.arm.acceleration, track.arm.jerk)]
    for column, (gear, lag) in enumerate(zip(gears, lags, strict=True)):
        for order, own in enumerate(arm[:3]):
            own[:, gear] = arm[order][:, gear] + lag * arm[order + 1][:, gear]
        arm[0][:, gear] = track.shown.later(lag, column)[0]
    return replace(track, arm=Course(*arm))


def _track(motion: Motion, robot: Robot, options: TransmissionFitOptions) -> Track:
    period_s, cut_hz = motion.sampling_period_s, options.cut_hz
    if cut_hz * period_s >= 0.25:
        message = f"D675 the low pass at {cut_hz:g} Hz is too fast for samples every {period_s:g} s"
        raise DataError(message, where=motion.name, remedy=f"let `cut_hz` be below {0.25 / period_s:.3g}")
    reach, step = low_pass_reach(period_s, cut_hz), max(1, int(1 / (_ROWS_PER_CUT * cut_hz * period_s)))
    rows = np.arange(reach, len(motion.motor) - reach, step)
    if len(rows) * step * period_s * cut_hz < 4:
        message = f"D676 a motion of {len(motion.motor) * period_s:.3g} s is too short for a low pass at {cut_hz:g} Hz"
        raise DataError(message, where=motion.name, remedy="record longer, or raise `cut_hz`")

    def smooth(signal: FloatArray) -> FloatArray:
        return low_pass(signal, period_s, cut_hz)

    gears = list(motion.gears)
    motor, shown = smooth(motion.motor), smooth(motion.arm)
    geared = motor @ robot.arm_per_motor.T
    arm = geared.copy()
    arm[:, gears] = shown
    speed = np.gradient(motor, period_s, axis=0)
    fine = _fine(motion, robot, options, rows)
    return Track(
        name=motion.name,
        period_s=step * period_s,
        time_s=rows * period_s,
        motor=_course(motor, period_s, rows),
        arm=_course(arm, period_s, rows),
        geared=_course(geared[:, gears], period_s, rows),
        shown=_course(shown, period_s, rows),
        torque=smooth(motion.torque)[rows],
        sense=smooth(np.sign(speed))[rows],
        fine=fine,
    )


def _fine(motion: Motion, robot: Robot, options: TransmissionFitOptions, rows: IntArray) -> Fine:
    """Keeps what is needed up to the fine cut-off; rows are among its samples."""
    period_s, gears = motion.sampling_period_s, list(motion.gears)
    cut_hz = min(options.fine_cut_hz, _FINEST / period_s)
    every = rows[1] - rows[0]
    step = next(
        each for each in range(min(every, max(1, int(1 / (4 * cut_hz * period_s)))), 0, -1) if every % each == 0
    )
    start = rows[0] % step
    kept = np.arange(start, len(motion.motor), step)
    geared = motion.motor @ robot.arm_per_motor[gears].T
    smooth_geared = low_pass(geared, period_s, cut_hz)
    smooth_shown, noise = _quiet(motion.arm, geared, period_s, (options.cut_hz, cut_hz))
    turns = motion.motor[kept][:, gears, None] * np.array(options.gear.motor_orders)
    return Fine(
        period_s=step * period_s,
        rows=(rows - start) // step,
        geared=smooth_geared[kept],
        shown=smooth_shown[kept],
        waves=np.stack([np.sin(turns), np.cos(turns)], axis=3),
        noise=noise,
    )


def _quiet(
    shown: FloatArray, geared: FloatArray, period_s: float, band_hz: tuple[float, float]
) -> tuple[FloatArray, FloatArray]:
    """Smooths what the arms' encoders show (n_sample, n_gear) as far as their noise asks for, and returns what is left.

    Hysteresis would be shaken loose by noise. Above resonances arms hardly move, so that a lower cut-off, down to some
    times that of the rows, takes little of the motion; what motors do and what gears err stays.
    """
    lowest_hz, highest_hz = _LOWEST * band_hz[0], band_hz[1]
    found, noise = np.empty_like(shown), np.empty(shown.shape[1])
    for column in range(shown.shape[1]):
        own = shown[:, column : column + 1]
        smooth = low_pass(own, period_s, highest_hz)
        # What the filter removed is noise for its greater part, and white.
        white = float(np.std(own - smooth)) * np.sqrt(2 * highest_hz * period_s)
        rows = np.stack([np.gradient(smooth[:, 0], period_s), np.ones(len(own))], axis=1)
        behind = geared[:, column] - smooth[:, 0]
        bent = float(np.std(behind - rows @ np.linalg.lstsq(rows, behind, rcond=None)[0]))
        share = 1.0 if white <= _QUIET * bent else (_QUIET * bent / white) ** 2
        cut_hz = max(share * highest_hz, min(lowest_hz, highest_hz))
        found[:, column] = smooth[:, 0] if cut_hz == highest_hz else low_pass(own, period_s, cut_hz)[:, 0]
        noise[column] = white * np.sqrt(cut_hz / highest_hz)
    return found, noise


def _course(position: FloatArray, period_s: float, rows: IntArray) -> Course:
    """Differentiates what is smooth, by central differences."""
    found = [position]
    for _ in range(3):
        found.append(np.gradient(found[-1], period_s, axis=0))
    return Course(*(each[rows] for each in found))
