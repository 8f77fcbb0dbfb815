"""The decoupling map: which outputs follow which commands, in which band, and up to where channels are apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.signal import csd

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray, Quantity
from robid.errors import DataError
from robid.models.external.fit.data import Shot
from robid.models.external.fit.etfe import Etfe, moved_inputs, together
from robid.models.external.fit.options import CouplingOptions

_SHORTEST = 8  # samples of a segment
_INDEPENDENT = 0.85  # of Hann segments that overlap by half, for the tail of the coherence, by trial on white noise
_EXCITED = 1e-4  # of a command's largest power density

_RESPONSE = "frequency output input"


@dataclass(frozen=True)
class Pairs:
    """Commands and outputs of a map."""

    inputs: tuple[str, ...]  # name of each command
    outputs: tuple[str, ...]
    input_resolution: FloatArray  # (n_in,): resolution of each command, in its unit
    output_resolution: FloatArray  # (n_out,): the same of each output
    own: BoolArray  # (n_out, n_in): which pairs are one channel and no coupling

    @property
    def per_resolution(self) -> FloatArray:
        """What a gain (n_out, n_in) is multiplied with to be one of resolutions."""
        return np.asarray(self.input_resolution / self.output_resolution[:, None])


@dataclass(frozen=True)
class CouplingMap:
    """How far each output follows each command; NaN where a command rests or was not excited."""

    bands: Annotated[tuple[str, ...], Quantity("1", "band", "Shots")]
    highest_hz: Annotated[FloatArray, Quantity("Hz", "band", "Highest excited frequency")]
    # Root of the largest magnitude-squared coherence; NaN where a command rests.
    coherence: Annotated[FloatArray, Quantity("1", "band output input", "Root of the largest coherence")]
    limit: Annotated[FloatArray, Quantity("1", "band", "What chance alone reaches")]
    # Size of what of the output follows the command over that of the command, each in its resolutions.
    ratio: Annotated[FloatArray, Quantity("1", "band output input", "Magnitude ratio in resolutions")]
    own: Annotated[BoolArray, Quantity("1", "output input", "Whether it is one channel and no coupling")]
    coupled: Annotated[BoolArray, Quantity("1", "band output input", "Whether both are above their thresholds")]
    frequency_hz: Annotated[FloatArray, Quantity("Hz", "frequency")]
    gain: Annotated[FloatArray, Quantity("1", _RESPONSE, "Magnitude of the empirical response in resolutions")]
    gain_radius: Annotated[FloatArray, Quantity("1", _RESPONSE, "Its confidence radius")]
    # Lowest frequency at which the gain is above its threshold beyond doubt; infinite where it never is, NaN where it
    # was not examined.
    crossing_hz: Annotated[FloatArray, Quantity("Hz", "output input", "Where the gain exceeds its threshold")]
    examined_hz: float  # highest frequency that was examined [Hz]
    decoupled_up_to_hz: Annotated[FloatArray, Quantity("Hz", "input", "Up to where a channel is decoupled")]
    overall_hz: float  # frequency up to which this holds of all [Hz]
    sentence: str  # what couples, and what to do


def map_coupling(
    shots: Sequence[Shot], floor: FloatArray, etfe: Etfe, pairs: Pairs, options: CouplingOptions
) -> CouplingMap:
    """Maps the coupling of all outputs to all commands.

    Where several commands move at once, the coherence is the partial one: what the others explain is taken out. A
    command moves from the amplitude `floor` (n_in,) on.

    Source:
        Oliveira et al. (2019), sec. 3.2.1, Fig. 9.
    """
    groups = together(shots, floor)
    found = zip(*(_band(group, floor, options) for group in groups), strict=True)
    root, ratio, limit, highest_hz = (np.array(each) for each in found)
    ratio = ratio * pairs.per_resolution
    high = root > np.maximum(options.coherence, limit[:, None, None])
    coupled = high & (ratio > options.ratio) & ~pairs.own
    gain, radius = np.abs(etfe.response) * pairs.per_resolution, etfe.radius * pairs.per_resolution
    first = _first_coupled(etfe.frequency_hz, gain, radius, options.ratio, coupled)
    crossing = np.where(pairs.own, np.nan, first)
    seen = np.isfinite(gain - radius).any(axis=(1, 2))
    examined_hz = float(etfe.frequency_hz[seen][-1]) if seen.any() else 0.0
    upto = _decoupled(crossing, pairs.own, examined_hz)
    return CouplingMap(
        bands=tuple(group[0].name for group in groups),
        highest_hz=highest_hz,
        coherence=root,
        limit=limit,
        ratio=ratio,
        own=pairs.own,
        coupled=coupled,
        frequency_hz=etfe.frequency_hz,
        gain=gain,
        gain_radius=radius,
        crossing_hz=crossing,
        examined_hz=examined_hz,
        decoupled_up_to_hz=upto,
        overall_hz=float(upto.min()),
        sentence=_sentence(coupled, crossing, pairs, float(upto.min()), examined_hz),
    )


def coherence_limit(averages: float, frequencies: int, level: float) -> float:
    """Returns the root coherence that the largest of unrelated signals' exceeds with a chance of `level`.

    `averages` counts independent segments, `frequencies` those of which the largest is taken.
    """
    # The largest of F independent coherences stays below x with (1 - p)^F, where one exceeds it with p = (1 - x^2)^(n -
    # 1).
    each = 1 - (1 - level) ** (1 / max(frequencies, 1))
    return float(np.sqrt(1 - each ** (1 / max(averages - 1, 1e-9))))


def _band(
    group: Sequence[Shot], floor: FloatArray, options: CouplingOptions
) -> tuple[FloatArray, FloatArray, float, float]:
    """Coherence and size of what follows (n_out, n_in), the chance coherence and the highest frequency of a group."""
    moved = np.flatnonzero(np.any([moved_inputs(shot, floor) for shot in group], axis=0))
    shape = group[0].outputs.shape[1], group[0].inputs.shape[1]
    root, ratio = np.full(shape, np.nan), np.full(shape, np.nan)
    frequency_hz, spectra = _cross_spectra(group, moved, options.segments)
    count, highest_hz = 0, 0.0
    for place, index in enumerate(moved):
        told, cross, answer = _partial(spectra, place, len(moved))
        excited = told > _EXCITED * told.max()
        if not excited.any():
            continue
        count, highest_hz = max(count, int(excited.sum())), max(highest_hz, float(frequency_hz[excited][-1]))
        # |S_uy|^2 / S_uu is the power of the output that follows the command: over S_yy the coherence, over S_uu the
        # squared gain.
        shared = np.abs(cross[excited]) ** 2 / told[excited, None]
        squared = np.divide(shared, answer[excited], out=np.zeros_like(shared), where=answer[excited] > 0)
        root[:, index] = np.sqrt(squared.max(axis=0))
        ratio[:, index] = np.sqrt(shared.sum(axis=0) / told[excited].sum())
    segments = options.segments * len(group)
    limit = coherence_limit(_INDEPENDENT * segments - (len(moved) - 1), count, options.level)
    return root, ratio, limit, highest_hz


def _cross_spectra(group: Sequence[Shot], moved: IntArray, segments: int) -> tuple[FloatArray, ComplexArray]:
    """Cross spectral densities (n_freq, n_signal, n_signal) of moving commands and outputs, by Welch's method."""
    n_sample = len(group[0].inputs)
    length = 2 * n_sample // (segments + 1)
    if length < _SHORTEST:
        message = f"D146 {segments} segments of a motion of {n_sample} samples are shorter than {_SHORTEST} samples."
        remedy = f"ask for {2 * n_sample // _SHORTEST - 1} at most"
        raise DataError(message, where="coupling.segments", remedy=remedy)
    total: ComplexArray | float = 0.0
    for shot in group:
        signals = np.hstack([shot.inputs[:, moved], shot.outputs]).T
        frequency_hz, density = csd(
            signals[:, None], signals[None], fs=1 / shot.sampling_period_s, nperseg=length, noverlap=length // 2
        )
        total = total + density
    return np.asarray(frequency_hz), np.moveaxis(np.asarray(total), 2, 0)


