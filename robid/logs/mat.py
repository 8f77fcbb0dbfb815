"""Imports MAT logs (version 5) into records and refuses what cannot be trusted."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.io.matlab import MatReadError

from robid.arrays import FloatArray, IntArray, check_shape
from robid.errors import DataError
from robid.logs.checks import check_count, check_lengths, check_mapping, check_period, check_time, read_column
from robid.logs.mapping import INPUT_UNITS, OUTPUT_UNITS, LogMapping
from robid.signals.record import Record


def import_mat(
    mapping: LogMapping,
    *,
    samples_per_period: int,
    periods: int,
    excited_lines: IntArray,
    configurations: FloatArray,
    detection_lines: IntArray | None = None,
) -> Record:
    """Imports one realization of one experiment in one configuration.

    Angles stay as they were measured, less the first sample that is used; drift is left to the estimate.

    Args:
        mapping: File, channels, units, sampling period and dropped periods.
        samples_per_period: Samples of one period.
        periods: Periods to import after the dropped ones.
        excited_lines (n_freq,): Lines that were excited.
        configurations (1, n_joint): Arm-side joint angles [rad].
        detection_lines (n_detection,): Lines of the band that were left out on purpose, or None.

    Raises:
        SettingsError: If the mapping contradicts itself or names an unknown unit.
        DataError: If the log is missing, unreadable or not what was said; every problem at once.
    """
    check_shape("configurations", configurations, "n_conf n_joint", n_conf=1)
    check_mapping(mapping, samples_per_period, excited_lines)
    columns, problems = _read(mapping, load_variables(mapping.file))
    channels = {name: columns[name] for name in _channel_variables(mapping) if name in columns}
    problems += check_lengths(mapping, columns)
    notes: list[str] = []
    if mapping.time is not None and mapping.time.variable in columns:
        stamps = columns[mapping.time.variable]
        if np.all(np.isfinite(stamps)):
            problems += check_time(mapping, mapping.time.variable, stamps, mapping.time.to_seconds)
    if channels:
        shortest = min(map(len, channels.values()))
        problems += check_count(mapping, shortest, samples_per_period, periods)
    excitation = channels.get(mapping.inputs[0].variable)
    if excitation is not None:
        steady = excitation[mapping.drop_periods * samples_per_period :].astype(float)
        if len(steady) > 2 and np.all(np.isfinite(steady)) and np.ptp(steady) > 0:
            found, notes = check_period(mapping, steady, samples_per_period, periods, excited_lines)
            problems += found
    _raise(mapping.file, problems)
    used = slice(mapping.drop_periods * samples_per_period, (mapping.drop_periods + periods) * samples_per_period)
    shape = (1, 1, 1, periods, samples_per_period, 1)
    scales = [_torque_scale(mapping)] + [channel.sign * OUTPUT_UNITS[channel.unit] for channel in mapping.outputs]
    names = _channel_variables(mapping)
    signals = [
        scale * channels[name][used].astype(float).reshape(shape) for name, scale in zip(names, scales, strict=True)
    ]
    angle = np.concatenate(signals[1:], axis=-1)
    offset = angle[:, 0, 0, 0, 0]
    normalised = mapping.inputs[0].normalised
    return Record(
        sampling_period_s=mapping.sampling_period_s,
        configurations=configurations,
        torque=signals[0],
        position=angle - offset,
        reference=None,
        reference_kind="",
        excited_lines=np.asarray(excited_lines),
        detection_lines=np.zeros(0, int) if detection_lines is None else np.asarray(detection_lines),
        input_names=tuple(channel.name for channel in mapping.inputs),
        output_names=tuple(channel.name for channel in mapping.outputs),
        position_offset_rad=offset,
        torque_unit="A" if normalised else "N m",
        torque_hold=mapping.inputs[0].hold,
        torque_relative_std=np.array([channel.torque_constant_relative_std for channel in mapping.inputs]),
        notes=(*_notes(mapping, len(channels[names[0]]) - used.stop, periods), *notes),
    )


def load_variables(file: Path) -> Mapping[str, Any]:
    """Reads all variables of a MAT file of version 5 or older; objects of MATLAB classes are passed over.

    Raises:
        DataError: If the file is missing, of another format, or damaged.
    """
    if not file.is_file():
        remedy = "Correct `file`, or set ROBID_DATA to the folder that holds the data."
        raise DataError("The log does not exist.", where=str(file), remedy=remedy)
    try:
        loaded = loadmat(file, appendmat=False)
    except NotImplementedError:
        remedy = "Save it from MATLAB with `save -v7`."
        raise DataError("The log is a MAT file of version 7.3.", where=str(file), remedy=remedy) from None
    except (
        MatReadError,
        OSError,
        ValueError,
        TypeError,
        KeyError,
        IndexError,
        EOFError,
        struct.error,
        zlib.error,
    ) as e:
        remedy = "Check that it is a MAT file and that it was copied completely."
        raise DataError(f"The log cannot be read as a MAT file ({e}).", where=str(file), remedy=remedy) from e
    return {name: value for name, value in loaded.items() if isinstance(name, str) and not name.startswith("__")}


def _channel_variables(mapping: LogMapping) -> list[str]:
    return [channel.variable for channel in mapping.inputs] + [channel.variable for channel in mapping.outputs]


def _read(mapping: LogMapping, variables: Mapping[str, Any]) -> tuple[dict[str, NDArray[Any]], list[DataError]]:
    """Reads every column that the mapping names, with every problem on the way."""
    names = _channel_variables(mapping) + ([mapping.time.variable] if mapping.time is not None else [])
    columns: dict[str, NDArray[Any]] = {}
    problems: list[DataError] = []
    for name in dict.fromkeys(names):
        column, found = read_column(mapping, variables, name)
        problems += found
        if column is not None:
            columns[name] = column
    return columns, problems


def _torque_scale(mapping: LogMapping) -> float:
    channel = mapping.inputs[0]
    return channel.sign * INPUT_UNITS[channel.unit] * channel.torque_constant_nm_a


def _notes(mapping: LogMapping, left_over: int, periods: int) -> list[str]:
    """What the reader of the record has to know about the import."""
    channel = mapping.inputs[0]
    notes = [f"Imported from {mapping.file.name}, periods dropped: {mapping.drop_periods}, used: {periods}."]
    if left_over:
        notes.append(f"{left_over} samples at the end of the log are not used.")
    if channel.normalised:
        notes.append(
            f"The torque constant K_t of {channel.name} is unknown: the torque is a current in A, and only ratios to"
            " K_t are identified (stiffness/K_t, damping/K_t, inertia/K_t)."
        )
    elif channel.torque_constant_relative_std:
        notes.append(
            f"The torque constant of {channel.name} is known to {100 * channel.torque_constant_relative_std:.3g} %"
            " (1 sigma): this error is common to all stiffnesses, dampings and inertias."
        )
    return notes


def _raise(file: Path, problems: list[DataError]) -> None:
    """Raises one problem as it is, several as one error; does nothing when there are none."""
    if len(problems) == 1:
        raise problems[0]
    if problems:
        raise DataError("\n".join([f"{len(problems)} problems", *map(str, problems)]), where=str(file))
