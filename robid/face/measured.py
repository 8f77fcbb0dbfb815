"""Frequency responses that were measured elsewhere, from files and from arrays in memory."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robid.errors import SettingsError
from robid.face.arguments import kind_of, placed, shaped, wrong_shape, wrong_type
from robid.face.remedies import in_words_of_python
from robid.logs.responses.table import ResponseTable
from robid.pipeline.response_files import read_responses as read_files
from robid.pipeline.response_files import responses_of
from robid.results.options import options_from
from robid.settings.checks.responses import check_options, check_path
from robid.settings.problems import format_field
from robid.settings.sources import is_numbered_response, response_paths
from robid.signals.response_options import ResponseOptions

if TYPE_CHECKING:
    from robid.arrays import ComplexArray, FloatArray
    from robid.frf.frf import Frf
    from robid.settings.yaml import FieldPath

_OF_FILES = ("format", "dialect", "frequency", "elements", "magnitude", "phase")


def read_responses(
    file: str | Path,
    *,
    inputs: Sequence[Mapping[str, Any]],
    outputs: Sequence[Mapping[str, Any]],
    configurations: FloatArray | None = None,
    accelerations: bool | None = None,
    **options: Any,  # noqa: ANN401
) -> Frf:
    """Reads frequency responses from a file of an analyser, MATLAB or a drive, as `source: response` does.

    Args:
        file: The file; `{configuration}` in its name is replaced by numbers from 1, where each configuration has one.
        inputs: What each input is, as `{"name": "axis", "variable": "u", "unit": "N m"}`; its name in the file is its
            own where there is no `variable`.
        outputs: What each output is, likewise.
        configurations (n_conf, n_joint): Arm-side joint positions of each response [rad, or m]; zeros when not given.
        accelerations: Whether motions become accelerations; where the inputs drive when not given.
        options: Fields of `ResponseOptions` by name, as in an experiment file; `delay_s` is an option of the fit.

    Raises:
        SettingsError: If what is said of the file contradicts itself, or `configurations` has other axes.
        DataError: If the file cannot be read, or does not have what is wanted of it.
    """
    called = "read_responses"
    told = _options(inputs, outputs, options, called)
    name = str(file)
    _refuse(check_path(("file",), name), called)
    places = _places(configurations, called)
    count = len(places) if places is not None and is_numbered_response(name) else 1
    with in_words_of_python():
        files = [response_paths(name, told, Path(), index) for index in range(count)]
        return read_files(files, told, places, None, accelerations=accelerations)[0]


def make_responses(
    frequency_hz: FloatArray,
    response: ComplexArray,
    *,
    inputs: Sequence[Mapping[str, Any]],
    outputs: Sequence[Mapping[str, Any]],
    deviation: FloatArray | None = None,
    coherence: FloatArray | None = None,
    configurations: FloatArray | None = None,
    accelerations: bool | None = None,
    **options: Any,  # noqa: ANN401
) -> Frf:
    """Makes frequency responses of arrays.

    Args:
        frequency_hz (n_freq,): Frequencies, rising [Hz].
        response (n_conf, n_freq, n_out, n_in): The responses, in the units of the channels; NaN where a line says
            nothing. One configuration may leave out its axis; one element alone is (n_freq,).
        inputs: What each input is, as `{"name": "axis", "unit": "N m"}`.
        outputs: What each output is, likewise.
        deviation: Standard deviation, root of E|error|^2 of the complex number; axes as of `response`.
        coherence: Coherence, gamma squared; axes as of `response`, used with `averages`.
        configurations (n_conf, n_joint): Arm-side joint positions of each response [rad, or m]; zeros when not given.
        accelerations: Whether motions become accelerations; where the inputs drive when not given.
        options: Fields of `ResponseOptions` by name that say nothing of files, as `averages` or `sampling_period_s`.

    Raises:
        SettingsError: If what is said of the arrays contradicts itself, or one has other axes.
        DataError: If lines or values cannot be used.
    """
    called = "make_responses"
    of_files = [name for name in options if name in _OF_FILES]
    if of_files:
        what = f"S641 `{of_files[0]}` says what a file has, and these are arrays"
        raise SettingsError(what, where=called, remedy=f"leave it out, or give the file to `{read_responses.__name__}`")
    told = _options(inputs, outputs, options, called)
    lines = shaped(frequency_hz, "frequency_hz", "n_freq", called)
    sizes = len(lines), len(told.outputs), len(told.inputs)
    values = _four(response, "response", sizes, called)
    variance = None if deviation is None else _four(deviation, "deviation", sizes, called).real ** 2
    ratio = None if coherence is None else _four(coherence, "coherence", sizes, called).real
    places = _places(configurations, called)
    for name, each in (("configurations", places), ("deviation", variance), ("coherence", ratio)):
        if each is not None and len(each) != len(values):
            what = f"`{name}` is of {len(each)} configurations, `response` of {len(values)}"
            raise wrong_shape(what, called, "give one for each")
    absent = [None] * len(values)
    rows = zip(values, absent if variance is None else variance, absent if ratio is None else ratio, strict=True)
    tables = [(ResponseTable(lines, *row), called) for row in rows]
    with in_words_of_python():
        return responses_of(tables, told, places, None, accelerations=accelerations)[0]


def _options(
    inputs: Sequence[Mapping[str, Any]], outputs: Sequence[Mapping[str, Any]], given: Mapping[str, Any], called: str
) -> ResponseOptions:
    """What the response means, checked as in an experiment file."""
    if "delay_s" in given:
        what = "S640 `delay_s` is not kept with a response"
        raise SettingsError(what, where=called, remedy="give it to `fit_model`, as an option of the fit")
    channels = {"inputs": _channels(inputs, "inputs", called), "outputs": _channels(outputs, "outputs", called)}
    told = options_from(ResponseOptions, {**channels, **given}, called)
    _refuse(check_options((), told), called)
    return told


def _channels(given: object, name: str, called: str) -> list[dict[str, Any]]:
    """Channels as mappings, those without a variable named by themselves."""
    listed = [given] if isinstance(given, Mapping) else given
    if not isinstance(listed, list | tuple) or not listed or not all(isinstance(one, Mapping) for one in listed):
        what = f"`{name}` is {kind_of(given)}, but must be a list of mappings"
        raise wrong_type(what, called, 'say what each channel is, as `[{"name": "axis", "unit": "N m"}]`')
    return [{"variable": one.get("name"), **one} for one in listed]


def _refuse(found: Iterable[tuple[FieldPath, str]], called: str) -> None:
    for field, problem in found:
        raise SettingsError(f"{problem} (`{format_field(field)}`)", where=called, remedy="correct the argument")


def _places(configurations: object, called: str) -> FloatArray | None:
    if configurations is None:
        return None
    return placed(shaped(configurations, "configurations", "n_conf n_joint", called), "configurations", called)


def _four(values: object, name: str, sizes: tuple[int, int, int], called: str) -> ComplexArray:
    """An array as (n_conf, n_freq, n_out, n_in), `sizes` those of the last three."""
    wanted = "(n_conf, n_freq={}, n_out={}, n_in={})".format(*sizes)
    try:
        array = np.asarray(values, complex)
    except (TypeError, ValueError) as error:
        what = f"`{name}` is {kind_of(values)}, which is no array of numbers"
        raise wrong_shape(what, called, f"give an array {wanted}") from error
    whole = array[:, None, None] if array.ndim == 1 and sizes[1:] == (1, 1) else array
    if whole.ndim not in (3, 4) or whole.shape[-3:] != sizes:
        what = f"`{name}` has shape {array.shape}, but must have {wanted}"
        raise wrong_shape(what, called, "bring its axes into that order; one configuration may leave out its own")
    return whole.reshape(-1, *sizes)
