"""What the channels of a response are, what its readers ask of them, and how long each lies at a limit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.options import EstimateOptions
from robid.signals.quantities import DRIVES, Channel, UsableChannels, describe
from robid.signals.record import Record


def response_channels(record: Record, options: EstimateOptions) -> tuple[Channel, ...]:
    """Returns what the outputs of a record's response are."""
    kept = not to_accelerations(record, options)
    return tuple(channel if kept else channel.acceleration for channel in record.output_channels)


def to_accelerations(record: Record, options: EstimateOptions) -> bool:
    """Whether motions become accelerations before the response is estimated."""
    if options.outputs == "auto":
        return all(channel.quantity in DRIVES for channel in record.input_channels)
    return options.outputs == "acceleration"


def response_kept(options: EstimateOptions) -> bool | None:
    """Whether motions of responses that were measured elsewhere become accelerations; None where inputs decide."""
    return None if options.outputs == "auto" else options.outputs == "acceleration"


def require(frf: Frf, inputs: UsableChannels, outputs: UsableChannels, reader: str) -> None:
    """Refuses a response whose channels are not what its reader can use.

    Args:
        frf: The response.
        inputs: What its inputs must be.
        outputs: What its outputs must be.
        reader: Who reads it, as the subject of a sentence.

    Raises:
        DataError: If they are something else, saying what is wanted and what is there.
    """
    if inputs.accepts(frf.input_channels) and outputs.accepts(frf.output_channels):
        return
    what = (
        f"D014 {reader} needs responses from {inputs} to {outputs}; this one is from {describe(frf.input_channels)} to"
        f" {describe(frf.output_channels)}"
    )
    remedy = (
        "name another campaign in `from`; where the channels are described wrongly, correct their `unit`, `quantity`"
        " and `side` under `acquire`, or `estimate.outputs`, and estimate again"
    )
    raise DataError(what, remedy=remedy)


def channel_levels(record: Record) -> dict[str, Any]:
    """Returns means of inputs and outputs, and how far the outputs move about theirs.

    Args:
        record: Record of a single configuration; the configuration axis is kept.
    """
    inputs, outputs = (each.reshape(len(each), -1, each.shape[-1]) for each in (record.inputs, record.outputs))
    # As products with ones, and without a copy of the samples, of which there may be many.
    ones = np.ones(outputs.shape[1])
    mean = ones @ outputs / len(ones)
    square = np.einsum("cno,cno->co", outputs, outputs) / len(ones)
    return {
        "mean_input": ones @ inputs / len(ones),
        "mean_output": mean + record.output_offset,
        "motion_rms": np.sqrt(np.maximum(square - mean**2, 0.0)),
    }


SATURATED_SHARE = 0.005  # Share of samples at a channel's extreme value above which it is told
_BINARY = 0.99  # Share of samples at either limit from which a signal has two values by design, as binary noise
# Share of samples at one extreme value from which a signal rests there: most of what lies at a limit is lost.
_RESTING = 0.5
_TOUCHING = 1e-6  # Distance from an extreme value over the range up to which a sample lies at it
_PLACES = ("angle", "position")
_FAR_MORE = 3
_NEAR = 0.01


@dataclass(frozen=True)
class LimitShares:
    """How long the channels of one configuration lie at a limit.

    Of outputs, angles and positions do not count: a motor that sticks rests at its turning points. Nor do signals that
    have two values by design, and values at which a signal rests, as a force between blows.
    """

    channels: tuple[Channel, ...]  # Inputs first, then outputs
    share: FloatArray  # (n_channel, n_real, n_exp) Share of samples

    def saturated(self) -> list[tuple[Channel, FloatArray]]:
        """Returns the channels that saturate and the share of samples (n_real, n_exp) in which they do."""
        pairs = zip(self.channels, self.share, strict=True)
        return [(channel, share) for channel, share in pairs if share.max() > SATURATED_SHARE]

    def levels(self, n_in: int) -> dict[str, Any]:
        """Share of the time in which each input and output saturates at worst, 0 where it is not told."""
        worst = self.share.max(axis=(1, 2))
        told = np.where(worst > SATURATED_SHARE, worst, 0.0)[None]
        return {"saturated_inputs": told[:, :n_in], "saturated_outputs": told[:, n_in:]}


def limit_shares(record: Record) -> LimitShares:
    """Looks how long the channels of one configuration's record lie at a limit."""
    inputs = np.ones(len(record.input_channels), bool)
    outputs = np.array([one.quantity not in _PLACES for one in record.output_channels], bool)
    looked = [(record.inputs[0], inputs), (record.outputs[0], outputs)]
    share = [_shares(samples, chosen) for samples, chosen in looked]
    return LimitShares((*record.input_channels, *record.output_channels), np.concatenate(share))


def saturation_error(share: float) -> float:
    """Relative error of a response whose input, or output, was clipped for a share of the time.

    Of a Gaussian signal clipping passes the share that it leaves as it was; the rest distorts.

    Source:
        Bussgang, Crosscorrelation functions of amplitude-distorted Gaussian signals (1952).
    """
    return share / max(1 - share, 1e-3)


def _shares(samples: FloatArray, chosen: BoolArray) -> FloatArray:
    """Share of samples (n_channel, n_real, n_exp) at a limit, of some channels; 0 for the others.

    Args:
        samples (n_real, n_exp, n_period, n_sample, n_channel): Signals.
        chosen (n_channel,): Channels that are looked at.
    """
    share = np.zeros((len(chosen), *samples.shape[:2]))
    if not chosen.any():
        return share
    every = chosen.all()
    signals = np.ascontiguousarray(np.moveaxis(samples if every else samples[..., chosen], -1, 0))
    signals = signals.reshape(*signals.shape[:3], -1)
    top, bottom = signals.max(axis=-1, keepdims=True), signals.min(axis=-1, keepdims=True)
    near = _TOUCHING * (top - bottom)
    at_limit = [np.count_nonzero(one, axis=-1) for one in (signals >= top - near, signals <= bottom + near)]
    # Most signals touch their extreme values once: what lies there longer is looked at closely.
    for place in np.argwhere(np.maximum(*at_limit) > SATURATED_SHARE / 2 * signals.shape[-1]):
        share[np.flatnonzero(chosen)[place[0]], *place[1:]] = _share(signals[tuple(place)])
    return share


def _share(signal: FloatArray) -> float:
    """Share of samples (n_sample,) at a limit; both ends count.

    Where nearly all samples lie at them, the signal has two values by design.
    """
    limits = [_at_limit(sign * signal) for sign in (1, -1)]
    return sum(limit for limit in limits if limit <= _RESTING) if sum(limits) <= _BINARY else 0.0


def _at_limit(signal: FloatArray) -> float:
    """Share of samples at the highest value."""
    at_top = signal >= signal.max() - _TOUCHING * np.ptp(signal)
    return _at_top(signal, at_top) if at_top.mean() > SATURATED_SHARE / 2 else 0.0


def _at_top(signal: FloatArray, at_top: BoolArray) -> float:
    """Share of samples at the highest value, if there are far more of them than next to it."""
    below = signal[~at_top]
    if not below.size:
        return 0.0
    following = float(below.max())
    # A smooth peak has as many samples just below it as at it; a limit has far more at it.
    near = np.count_nonzero(below > following - _NEAR * (following - float(below.min())))
    return float(at_top.mean()) if np.count_nonzero(at_top) > _FAR_MORE * near else 0.0
