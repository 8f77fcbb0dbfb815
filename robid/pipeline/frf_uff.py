"""Responses as a Universal File: datasets 58, one for each element and its deviation."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyuff

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.frf.quality import dropped_lines
from robid.pipeline.frf_formats import Response
from robid.signals.quantities import Channel

_FREQUENCY_RESPONSE, _GENERAL = 4, 0
_FREQUENCY = 18
_LINE, _LABEL, _ENTITY = 80, 20, 10
_FEWEST = 2
# Specific data type and exponents of length and force, which a scalar direction leaves to the file.
_QUANTITIES: dict[str, tuple[int, int, int]] = {
    "rad": (8, 0, 0),
    "m": (8, 1, 0),
    "rad/s": (11, 0, 0),
    "m/s": (11, 1, 0),
    "rad/s^2": (12, 0, 0),
    "m/s^2": (12, 1, 0),
    "N m": (13, 1, 1),
    "N": (13, 0, 1),
}
_UNKNOWN = (0, 0, 0)


def response_uff(response: Response) -> bytes:
    """Writes every element of every configuration, with a deviation of its own where that is known.

    Frequencies have the format's six digits, values twelve; lines that were dropped are left out.

    Raises:
        DataError: If an element has fewer than two lines, which the format cannot hold.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frf.uff"
        pyuff.UFF(str(path)).write_sets([_units(), *_datasets(response)], "overwrite")
        return path.read_bytes()


def _units() -> dict[str, Any]:
    return {
        "type": 164,
        "units_code": 1,
        "units_description": "SI",
        "temp_mode": 1,
        "length": 1.0,
        "force": 1.0,
        "temp": 1.0,
        "temp_offset": 273.15,
    }


def _datasets(response: Response) -> Iterator[dict[str, Any]]:
    frf = response.frf
    dropped = dropped_lines(frf)
    known = frf.total_covariance is not None or frf.noise_covariance is not None
    deviation = np.sqrt(frf.element_variance()) if known else None
    for place, row, column in np.ndindex(len(response.numbers), *frf.response.shape[2:]):
        here = (place, slice(None), row, column)
        kept = ~dropped[place, :, column]
        if kept.sum() < _FEWEST:
            what = f"a dataset 58 needs {_FEWEST} lines; {response.position(place)} has {kept.sum()}"
            raise DataError(what, where=response.campaign, remedy="export `csv`, `mat` or `json`")
        shared = _shared(response, place, row, column) | {"x": frf.frequency_hz[kept]}
        yield shared | {"func_type": _FREQUENCY_RESPONSE, "data": frf.response[here][kept]}
        if deviation is not None:
            title = _cut(f"Standard deviation of {shared['id1']}", _LINE)
            yield shared | {"func_type": _GENERAL, "id1": title, "data": _real(deviation[here][kept])}


def _real(values: FloatArray) -> FloatArray:
    return np.ascontiguousarray(values, dtype=float)


def _shared(response: Response, place: int, row: int, column: int) -> dict[str, Any]:
    frf = response.frf
    output, given = frf.output_channels[row], frf.input_channels[column]
    numerator, denominator = _QUANTITIES.get(output.unit, _UNKNOWN), _QUANTITIES.get(given.unit, _UNKNOWN)
    return {
        "type": 58,
        "binary": 0,
        "id1": _cut(f"{output.name} {output.title} per {given.name} {given.title}", _LINE),
        "id2": _cut(response.origin, _LINE),
        "id3": "NONE",
        "id4": _cut(response.position(place), _LINE),
        "id5": _cut(f"unit {response.units[row][column]}", _LINE),
        "ver_num": response.numbers[place] + 1,
        "load_case_id": 0,
        "rsp_ent_name": _cut(output.name, _ENTITY),
        "rsp_node": row + 1,
        "rsp_dir": 0,
        "ref_ent_name": _cut(given.name, _ENTITY),
        "ref_node": column + 1,
        "ref_dir": 0,
        "abscissa_spacing": 0,
        "abscissa_spec_data_type": _FREQUENCY,
        "abscissa_axis_lab": "Frequency",
        "abscissa_axis_units_lab": "Hz",
        "ordinate_spec_data_type": numerator[0],
        "ordinate_len_unit_exp": numerator[1],
        "ordinate_force_unit_exp": numerator[2],
        "ordinate_axis_lab": _label(output),
        "ordinate_axis_units_lab": _cut(output.unit, _LABEL),
        "orddenom_spec_data_type": denominator[0],
        "orddenom_len_unit_exp": denominator[1],
        "orddenom_force_unit_exp": denominator[2],
        "orddenom_axis_lab": _label(given),
        "orddenom_axis_units_lab": _cut(given.unit, _LABEL),
        "z_axis_spec_data_type": 0,
    }


def _label(channel: Channel) -> str:
    return _cut(channel.title, _LABEL)


def _cut(text: str, length: int) -> str:
    """Fits a text into its columns; the format knows ASCII alone."""
    return text.encode("ascii", "replace").decode()[:length]