def _partial(spectra: ComplexArray, place: int, n_moved: int) -> tuple[FloatArray, ComplexArray, FloatArray]:
    """Spectra of one command (n_freq,), of outputs with it (n_freq, n_out) and of outputs, without other commands'."""
    rest = [other for other in range(n_moved) if other != place]
    kept = [place, *range(n_moved, spectra.shape[1])]
    left = spectra[:, kept][:, :, kept]
    if rest:
        # Conditioned spectra: S_kk - S_kr S_rr^-1 S_rk leave what the other commands do not explain.
        mixed = spectra[:, rest][:, :, kept]
        others = spectra[:, rest][:, :, rest]
        left = left - mixed.conj().swapaxes(1, 2) @ (np.linalg.pinv(others, rcond=1e-10, hermitian=True) @ mixed)
    power = np.maximum(np.einsum("fii->fi", left).real, 0.0)
    return power[:, 0], left[:, 0, 1:], power[:, 1:]


def _first_coupled(
    frequency_hz: FloatArray, gain: FloatArray, radius: FloatArray, threshold: float, coupled: BoolArray
) -> FloatArray:
    """Lowest frequency (n_out, n_in) at which a response is above a threshold beyond doubt.

    What the coherence shows to be coupled is so from where the response itself is above it.
    """
    known = np.asarray(np.isfinite(gain - radius).any(axis=0))
    sure = _crossing(frequency_hz, gain - radius > threshold, known)
    likely = _crossing(frequency_hz, gain > threshold, known)
    return np.where(coupled.any(axis=0) & np.isinf(sure), likely, sure)


