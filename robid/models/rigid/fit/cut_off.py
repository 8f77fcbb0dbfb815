"""The positions' cut-off, chosen by what its parameters say of pieces of the log that they never saw."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.models.rigid.fit.options import PreprocessingOptions
from robid.models.rigid.fit.regression import Reduction, reduce_rows
from robid.models.rigid.fit.rows import Rows
from robid.models.rigid.fit.shots import Shot, motion_of
from robid.robot.regressor.model import RigidModel
from robid.signals.filters import central_differences, design_decimator, low_pass_reach

_ROWS = 3.0  # at least, all joints together, over the parameters
_ENOUGH = 2.0  # times these, where a cut-off is to be chosen
_PIECES = 8  # of the log, each of which is left out once
_FEWEST_PIECES = 4
_RATIO = 1.5  # of one cut-off to the next
_BAND = 3.0  # band in which all are compared over the motion's
_HIGHEST, _WIDEST = 0.2, 40.0  # highest cut-off over the sampling rate, and over the motion's band
_SHARE = 0.99  # of the speed's power
_ABOVE_FLOOR = 20.0
_NO_STEP = 1e-6  # of the largest step of a position
_SEGMENT = 1 << 15
_LEAST_GAIN = 1e-12  # of a difference, whose gain vanishes at half the sampling rate
_OVERSAMPLED = 10.0  # samples per period of the cut-off of columns that are smooth along the motion
_DRY = (
    "coulomb",
    "coupling_coulomb",
    "load_friction",
    "quadratic_viscous",
    "viscous",
    "coupling_viscous",
)  # may jump along the motion
_MEMORY = 0.6  # periods of the cut-off after which its filter has forgotten
_TRUNCATED = 1e-6  # of the largest singular value, below which the rows do not determine a direction
_WEIGHINGS = 5


@dataclass(frozen=True)
class CutOffChoice:
    """A cut-off, and the errors on pieces left out that it was chosen by."""

    cut_hz: float  # the lowest one whose error is within one standard error of the smallest [Hz]
    motion_hz: FloatArray  # (n_joint,): frequency below which 99 % of the power of each joint's speed lies [Hz]
    band_hz: float  # the band of positions and torques in which all were compared [Hz]
    trial_hz: FloatArray  # (n_trial,): cut-offs that were tried, ascending [Hz]
    error: FloatArray  # (n_trial,): root mean square of all motors' errors, each over the RMS of its torque
    deviation: FloatArray  # (n_trial,): standard error of what its square differs from the smallest one's
    # (n_joint,) each, in that band, root mean squares by the chosen cut-off; NaN where nothing is left out [N m, or N]
    left_out: FloatArray  # error of each motor's torque on pieces left out
    residual: FloatArray  # what is left of it by the parameters of all pieces


@dataclass(frozen=True)
class _Pieces:
    """Rows of each piece of the log at one cut-off, reduced; None for a piece without rows."""

    reductions: tuple[Reduction | None, ...]

    @property
    def n_row(self) -> int:
        """Rows of all pieces, all joints together."""
        return sum(int(each.n_row.sum()) for each in self.reductions if each is not None)

    def without(self, piece: int | None) -> list[Reduction]:
        """The pieces but one."""
        return [each for index, each in enumerate(self.reductions) if each is not None and index != piece]

    def error(self, parameters: FloatArray) -> FloatArray:
        """Mean square (n_joint,) of what parameters (n_param,) leave of the torques, all pieces together."""
        every = self.without(None)
        return np.asarray(sum(each.cost(parameters) for each in every) / self._count)

    @property
    def mean_square(self) -> FloatArray:
        """Mean square (n_joint,) of the torques, all pieces together; never zero."""
        square = sum(np.sum(each.factors[:, :, -1] ** 2, axis=1) for each in self.without(None)) / self._count
        return np.asarray(np.maximum(square, np.finfo(float).tiny))

    @property
    def _count(self) -> FloatArray:
        return np.asarray(np.maximum(np.sum([each.n_row for each in self.without(None)], axis=0), 1.0))


def choose_cut_off(
    shots: Sequence[Shot], model: RigidModel, options: PreprocessingOptions, candidates_hz: Sequence[float] = ()
) -> CutOffChoice:
    """Tries cut-offs from the motion's band upwards, or some candidates, and compares what they say of pieces left out.

    The quantisation of an encoder is white, so that its second derivative grows with the square of the frequency: too
    high a cut-off lets it into the columns, which biases the parameters, and too low a one takes motion out of them.
    Each cut-off's rows of all other pieces give parameters; these predict the torques of the piece, which are filtered
    in one band for all, as each in a band of its own would show what filtering hides. Positions are in rad, or m,
    torques of the motors in N m, or N.

    Raises:
        ValueError: If the record is too short for any of them.

    Source:
        Hastie, Tibshirani and Friedman (2009), sec. 7.10: cross-validation with the rule of one standard error;
        docs/methods, sec. 7.
    """
    motion = motion_band(shots)
    lowest = float(motion.max())
    highest = min(_HIGHEST / shots[0].sampling_period_s, _WIDEST * lowest)
    count = max(1, int(np.log(highest / lowest) / np.log(_RATIO)) + 1)
    cuts = sorted(candidates_hz) or [min(lowest, highest) * _RATIO**index for index in range(count)]
    fewest = fewest_rows(len(model.names), 1)
    every = ((cut, _pieces(shots, model, options, cut)) for cut in cuts)
    tried = {cut: pieces for cut, pieces in every if pieces is not None and pieces.n_row >= fewest}
    # A low cut-off leaves few rows, from which nothing tells how far residuals are correlated.
    tried = {cut: each for cut, each in tried.items() if each.n_row >= _ENOUGH * fewest} or tried
    band, seen = _compared(shots, model, options, min(_BAND * lowest, highest), highest)
    if not tried or seen is None:
        samples = sum(len(shot.position) for shot in shots)
        message = f"{samples} samples leave too few rows for {len(model.names)} parameters at any cut-off"
        raise ValueError(message)
    squares = np.array([_left_out(pieces, seen) for pieces in tried.values()])
    each = (squares / seen.mean_square).mean(axis=2)
    mean = each.mean(axis=1)
    # The pieces are the same for all cut-offs, and so is most of their error: differences are compared piece by piece.
    away = each - each[np.argmin(mean)]
    deviation = away.std(axis=1, ddof=1) / np.sqrt(away.shape[1])
    chosen = int(np.flatnonzero(away.mean(axis=1) <= deviation)[0])
    return CutOffChoice(
        cut_hz=list(tried)[chosen],
        motion_hz=motion,
        band_hz=band,
        trial_hz=np.array(list(tried)),
        error=np.sqrt(mean),
        deviation=deviation,
        left_out=np.sqrt(squares[chosen].mean(axis=0)),
        residual=np.sqrt(seen.error(_fitted(list(tried.values())[chosen].without(None)))),
    )


def unchosen(shots: Sequence[Shot], cut_hz: float) -> CutOffChoice:
    """Returns a stated cut-off of a log that is too short to leave out pieces of it."""
    none: FloatArray = np.zeros(0)
    motion = motion_band(shots)
    unknown = np.full(len(motion), np.nan)
    return CutOffChoice(cut_hz, motion, np.nan, none, none, none, unknown, unknown)


def motion_band(shots: Sequence[Shot], derivative: int = 1) -> FloatArray:
    """Returns the frequency (n_joint,) below which 99 % of the power of the speed, or acceleration, lies [Hz].

    What does not stand far above the floor of the encoder's noise does not count, nor do the highest frequencies that
    hold no more of the positions than their rounding: of a few steps per sample or fewer, that is no white noise.
    """
    from scipy.signal import welch

    found = []
    for shot in shots:
        period = shot.sampling_period_s
        signal = central_differences(shot.position, period)[derivative - 1]
        hertz, power = welch(signal, 1 / period, nperseg=min(len(signal), _SEGMENT), axis=0, detrend=False)
        hertz, power = hertz[1:], power[1:]
        # White noise of an encoder is flat as a position: the differences' gain is taken out to find its floor.
        angle = 2 * np.pi * hertz[:, None] * period
        gain = np.sin(angle) if derivative == 1 else 2 * (1 - np.cos(angle))
        as_position = power / np.maximum(gain**2, _LEAST_GAIN)
        floor = np.median(as_position[len(as_position) // 2 :], axis=0)
        # Positions rounded to steps of d have an error of d^2 / 12, wherever in frequency it lies.
        density = welch(shot.position, 1 / period, nperseg=min(len(signal), _SEGMENT), axis=0, detrend="linear")[1][1:]
        above = np.cumsum(density[::-1], axis=0)[::-1] * hertz[0]
        counts = (as_position > _ABOVE_FLOOR * floor) & (above > _step(shot.position) ** 2 / 12)
        # The power that stands above the floor, added up from below.
        within = np.cumsum(np.where(counts, power, 0.0), axis=0)
        found.append(hertz[np.argmax(within >= _SHARE * within[-1], axis=0)])
    return np.asarray(np.max(found, axis=0))


def _step(position: FloatArray) -> FloatArray:
    """Smallest step (n_joint,) of positions (n_sample, n_joint) that is no rounding of their numbers."""
    size = np.abs(np.diff(position, axis=0))
    return np.asarray(np.min(np.where(size > _NO_STEP * size.max(axis=0), size, np.inf), axis=0, initial=np.inf))


def row_count(n_sample: int, options: PreprocessingOptions, sampling_period_s: float) -> int:
    """Returns how many rows of a joint the filters leave of a record."""
    inner = n_sample - 2 * low_pass_reach(sampling_period_s, options.cut_hz, options.position_order) - 2
    return len(options.decimator(sampling_period_s).kept(inner))


def shot_of_rows(shots: Sequence[Shot], options: PreprocessingOptions) -> IntArray:
    """Returns the index of the shot that each row of all shots, one after the other, is of (n_row,)."""
    counts = [row_count(len(shot.position), options, shot.sampling_period_s) for shot in shots]
    return np.repeat(np.arange(len(shots)), counts)


def fewest_rows(n_param: int, n_joint: int) -> int:
    """Returns how many rows of a joint a fit needs at least."""
    return math.ceil(_ROWS * n_param / n_joint)


def _pieces(shots: Sequence[Shot], model: RigidModel, options: PreprocessingOptions, cut_hz: float) -> _Pieces | None:
    """Cuts the log into pieces of one length and reduces the rows of each; None where the filters leave none.

    Rows that are nearer to an end of their piece than the filter remembers are left out: they would know the next one.
    """
    ends = np.cumsum([len(shot.position) for shot in shots])
    borders = np.linspace(0, ends[-1], _PIECES + 1)
    parts: list[list[Rows]] = [[] for _ in range(_PIECES)]
    for shot, end in zip(shots, ends.tolist(), strict=True):
        start = end - len(shot.position)
        try:
            rows, centre = _rows(shot, model, replace(options, position_cut_hz=cut_hz, decimation=0))
        except ValueError:  # shorter than its filter
            continue
        centre = centre + start
        own = np.clip(np.searchsorted(borders, centre, side="right") - 1, 0, _PIECES - 1)
        near = _MEMORY / (cut_hz * shot.sampling_period_s)
        # The ends of a shot border on nothing.
        apart = (centre - borders[own] > near) | (borders[own] <= start)
        apart &= (borders[own + 1] - centre > near) | (borders[own + 1] >= end)
        for piece in np.unique(own[apart]).tolist():
            here = apart & (own == piece)
            parts[piece].append(Rows(rows.columns[here], rows.torque[here], rows.used[here]))
    is_told = [any(rows.used.any() for rows in part) for part in parts]
    if sum(is_told) < _FEWEST_PIECES:
        return None
    return _Pieces(tuple(reduce_rows(part) if told else None for part, told in zip(parts, is_told, strict=True)))


def _compared(
    shots: Sequence[Shot], model: RigidModel, options: PreprocessingOptions, band_hz: float, highest_hz: float
) -> tuple[float, _Pieces | None]:
    """The band in which cut-offs are compared, twice and again twice as wide where pieces are too short for it."""
    while True:
        seen = _pieces(shots, model, options, band_hz)
        if seen is not None or band_hz >= highest_hz:
            return band_hz, seen
        band_hz = min(2 * band_hz, highest_hz)


def _rows(shot: Shot, model: RigidModel, options: PreprocessingOptions) -> tuple[Rows, IntArray]:
    """Rows of a shot, and the sample that each stands for.

    Columns of the links are smooth along the motion: they are made at some samples per period of the cut-off only,
    which at a low one are a small part of all.
    """
    motion, cut_samples = motion_of(shot, model, options), 1 / (options.cut_hz * shot.sampling_period_s)
    first, end = motion.reach + 1, len(shot.position) - motion.reach - 1
    around = motion.smooth(shot.position, first - 1, end + 1)
    path = (around[1:-1], *central_differences(around, shot.sampling_period_s))
    # Torques and friction, which jumps, are decimated in two steps, the links' columns in the second alone: below the
    # cut-off the first step leaves all as it is.
    coarse = design_decimator(max(1, int(cut_samples / _OVERSAMPLED)))
    fine = design_decimator(max(1, round(cut_samples / 2 / coarse.factor)))
    at = coarse.kept(len(path[0]))
    torque = motion.centred_torque(first, end)
    load = motion.smooth(motion.torque, first, end) if motion.load_dependent else None
    is_dry = np.isin(np.array(model.kinds), _DRY)
    columns = np.empty((len(at), shot.position.shape[1], len(is_dry)))
    smooth, dry = (model.only(np.flatnonzero(chosen).tolist()) for chosen in (~is_dry, is_dry))
    columns[..., ~is_dry] = smooth.columns(*(each[at] for each in path), loaded=motion.loaded)
    if is_dry.any():
        columns[..., is_dry] = coarse(dry.columns(*path, torque=load))
    kept = fine.kept(len(at))
    used = np.abs(path[1][at[kept]]) >= motion.slow
    used = used if motion.rest is None else used & ~motion.rest[first + at[kept]]
    return Rows(fine(columns), fine(coarse(torque)), used), np.asarray(first + at[kept])


def _left_out(pieces: _Pieces, seen: _Pieces) -> FloatArray:
    """Mean squared errors (n_piece, n_joint) of the torques of pieces by the parameters of all others."""
    pairs = ((index, piece) for index, piece in enumerate(seen.reductions) if piece is not None)
    return np.array([piece.cost(_fitted(pieces.without(index))) / np.maximum(piece.n_row, 1) for index, piece in pairs])


def _fitted(reductions: Sequence[Reduction]) -> FloatArray:
    """Weighted least squares (n_param,) of some pieces together."""
    stacked = np.concatenate([each.factors for each in reductions], axis=1)
    joined = Reduction(np.asarray(np.linalg.qr(stacked, mode="r")), np.sum([each.n_row for each in reductions], axis=0))
    weights: FloatArray = np.ones(len(joined.n_row))
    for _ in range(_WEIGHINGS):
        parameters = _least(joined.weighted(weights))
        weights = joined.n_row / np.maximum(joined.cost(parameters), np.finfo(float).tiny)
    return parameters


def _least(factor: FloatArray) -> FloatArray:
    """Least squares (n_param,) of a triangular factor of `[W y]`; what the rows do not determine stays zero."""
    triangle, right = factor[:-1, :-1], factor[:-1, -1]
    size = np.linalg.norm(triangle, axis=0)
    size = np.where(size > 0, size, 1.0)
    return np.asarray(np.linalg.lstsq(triangle / size, right, rcond=_TRUNCATED)[0] / size)
