"""Signals that lie at a limit: how long, and by how much the response may be off then."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.signals.quantities import Channel
from robid.signals.record import Record

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
    near = np.count_nonzero(below > following - _NEAR * (following - float(below.min())))
    return float(at_top.mean()) if np.count_nonzero(at_top) > _FAR_MORE * near else 0.0
