"""Responses as tables, MAT, JSON and Universal File."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.quality import dropped_lines
from robid.models.encode import Content, encode_json, encode_mat, encode_table
from robid.signals.quantities import Channel, readable, readable_units, response_unit
from robid.versions import __version__

_DIGITS = 17


@dataclass(frozen=True)
class Response:
    """What is exported."""

    experiment: str  # name of the experiment
    campaign: str  # name of the campaign
    joints: tuple[str, ...]  # names of the robot's joints; empty where there is no robot file
    numbers: tuple[int, ...]  # indices of the configurations in the campaign
    frf: Frf  # their responses

    @property
    def origin(self) -> str:
        """Where it comes from, in a phrase."""
        return f"Frequency response of campaign {self.campaign}, experiment {self.experiment}, robid {__version__}"

    @property
    def units(self) -> list[list[str]]:
        """Unit of each element, by output and input."""
        frf = self.frf
        return [[response_unit(out.unit, inp.unit) for inp in frf.input_channels] for out in frf.output_channels]

    def position(self, place: int) -> str:
        """Names a configuration by its number and positions."""
        frf = self.frf
        values = readable(frf.configurations[place], frf.joint_units).tolist()
        units = readable_units(frf.joint_units, len(values))
        names = self.joints if len(self.joints) == len(values) else tuple(f"joint {i + 1}" for i in range(len(values)))
        told = ", ".join(f"{name} {value:.6g} {unit}" for name, value, unit in zip(names, values, units, strict=True))
        return f"Configuration {self.numbers[place] + 1}" + (f": {told}" if told else "")


def response_tables(response: Response) -> list[bytes]:
    """Writes one table for each configuration: real and imaginary part and standard deviation of every element."""
    return [_table(response, place) for place in range(len(response.numbers))]


def _table(response: Response, place: int) -> bytes:
    frf = response.frf
    deviation, known = _deviation(frf), frf.known_response
    columns, values = ["frequency [Hz]"], [frf.frequency_hz]
    for row, output in enumerate(frf.output_names):
        for column, name in enumerate(frf.input_names):
            unit, element = response.units[row][column], known[place, :, row, column]
            columns += [f"{output} per {name} {part} [{unit}]" for part in ("real", "imaginary")]
            values += [element.real, element.imag]
            if deviation is not None:
                columns.append(f"{output} per {name} deviation [{unit}]")
                values.append(deviation[place, :, row, column])
    if frf.coherence is not None:
        columns += [f"{output} multiple coherence" for output in frf.output_names]
        values += list(frf.coherence[place].T)
    notes = [
        response.origin,
        f"{response.position(place)}.",
        *(f"Output {_told(channel)}." for channel in frf.output_channels),
        *(f"{each.name} {_measured_as(frf, row)}" for row, each in enumerate(frf.measured_channels)),
        *(f"Input {_told(channel)}." for channel in frf.input_channels),
        *(["Lines that say too little of an input are NaN."] if frf.dropped is not None else []),
        f"Inputs: {frf.input_hold}, sampled every {frf.sampling_period_s:g} s.",
        _covariance_note(frf),
        *frf.notes,
    ]
    return encode_table([" ".join(note.split()) for note in notes], columns, np.column_stack(values), digits=_DIGITS)


def response_mat(response: Response) -> bytes:
    """Writes all configurations as a MAT file; its axes are those of `frf.h5`."""
    frf = response.frf
    text = np.array(response.units, object)
    kept = {name: value for name, value in _arrays(frf).items() if value is not None}
    return encode_mat({**_described(response), "units": text, "response": frf.known_response, **kept})


def response_json(response: Response) -> bytes:
    """Writes all configurations as JSON; a line that was dropped is null."""
    frf, known = response.frf, response.frf.known_response
    parts: dict[str, FloatArray | ComplexArray] = {"response_real": known.real, "response_imaginary": known.imag}
    for name, value in _arrays(frf).items():
        if value is None:
            continue
        parts |= (
            {f"{name}_real": value.real, f"{name}_imaginary": value.imag} if np.iscomplexobj(value) else {name: value}
        )
    return encode_json({**_described(response), "units": response.units, **parts})


def _described(response: Response) -> Content:
    frf = response.frf
    return {
        "robid_version": __version__,
        "origin": response.origin,
        "campaign": response.campaign,
        "configuration_names": tuple(response.position(place) for place in range(len(response.numbers))),
        "configuration_numbers": np.array(response.numbers) + 1,
        "configurations": frf.configurations,
        "joint_names": response.joints,
        "output_names": frf.output_names,
        "input_names": frf.input_names,
        "output_channels": tuple(_told(channel) for channel in frf.output_channels),
        "input_channels": tuple(_told(channel) for channel in frf.input_channels),
        "measured_channels": _measured(frf),
        "axes": "configuration, frequency, output, input",
        "frequency_hz": frf.frequency_hz,
        "sampling_period_s": frf.sampling_period_s,
        "input_hold": frf.input_hold,
        "covariance_note": _covariance_note(frf),
        "degrees_of_freedom": frf.degrees_of_freedom,
        "notes": frf.notes,
        "lines": frf.lines,
        "coefficient_names": frf.coefficient_names,
        **{f"measured_{name}": values for name, values in _measured_parts(frf).items()},
    }


def _measured_parts(frf: Frf) -> dict[str, tuple[str, ...]]:
    """The same word by word, for programs."""
    parts = {"names": "name", "quantities": "quantity", "units": "unit", "sides": "side", "samples": "sampled"}
    return {name: tuple(getattr(each, part) for each in frf.measured_channels) for name, part in parts.items()}


def _measured(frf: Frf) -> tuple[str, ...]:
    """What the outputs were measured as, and what their samples are."""
    return tuple(f"{_told(channel)}, samples: {channel.sampled.replace('_', ' ')}" for channel in frf.measured_channels)


def _arrays(frf: Frf) -> dict[str, FloatArray | ComplexArray | None]:
    """Variance of each element, the factors of the structured covariance, and levels; None where unknown."""
    known = frf.total_covariance is not None or frf.noise_covariance is not None
    return {
        "variance": frf.element_variance() if known else None,
        "output_covariance": frf.covariance if known else None,
        "input_factor": frf.input_factor if known else None,
        "element_scale": frf.element_scale if known else None,
        "line_scale": frf.line_scale,
        "noise_variance": None if frf.noise_covariance is None else frf.element_variance(noise_only=True),
        "coherence": frf.coherence,
        "dropped": dropped_lines(frf).astype(float),
        "odd_level": frf.response_level("odd"),
        "even_level": frf.response_level("even"),
        "line_correlation": frf.line_correlation,
        "input_amplitude": frf.input_amplitude,
        **(_compensated(frf) if frf.coefficient_names else {}),
    }


def _compensated(frf: Frf) -> dict[str, FloatArray | ComplexArray | None]:
    """What a fit corrects of compensated torques."""
    offset = np.zeros(len(frf.coefficient_names)) if frf.coefficient_offset is None else frf.coefficient_offset
    return {
        "sensitivity": frf.sensitivity,
        "coefficient_relative_std": frf.coefficient_relative_std,
        "coefficient_offset": offset,
    }


def _deviation(frf: Frf) -> FloatArray | None:
    if frf.total_covariance is None and frf.noise_covariance is None:
        return None
    return np.asarray(np.sqrt(frf.element_variance()))


def _covariance_note(frf: Frf) -> str:
    if frf.total_covariance is None and frf.noise_covariance is None:
        return "No variance is known: there is one period of one realization."
    holds = "noise only" if frf.total_covariance is None else "noise and the distortion that changes with the phases"
    return (
        f"Deviations and variances hold {holds}, with {frf.degrees_of_freedom:.4g} complex degrees of freedom. A"
        " variance is E|error|^2 of the complex element: real and imaginary part have half of it each."
    )


def _told(channel: Channel) -> str:
    return f"{channel.name}: {channel.side} {channel.title} [{channel.unit}]"


_FREQUENCY_RESPONSE, _GENERAL = 4, 0
_UFF_FREQUENCY = 18
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
_SI_UNITS: dict[str, Any] = {
    **{"type": 164, "units_code": 1, "units_description": "SI", "temp_mode": 1},
    **{"length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15},
}


def response_uff(response: Response) -> bytes:
    """Writes every element of every configuration, with a deviation of its own where that is known.

    Frequencies have the format's six digits, values twelve; lines that were dropped are left out.

    Raises:
        DataError: If an element has fewer than two lines, which the format cannot hold.
    """
    import pyuff

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frf.uff"
        pyuff.UFF(str(path)).write_sets([_SI_UNITS, *_datasets(response)], "overwrite")
        return path.read_bytes()


def _datasets(response: Response) -> Iterator[dict[str, Any]]:
    frf = response.frf
    dropped = dropped_lines(frf)
    deviation = _deviation(frf)
    for place, row, column in np.ndindex(len(response.numbers), *frf.response.shape[2:]):
        here = (place, slice(None), row, column)
        kept = ~dropped[place, :, column]
        if kept.sum() < _FEWEST:
            what = f"D196 a dataset 58 needs {_FEWEST} lines; {response.position(place)} has {kept.sum()}"
            raise DataError(what, where=response.campaign, remedy="export `csv`, `mat` or `json`")
        shared = _shared(response, place, row, column) | {"x": frf.frequency_hz[kept]}
        yield shared | {"func_type": _FREQUENCY_RESPONSE, "data": frf.response[here][kept]}
        if deviation is not None:
            title = _cut(f"Standard deviation of {shared['id1']}", _LINE)
            yield shared | {"func_type": _GENERAL, "id1": title, "data": np.ascontiguousarray(deviation[here][kept])}


def _shared(response: Response, place: int, row: int, column: int) -> dict[str, Any]:
    frf = response.frf
    output, given = frf.output_channels[row], frf.input_channels[column]
    return {
        "type": 58,
        "binary": 0,
        "id1": _cut(f"{output.name} {output.title} per {given.name} {given.title}", _LINE),
        "id2": _cut(response.origin, _LINE),
        "id3": _cut(_measured_as(frf, row), _LINE),
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
        "abscissa_spec_data_type": _UFF_FREQUENCY,
        "abscissa_axis_lab": "Frequency",
        "abscissa_axis_units_lab": "Hz",
        **_axis("ordinate", output),
        **_axis("orddenom", given),
        "z_axis_spec_data_type": 0,
    }


def _measured_as(frf: Frf, row: int) -> str:
    """What an output was measured as, which decides what sampling folds down onto its response."""
    if not frf.measured_channels:
        return "NONE"
    one = frf.measured_channels[row]
    return f"measured as {one.quantity}, {one.side}, {one.unit}, {one.sampled}, freedom {frf.degrees_of_freedom:.6g}"


def _axis(name: str, channel: Channel) -> dict[str, Any]:
    kind, length, force = _QUANTITIES.get(channel.unit, (0, 0, 0))
    return {
        **{f"{name}_spec_data_type": kind, f"{name}_len_unit_exp": length, f"{name}_force_unit_exp": force},
        **{f"{name}_axis_lab": _cut(channel.title, _LABEL), f"{name}_axis_units_lab": _cut(channel.unit, _LABEL)},
    }


def _cut(text: str, length: int) -> str:
    """Fits a text into its columns; the format knows ASCII alone."""
    return text.encode("ascii", "replace").decode()[:length]
