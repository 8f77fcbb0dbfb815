"""Faults in logs: in their signals, and in the bytes of their files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from robid.studies.fleet.robots import Fault

Log: TypeAlias = dict[str, dict[str, NDArray[np.int32]]]
"""Samples (n_sample,) of each channel, as `torque_<joint>`, of each experiment of a log."""

_NOISE = 2.0
_OVERWRITTEN = 512


def faulty_log(log: Log, fault: Fault, joints: Sequence[str]) -> Log:
    """Returns a log as a fault in its signals leaves it.

    Args:
        log: The log of the robot.
        fault: What is wrong; other kinds of faults leave the signals as they are.
        joints: Names of the joints.
    """
    channel = f"{fault.channel}_{joints[fault.joint]}"
    if fault.kind == "sign":
        return {name: {**one, channel: -one[channel]} for name, one in log.items()}
    if fault.kind == "dead":
        return _dead(log, fault, channel)
    if fault.kind == "gap":
        return _with_gap(log, fault)
    return log


def faulty_bytes(content: bytes, fault: Fault) -> bytes:
    """Returns a file as a fault leaves it: cut off, or a part of it overwritten; other kinds leave it as it is."""
    at = int(fault.at * len(content))
    if fault.kind != "file":
        return content
    if fault.variant == "truncated":
        return content[:at]
    part = content[at : at + _OVERWRITTEN]
    return content[:at] + bytes(255 - byte for byte in part) + content[at + len(part) :]


def _dead(log: Log, fault: Fault, channel: str) -> Log:
    """A channel stays at its first number, or shows a few counts of noise around it."""
    generator = np.random.default_rng(fault.seed)
    first = next(iter(log.values()))[channel][0]
    spread = _NOISE if fault.variant == "noise" else 0.0

    def dead(one: Mapping[str, NDArray[np.int32]]) -> NDArray[np.int32]:
        noise = spread * generator.normal(size=one[channel].shape)
        return np.asarray(first + np.rint(noise), dtype=np.int32)

    return {name: {**one, channel: dead(one)} for name, one in log.items()}


def _with_gap(log: Log, fault: Fault) -> Log:
    """All channels of one experiment lack the same samples."""
    name = list(log)[fault.seed % len(log)]
    length = len(next(iter(log[name].values())))
    at = int(fault.at * (length - fault.samples))
    lost = slice(at, at + fault.samples)
    return {**log, name: {channel: np.delete(values, lost) for channel, values in log[name].items()}}
