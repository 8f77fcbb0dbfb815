"""Whether a file nobody has described holds frequency responses, and an experiment file that reads it."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robid.errors import DataError
from robid.logs.formats.load import load_responses
from robid.logs.formats.variables import Variables, tell_response_format
from robid.logs.responses.columns import find_layout
from robid.logs.responses.datasets import channels_of_sets
from robid.logs.responses.structures import (
    find_object,
    is_own,
    object_lines,
    object_names,
    object_period,
    texts_of,
)
from robid.logs.responses.table import contradictions_refused
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.response_options import FREQUENCY_UNITS, ResponseOptions

_NAME = re.compile(r"[^A-Za-z0-9_-]+")
_OWN_COLUMN = re.compile(r"(\S+) per (\S+) real \[([^\]]*)\]")


@dataclass(frozen=True)
class Recognised:
    """Frequency responses in a file."""

    file: Path  # The file
    format: str  # Its format
    inputs: tuple[str, ...]  # Names of inputs in the file
    outputs: tuple[str, ...]  # Names of outputs
    lines: int  # Lines
    lowest_hz: float  # The lowest one [Hz]
    highest_hz: float  # The highest one [Hz]
    configurations: int = 1  # Responses of how many configurations are in it
    coherence: bool = False  # Whether it has coherences
    deviation: bool = False  # Whether it has deviations
    sampling_period_s: float | None = None  # What it states [s]
    db: bool = False  # Whether magnitudes are in dB
    rad: bool = False  # Whether phases are in radians
    units: tuple[str, str] | None = None  # Units of outputs and inputs that it states


def recognise(path: Path) -> Recognised | None:
    """Recognises frequency responses; None of any other file.

    Raises:
        DataError: If the file is damaged, or its reader is not installed.
    """
    form = tell_response_format(path)
    if form not in ("csv", "mat", "json", "uff"):
        return None
    variables = load_responses(path, form)
    with contradictions_refused(str(path)):
        return _recognised(variables, form)


def _recognised(variables: Variables, form: str) -> Recognised | None:
    if form == "uff":
        return _universal(variables)
    if is_own(variables):
        return _own(variables, form)
    structure = find_object(variables)
    if structure is not None:
        return _structure(variables, structure)
    return _columns(variables) if form == "csv" else None


def _universal(variables: Variables) -> Recognised | None:
    found = channels_of_sets(variables)
    if found is None:
        return None
    outputs, inputs, versions, kinds, frequency = found
    band = (float(frequency.min()), float(frequency.max()))
    return Recognised(variables.file, "uff", inputs, outputs, frequency.size, *band, versions, 6 in kinds, 0 in kinds)


def _own(variables: Variables, form: str) -> Recognised:
    frequency = np.ravel(variables["frequency_hz"])
    inputs, outputs = (tuple(texts_of(variables, f"{side}_names")) for side in ("input", "output"))
    told = Recognised(variables.file, form, inputs, outputs, frequency.size, float(frequency[0]), float(frequency[-1]))
    return replace(
        told,
        configurations=np.ravel(variables["configuration_numbers"]).size,
        coherence="coherence" in variables,
        deviation="variance" in variables,
        sampling_period_s=float(np.ravel(variables["sampling_period_s"])[0]),
        units=_own_units(variables),
    )


def _own_units(variables: Variables) -> tuple[str, str] | None:
    channels = [texts_of(variables, f"{side}_channels") for side in ("output", "input")]
    found = [re.search(r"\[([^\]]*)\]", side[0]) for side in channels if side]
    return (found[0][1], found[1][1]) if len(found) == 2 and found[0] and found[1] else None


def _structure(variables: Variables, name: str) -> Recognised:
    outputs, inputs = object_names(variables, name)
    frequency, period = object_lines(variables, name), object_period(variables, name)
    band = float(frequency.min()), float(frequency.max())
    told = Recognised(variables.file, "mat", tuple(inputs), tuple(outputs), frequency.size, *band)
    covariance = np.size(variables.get(f"{name}.CovarianceData", ())) > 0
    return replace(told, deviation=covariance, sampling_period_s=period if period > 0 else None)


def _columns(variables: Variables) -> Recognised | None:
    own = [found for name in variables.sizes if (found := _OWN_COLUMN.fullmatch(name))]
    outputs, inputs = (tuple(dict.fromkeys(found[side] for found in own)) for side in (1, 2))
    asked = _asked(outputs or ("output",), inputs or ("input",))
    try:
        layout = find_layout(variables, asked)
    except DataError:
        return None
    if not layout.elements or layout.frequency not in variables:
        return None
    frequency = FREQUENCY_UNITS[layout.frequency_unit] * np.ravel(variables[layout.frequency]).astype(float)
    # A log may have columns of such names; frequencies rise from line to line, and are above 0.
    if frequency.size < 2 or not (np.diff(frequency) > 0).all() or frequency[0] <= 0:
        return None
    first = layout.elements[0]
    told = Recognised(
        variables.file,
        "csv",
        inputs or ("input",),
        outputs or ("output",),
        frequency.size,
        *frequency[[0, -1]].tolist(),
    )
    return replace(
        told,
        coherence=first.coherence is not None,
        deviation=first.deviation is not None,
        db=layout.db,
        rad=not layout.deg,
        units=_column_units(own[0][3]) if own else None,
    )


def _column_units(text: str) -> tuple[str, str] | None:
    """Units of output and input in that of their response, as `rad/(s^2 N m)`."""
    found = re.fullmatch(r"(\S+?)/\(s\^2 (.+)\)", text)
    return (f"{found[1]}/s^2", found[2]) if found else None


def _asked(outputs: Sequence[str], inputs: Sequence[str]) -> ResponseOptions:
    return ResponseOptions(
        inputs=tuple(InputChannel(name=_channel(name), variable=name) for name in inputs),
        outputs=tuple(OutputChannel(name=_channel(name), variable=name) for name in outputs),
    )


def _channel(name: str) -> str:
    """A name in the file as that of a channel."""
    head, _, tail = name.partition(".")
    plain = _NAME.sub("_", head).strip("_-")[:64] or "channel"
    return f"{plain}.{_NAME.sub('_', tail)}" if tail else plain


def proposal(found: Recognised, file: str) -> str:
    """Writes an experiment file that reads the responses; what must be looked at stands behind `# check:`."""
    units = found.units or ("rad/s^2", "N m")
    check = "" if found.units else " # check: its unit, and `sign` if it counts the other way"
    lines = [
        "schema_version: 2",
        f"name: {_channel(found.file.stem).replace('.', '_').lower()}",
        "# robot: robots/mine.yaml # check: the robot, for models that need one; inputs are then its joints, in order",
        "campaigns:",
        "  measured:",
        "    # configurations: {list_deg: [[0, 0]]} # check: joint angles of each response, with a robot",
        "    source:",
        "      response:",
        f"        file: {file}",
        f"        format: {found.format}",
        "        inputs:",
        *(
            f"          - {{name: {_channel(name)}, variable: '{name}', unit: {units[1]}}}{check}"
            for name in found.inputs
        ),
        "        outputs:",
        *(
            f"          - {{name: {_channel(name)}, variable: '{name}', unit: {units[0]}}}{check}"
            for name in found.outputs
        ),
    ]
    if found.db:
        lines.append("        magnitude: db")
    if found.rad:
        lines.append("        phase: rad")
    if found.sampling_period_s:
        lines.append(f"        sampling_period_s: {found.sampling_period_s:g}")
    else:
        lines.append("        # sampling_period_s: 0.001 # check: only of a response between samples of a controller")
    if found.coherence and not found.deviation:
        lines.append("        # averages: 16 # check: effective number of averages behind the coherence")
    return "\n".join([*lines, "# fits: {transfer: {family: external, from: measured}}", ""])