def _crossing(frequency_hz: FloatArray, above: BoolArray, examined: BoolArray) -> FloatArray:
    """Lowest frequency (n_out, n_in) at which it is above, there and at the next one."""
    if not len(above):
        return np.full(examined.shape, np.nan)
    twice = above & np.concatenate([above[1:], above[-1:]])
    first = frequency_hz[np.argmax(twice, axis=0)]
    return np.where(examined, np.where(twice.any(axis=0), first, np.inf), np.nan)


def _decoupled(crossing: FloatArray, own: BoolArray, examined_hz: float) -> FloatArray:
    """Frequency (n_in,) up to which a command moves no other output, and its outputs follow no other command."""
    known = np.where(np.isnan(crossing), np.inf, crossing)
    moves = known.min(axis=0, initial=np.inf)
    follows = known.min(axis=1, initial=np.inf)
    own_follow = np.where(own, follows[:, None], np.inf).min(axis=0, initial=np.inf)
    return np.asarray(np.minimum(np.minimum(moves, own_follow), examined_hz))


def _sentence(coupled: BoolArray, crossing: FloatArray, pairs: Pairs, overall_hz: float, examined_hz: float) -> str:
    places = np.argwhere(coupled.any(axis=0) | np.isfinite(crossing))
    if not len(places) and examined_hz <= 0:
        return "The commands excite too few lines to tell whether channels are coupled."
    if not len(places):
        return f"No coupling of other channels was seen up to {examined_hz:.3g} Hz."
    listed = ", ".join(f"{pairs.outputs[out]} to {pairs.inputs[told]}" for out, told in places)
    return (
        f"Channels are decoupled up to {overall_hz:.3g} Hz; beyond, these outputs follow another's command: {listed}. "
        "Fit all of them with common poles (`matrix: full`) where that band matters."
    )
