"""Responses of several campaigns as one, along the configuration axis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from robid.errors import DataError
from robid.frf.frf import CONFIGURATION_WISE, Frf
from robid.frf.friction import with_friction_moved

_SAME = ("input_channels", "output_channels", "input_hold", "sampling_period_s", "coefficient_names")


def join(frfs: Sequence[Frf], names: Sequence[str]) -> Frf:
    """Joins responses of the same robot and lines, such as those of two amplitudes.

    Compensated torque coefficients are the robot's own and shared: each response is moved to where the first one's
    were subtracted, exactly as a fit moves them.

    Args:
        frfs: The responses; configurations may be the same. What only some of them have is left out.
        names: What to call each in an error.

    Raises:
        DataError: If they differ in lines, channels or compensation.
    """
    first = frfs[0]
    for other, name in zip(frfs[1:], names[1:], strict=True):
        differing = [key for key in _SAME if getattr(other, key) != getattr(first, key)]
        if not np.array_equal(other.frequency_hz, first.frequency_hz):
            differing.insert(0, "excited lines")
        if differing:
            message = f"`{name}` cannot be joined to `{names[0]}`: {', '.join(differing).replace('_', ' ')} differ"
            remedy = (
                "give both campaigns the same lines (`period_s`, `low_hz`, `high_hz`, `count`, `seed`) and channels"
            )
            raise DataError(message, where=name, remedy=remedy)
    blocks = max((frf.input_amplitude.shape[-1] for frf in frfs if frf.input_amplitude is not None), default=0)
    aligned = [_aligned(frf, first, blocks) for frf in frfs]
    whole: dict[str, Any] = {}
    for key in CONFIGURATION_WISE:
        parts = [getattr(frf, key) for frf in aligned]
        alike = all(part is not None and part.shape[1:] == parts[0].shape[1:] for part in parts)
        whole[key] = np.concatenate(parts) if alike else None
    deviations = [frf.coefficient_relative_std for frf in frfs]
    return replace(
        first,
        **whole,
        coefficient_relative_std=np.max(deviations, axis=0),
        total_degrees_of_freedom=min(frf.total_degrees_of_freedom for frf in frfs),
        noise_degrees_of_freedom=min(frf.noise_degrees_of_freedom for frf in frfs),
        notes=tuple(dict.fromkeys(note for frf in frfs for note in frf.notes)),
    )


def _aligned(frf: Frf, first: Frf, blocks: int) -> Frf:
    """The response with the first one's torque coefficients subtracted, and as many experiments as all have."""
    if frf.input_amplitude is not None:
        missing = [(0, 0)] * 3 + [(0, blocks - frf.input_amplitude.shape[-1])]
        frf = replace(frf, input_amplitude=np.pad(frf.input_amplitude, missing, constant_values=np.nan))
    if frf.coefficient_offset is None or first.coefficient_offset is None or not frf.coefficient_names:
        return frf
    return with_friction_moved(frf, first.coefficient_offset - frf.coefficient_offset)
