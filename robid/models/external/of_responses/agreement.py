"""Measured responses beside their models, and how far apart they are."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.frf.frf import Frf
from robid.models.external.of_responses.blocks import Block
from robid.models.external.of_responses.solution import RationalQuality, ResponsePorts, Shown
from robid.models.external.response.result import RationalFit
from robid.robot.sampling import hold_factor

_LOUD = 0.3  # Deviation over the response from which on a line says nothing of a relative error


def held(frequency_hz: FloatArray, ports: ResponsePorts) -> ComplexArray:
    """What a hold adds to the models (n_freq,); one where they have it, or there is none."""
    if ports.hold == "none":
        return np.ones(frequency_hz.size, complex)
    return hold_factor(2 * np.pi * frequency_hz, 0.0, ports.sampling_period_s)


def shown_of(frf: Frf, blocks: Sequence[Block], fits: Sequence[RationalFit], ports: ResponsePorts) -> Shown:
    """The measured response of every channel, and its model with delay and hold."""
    hold = held(frf.frequency_hz, ports)[:, None]
    found = [fit.response_at(frf.frequency_hz) for fit in fits]
    flat = [each.response.reshape(len(hold), -1) * hold for each in found]
    deviations = [np.hypot(each.real_std, each.imaginary_std).reshape(len(hold), -1) * np.abs(hold) for each in found]
    rows, columns = (np.array(side) for side in zip(*(at for block in blocks for at in block.channels()), strict=True))
    return Shown(
        frequency_hz=frf.frequency_hz,
        measured=frf.known_response[0][:, rows, columns],
        measured_std=np.sqrt(frf.element_variance()[0][:, rows, columns]),
        model=np.concatenate(flat, axis=1),
        model_std=np.concatenate(deviations, axis=1),
    )


def relative_errors(shown: Shown) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Relative errors (n_channel,), and what noise and parameters explain of them, over lines that noise leaves."""
    size = np.abs(shown.measured)
    with np.errstate(invalid="ignore", divide="ignore"):
        told = shown.known & (size > 0) & (shown.measured_std < _LOUD * size)
        told = np.where(told.any(axis=0), told, shown.known & (size > 0))
        parts = np.abs(shown.measured - shown.model), shown.measured_std, shown.model_std
        ratios = [np.where(told, part / size, np.nan) for part in parts]
    error, noise, parameters = (np.sqrt(np.nanmean(ratio**2, axis=0)) for ratio in ratios)
    return error, noise, parameters


def quality_of(fits: Sequence[RationalFit], shown: Shown) -> RationalQuality:
    """How well each block explains its response."""
    error, noise, _ = relative_errors(shown)
    return RationalQuality(
        cost=np.array([fit.cost for fit in fits]),
        degrees_of_freedom=np.array([fit.degrees_of_freedom for fit in fits]),
        misfit_chance=np.array([fit.misfit_chance for fit in fits]),
        widened=np.array([fit.widened for fit in fits]),
        relative_error=error,
        relative_noise=noise,
    )
