"""Samples of a log in the channels' units, and poses seen from home."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from robid.arrays import FloatArray
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import LogChannel
from robid.signals.pose import POSE, displacement, rotation_from_zyx
from robid.signals.record import Record


def channel_values(channels: Sequence[LogChannel], columns: Mapping[str, NDArray[Any]], used: slice) -> FloatArray:
    """Returns samples (n_sample, n_channel) in the channels' units."""
    return np.stack([channel.factor * columns[channel.column][used].astype(float) for channel in channels], axis=-1)


def _seen_from_home(
    mapping: LogMapping, key: Literal["inputs", "outputs"], values: FloatArray
) -> tuple[FloatArray, tuple[str, ...]]:
    """Signals whose pose is a displacement from home where it was absolute, and what to say about it."""
    if mapping.pose is None or key not in mapping.pose.absolute:
        return values, ()
    names = [channel.name for channel in getattr(mapping, key)]
    at = [names.index(name) for name in POSE]
    home = values[0, at] if mapping.pose.stated is None else mapping.pose.stated
    turned = values.copy()
    rotations = rotation_from_zyx(values[:, at[3:]])
    turned[:, at] = displacement(home[:3], rotation_from_zyx(home[3:]), values[:, at[:3]], rotations)
    shown = ", ".join(f"{value:.4g}" for value in (*home[:3], *np.rad2deg(home[3:])))
    return turned, (
        f"The {key} are displacements in the tool frame of the home pose {shown} (X Y Z in m, A B C in deg).",
    )


def sample_channels(mapping: LogMapping, columns: Mapping[str, NDArray[Any]], used: slice, periods: int) -> Record:
    """Returns the record of some samples of a log, without what was played."""
    inputs, told = _seen_from_home(mapping, "inputs", channel_values(mapping.inputs, columns, used))
    outputs, further = _seen_from_home(mapping, "outputs", channel_values(mapping.outputs, columns, used))
    return Record(
        sampling_period_s=mapping.sampling_period_s,
        inputs=inputs.reshape(1, 1, 1, periods, -1, inputs.shape[-1]),
        outputs=(outputs - outputs[0]).reshape(1, 1, 1, periods, -1, outputs.shape[-1]),
        output_offset=outputs[:1] - [channel.factor * channel.zero for channel in mapping.outputs],
        input_channels=tuple(channel.channel for channel in mapping.inputs),
        output_channels=tuple(channel.channel for channel in mapping.outputs),
        input_hold=mapping.inputs[0].hold,
        input_relative_std=np.array([channel.torque_constant_relative_std for channel in mapping.inputs]),
        notes=(*told, *further),
    )
