"""Responses in structures: exports of ours as MAT or JSON, `idfrd` and `frd` objects of MATLAB."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.logs.formats.variables import Variables
from robid.logs.responses.table import ResponseTable
from robid.signals.response_options import FREQUENCY_UNITS, ResponseOptions

_OBJECT = ".ResponseData"
_TURN = FREQUENCY_UNITS["rad/s"]
_FREQUENCIES = {"rad/s": _TURN, "hz": 1.0, "khz": 1e3, "mhz": 1e6, "ghz": 1e9, "rpm": 1 / 60}
_PER_TIME = {"rad/timeunit": _TURN, "cycles/timeunit": 1.0}
_SECONDS = {
    **{"nanoseconds": 1e-9, "microseconds": 1e-6, "milliseconds": 1e-3, "seconds": 1.0, "minutes": 60.0},
    **{"hours": 3600.0, "days": 86400.0, "weeks": 604800.0},
}
OWN_TEXTS = (
    "coefficient_names",
    *(f"measured_{name}" for name in ("names", "quantities", "sides", "units", "samples")),
)
"""Names that our exports have beside numbers."""


def find_object(variables: Variables) -> str | None:
    """Name of the `idfrd` or `frd` structure in a file; None where there is none."""
    return next((name.removesuffix(_OBJECT) for name in variables if name.endswith(_OBJECT)), None)


def is_own(variables: Variables) -> bool:
    """Whether a file is an export of ours."""
    return "frequency_hz" in variables and ("response" in variables or "response_real" in variables)


def own_tables(variables: Variables, options: ResponseOptions) -> list[ResponseTable]:
    """Responses of all configurations of an export of ours as MAT or JSON."""
    outputs, inputs = (texts_of(variables, f"{side}_names") for side in ("output", "input"))
    frequency = np.ravel(variables["frequency_hz"]).astype(float)
    count, pick = np.ravel(variables["configuration_numbers"]).size, _picked(variables, options, outputs, inputs)
    shape = (count, frequency.size, len(outputs), len(inputs))
    response = _array(variables, "response").reshape(shape)[:, :, pick[0][:, None], pick[1]]
    variance = _optional(variables, "variance", shape)
    averages = float(np.ravel(variables["degrees_of_freedom"])[0]) + 1
    period = float(np.ravel(variables["sampling_period_s"])[0])
    whole = pick[0].tolist() == list(range(len(outputs))) and pick[1].tolist() == list(range(len(inputs)))
    tables = []
    for place in range(count):
        given = None if variance is None else variance[place][:, pick[0][:, None], pick[1]].real
        table = ResponseTable(frequency, response[place], given, sampling_period_s=period, averages=averages)
        # A covariance of all elements is one of these channels alone only where they are all.
        parts = _own_parts(variables, place, shape) if whole else {}
        texts = {name: tuple(texts_of(variables, name)) for name in OWN_TEXTS}
        texts = texts if whole else {**texts, "coefficient_names": ()}
        tables.append(replace(table, parts=parts, texts=texts))
    return tables


def _own_parts(variables: Variables, place: int, shape: tuple[int, ...]) -> dict[str, FloatArray | ComplexArray]:
    n_conf, n_freq, n_out, n_in = shape
    sizes: dict[str, tuple[int, ...]] = {
        "input_factor": (n_conf, n_freq, n_in, n_in),
        "output_covariance": (n_conf, n_freq, n_out, n_out),
        "element_scale": (n_conf, n_out, n_in),
    }
    found = {name: _optional(variables, name, size) for name, size in sizes.items()}
    if any(each is None for each in found.values()):
        return {}
    kept = {name: each[place] for name, each in found.items() if each is not None}
    relative = variables.get("coefficient_relative_std")
    if relative is not None and np.size(relative):
        whole = (n_conf, np.size(relative), n_freq, n_out, n_in)
        sensitivity = _optional(variables, "sensitivity", whole)
        if sensitivity is not None:
            kept |= {"sensitivity": sensitivity[place], "coefficient_relative_std": np.ravel(relative).astype(float)}
            if "coefficient_offset" in variables:
                kept["coefficient_offset"] = np.ravel(variables["coefficient_offset"]).astype(float)
    if "line_correlation" in variables:
        kept["line_correlation"] = np.asarray(variables["line_correlation"], float).reshape(n_conf, n_freq, -1)[place]
    amplitude = _optional(variables, "input_amplitude", (n_conf, n_freq, n_in, -1))
    if amplitude is not None:
        kept["input_amplitude"] = amplitude[place]
    if "lines" in variables:
        kept["lines"] = np.ravel(variables["lines"]).astype(float)
    return kept


def object_table(variables: Variables, name: str, options: ResponseOptions) -> ResponseTable:
    """The response of an `idfrd` or `frd` object, saved by the fields that `struct(sys)` or `get(sys)` gives.

    Source:
        MathWorks, System Identification Toolbox, `idfrd`: ResponseData (ny, nu, nf), CovarianceData (ny, nu, nf, 2, 2).
    """
    frequency, period = object_lines(variables, name, options.frequency.unit), object_period(variables, name)
    n_freq = frequency.size
    shape = _object_shape(variables, name)
    data = np.asarray(variables[f"{name}{_OBJECT}"]).reshape(shape)
    names = object_names(variables, name)
    delay = _object_delays(variables, name, shape)
    if period < 0 and delay.any():
        what = "D662 the object has delays in samples, and no sampling period (`Ts` is -1)"
        remedy = "set `Ts` of the object, or take the delays out of it"
        raise DataError(what, where=str(variables.file), remedy=remedy)
    delay_s = delay * (period if period > 0 else _time_unit(variables, name))
    response = np.moveaxis(data, 2, 0) * np.exp(-2j * np.pi * frequency[:, None, None] * delay_s)
    pick = _picked(variables, options, names[0], names[1])
    chosen = np.ix_(np.arange(n_freq), pick[0], pick[1])
    covariance = variables.get(f"{name}.CovarianceData")
    variance = None
    if covariance is not None and np.size(covariance):
        # Real and imaginary part, and what they have in common: E|error|^2 is their sum.
        both = np.asarray(covariance, float).reshape(*shape, 2, 2)
        variance = np.moveaxis(both[..., 0, 0] + both[..., 1, 1], 2, 0)[chosen]
    told = (
        f"The object has a sampling period of {period:g} s and `sampling_period_s` is not given: no hold is taken out."
    )
    notes = (told,) if period > 0 and options.sampling_period_s is None else ()
    return ResponseTable(frequency, response[chosen], variance, sampling_period_s=max(period, 0.0), notes=notes)


def object_lines(variables: Variables, name: str, stated: str | None = None) -> FloatArray:
    """Lines of an `idfrd` or `frd` structure (n_freq,) [Hz]: by the unit that is stated, else by its own.

    Raises:
        DataError: If its unit is none of MATLAB's.
    """
    frequency = np.ravel(variables[f"{name}.Frequency"]).astype(float)
    if stated is not None:
        return np.asarray(frequency * FREQUENCY_UNITS[stated])
    # Objects of releases before R2011b have `Units`.
    said = variables.texts.get(f"{name}.FrequencyUnit") or variables.texts.get(f"{name}.Units") or "rad/TimeUnit"
    if said.lower() in _PER_TIME:
        return np.asarray(frequency * (_PER_TIME[said.lower()] / _time_unit(variables, name)))
    if said.lower() not in _FREQUENCIES:
        what = f"D663 the object's frequencies are in `{said}`, which is no unit of frequencies"
        remedy = "state it: `frequency: {unit: Hz}`"
        raise DataError(what, where=str(variables.file), remedy=remedy)
    return np.asarray(frequency * _FREQUENCIES[said.lower()])


def object_period(variables: Variables, name: str) -> float:
    """Sampling period of an `idfrd` or `frd` structure [s]; 0 in continuous time, below where it is not said."""
    return _time_unit(variables, name) * float(np.ravel(variables.get(f"{name}.Ts", 0.0))[0])


def _time_unit(variables: Variables, name: str) -> float:
    said = variables.texts.get(f"{name}.TimeUnit") or "seconds"
    if said.lower() not in _SECONDS:
        what = f"D664 the object's times are in `{said}`, which is no unit of times"
        raise DataError(what, where=str(variables.file), remedy="set its `TimeUnit` to `seconds` and export it again")
    return _SECONDS[said.lower()]


def object_names(variables: Variables, name: str) -> tuple[list[str], list[str]]:
    """Names of the outputs and inputs of an `idfrd` or `frd` structure; y1, u1 and so on where it has none."""
    shape = _object_shape(variables, name)
    sides = [
        texts_of(variables, f"{name}.{side}Name") or [""] * size for side, size in zip(_SIDES, shape, strict=False)
    ]
    outputs, inputs = (
        [each or f"{letter}{k}" for k, each in enumerate(side, start=1)]
        for letter, side in zip("yu", sides, strict=True)
    )
    return outputs, inputs


_SIDES = ("Output", "Input")


def _object_shape(variables: Variables, name: str) -> tuple[int, int, int]:
    """Outputs, inputs and lines of a response, whose axes of length one may have been dropped."""
    data, n_freq = variables[f"{name}{_OBJECT}"], np.size(variables[f"{name}.Frequency"])
    if data.ndim > 3:
        what = f"D665 the object is an array of {int(np.prod(data.shape[3:]))} models"
        raise DataError(what, where=str(variables.file), remedy="save each of them, as `struct(sys(:,:,1))`, in a file")
    if data.ndim == 3 and data.shape[2] == n_freq:
        return int(data.shape[0]), int(data.shape[1]), n_freq
    size = data.size // max(n_freq, 1)
    n_out, n_in = (len(texts_of(variables, f"{name}.{side}Name")) for side in _SIDES)
    n_out = n_out or (size if n_in <= 1 else size // n_in)
    return n_out, size // max(n_out, 1), n_freq


def _object_delays(variables: Variables, name: str, shape: tuple[int, ...]) -> FloatArray:
    """Delays (n_out, n_in) that the object holds beside its response, in its time unit or samples."""
    found = np.zeros(shape[:2])
    for field_name, own in (("IODelay", shape[:2]), ("OutputDelay", (shape[0], 1)), ("InputDelay", (1, shape[1]))):
        value = np.asarray(variables.get(f"{name}.{field_name}", 0.0), float)
        if value.size:
            found = found + (value.reshape(own) if value.size > 1 else float(value.ravel()[0]))
    return found


def texts_of(variables: Variables, name: str) -> list[str]:
    """Texts of a list or cell, `name{1}` and so on; one text alone is a list of it."""
    if name in variables.texts:
        return [variables.texts[name]]
    found: list[str] = []
    while f"{name}{{{len(found) + 1}}}" in variables.texts:
        found.append(variables.texts[f"{name}{{{len(found) + 1}}}"])
    return found


def _picked(
    variables: Variables, options: ResponseOptions, outputs: Sequence[str], inputs: Sequence[str]
) -> tuple[IntArray, IntArray]:
    """Indices of the wanted outputs and inputs."""
    found: list[IntArray] = []
    for what, channels, names in (("output", options.outputs, outputs), ("input", options.inputs, inputs)):
        for channel in channels:
            if channel.variable not in names:
                message = f"D616 the response has no {what} `{channel.variable}` (it has {', '.join(names)})"
                raise DataError(message, where=str(variables.file), remedy=f"correct its `variable` under `{what}s`")
        found.append(np.array([names.index(channel.variable) for channel in channels]))
    return found[0], found[1]


def _array(variables: Variables, name: str) -> ComplexArray:
    if name in variables:
        return np.asarray(variables[name], complex)
    return np.asarray(variables[f"{name}_real"] + 1j * variables[f"{name}_imaginary"])


def _optional(variables: Variables, name: str, shape: tuple[int, ...]) -> FloatArray | ComplexArray | None:
    if name in variables:
        return np.asarray(variables[name]).reshape(shape)
    return _array(variables, name).reshape(shape) if f"{name}_real" in variables else None
