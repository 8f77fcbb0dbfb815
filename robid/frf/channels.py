"""What the channels of a response are, what its readers ask of them, and how long each lies at a limit."""

from __future__ import annotations

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
    """Returns means of inputs and outputs, how far the outputs move about theirs, and how long each is at a limit.

    Args:
        record: Record of a single configuration; the configuration axis is kept.
    """
    n_sample, offset = record.outputs[0, ..., 0].size, record.output_offset
    mean = record.outputs.mean(axis=(1, 2, 3, 4))
    # Without a copy of the samples, of which there may be many.
    square = np.einsum("crepno,crepno->co", record.outputs, record.outputs) / n_sample
    inputs, outputs = saturated_shares(record)
    return {
        "mean_input": record.inputs.mean(axis=(1, 2, 3, 4)),
        "mean_output": mean + offset,
        "motion_rms": np.sqrt(np.maximum(square - mean**2, 0.0)),
        "saturated_inputs": inputs[None],
        "saturated_outputs": outputs[None],
    }


SATURATED_SHARE = 0.005  # Share of samples at a channel's extreme value above which it is told
_BINARY = 0.99  # Share of samples at either limit from which a signal has two values by design, as binary noise
# Share of samples at one extreme value from which a signal rests there: most of what lies at a limit is lost.
_RESTING = 0.5
_PLACES = ("angle", "position")
_FAR_MORE = 3
_NEAR = 0.01


def saturated_channels(record: Record) -> list[tuple[Channel, FloatArray]]:
    """Returns the channels that saturate, inputs first, and the share of samples (n_real, n_exp) in which they do.

    Of outputs, angles and positions do not count: a motor that sticks rests at its turning points. Nor do signals that
    have two values by design, and values at which a signal rests, as a force between blows.
    """
    found = [*_inputs(record), *_outputs(record)]
    return [(channel, share) for channel, share in found if share.max() > SATURATED_SHARE]


def saturated_shares(record: Record) -> tuple[FloatArray, FloatArray]:
    """Share of the time in which each input (n_in,) and output (n_out,) saturates at worst, 0 where it is not told."""
    inputs, outputs = (
        np.array([share.max() if share.max() > SATURATED_SHARE else 0.0 for _, share in found])
        for found in (_inputs(record), _outputs(record))
    )
    return inputs, outputs


def saturation_error(share: float) -> float:
    """Relative error of a response whose input, or output, was clipped for a share of the time.

    Of a Gaussian signal clipping passes the share that it leaves as it was; the rest distorts.

    Source:
        Bussgang, Crosscorrelation functions of amplitude-distorted Gaussian signals (1952).
    """
    return share / max(1 - share, 1e-3)


def _inputs(record: Record) -> list[tuple[Channel, FloatArray]]:
    return [(one, _share(record.inputs[0, ..., at])) for at, one in enumerate(record.input_channels)]


def _outputs(record: Record) -> list[tuple[Channel, FloatArray]]:
    return [
        (one, np.zeros((1, 1)) if one.quantity in _PLACES else _share(record.outputs[0, ..., at]))
        for at, one in enumerate(record.output_channels)
    ]


def _share(signal: FloatArray) -> FloatArray:
    """Share of samples (n_real, n_exp) at a limit, of those (n_real, n_exp, n_period, n_sample)."""
    share = np.zeros(signal.shape[:2])
    for place in np.ndindex(share.shape):
        # Both ends count, unless nearly all samples lie at them: such a signal has two values by design.
        limits = [_at_limit(sign * signal[place]) for sign in (1, -1)]
        if sum(limits) <= _BINARY:
            share[place] = sum(limit for limit in limits if limit <= _RESTING)
    return share


def _at_limit(signal: FloatArray) -> float:
    """Share of samples at the highest value."""
    at_top = signal >= signal.max() - 1e-6 * np.ptp(signal)
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
