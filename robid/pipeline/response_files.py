"""Responses of files, whatever their format, as one `Frf` of all configurations."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import kind_of, read_artifact
from robid.errors import ArtifactError, DataError
from robid.frf.frf import NO_RECORD, Frf
from robid.frf.joined import join
from robid.logs.formats.load import load_responses
from robid.logs.formats.variables import tell_response_format
from robid.logs.responses.columns import column_table
from robid.logs.responses.datasets import universal_tables
from robid.logs.responses.importing import Kind, frf_of
from robid.logs.responses.structures import find_object, is_own, object_table, own_tables
from robid.logs.responses.table import ResponseTable, contradictions_refused
from robid.pipeline.stage import counted
from robid.signals.response_options import ResponseOptions

TOLD: Mapping[str, str] = {
    "stated": "deviations of the file",
    "coherence": "deviations by its coherence",
    "neighbours": "deviations by its scatter about neighbouring lines",
}
"""Where the error of a response comes from, the least certain last."""


def read_responses(
    files: Sequence[Mapping[str | None, Path]],
    options: ResponseOptions,
    configurations: FloatArray | None,
    joint_units: tuple[str, ...] | None,
    *,
    accelerations: bool | None,
) -> tuple[Frf, Kind]:
    """Reads responses from one file of all configurations, or from files of each.

    Args:
        files: Of each configuration, or of all: None for the main file, others by their names as elements have them.
        options: What they mean.
        configurations (n_conf, n_joint): Arm-side joint positions [rad, or m]; zeros when None.
        joint_units: Their units; None where all turn.
        accelerations: Whether motions become accelerations; where the inputs drive when None.

    Returns:
        The responses, and where their error comes from.

    Raises:
        DataError: If a file cannot be read, or does not have what is wanted of it.
    """
    tables = [one for paths in files for one in _located(paths, options, one=len(files) > 1)]
    return responses_of(tables, options, configurations, joint_units, accelerations=accelerations)


def responses_of(
    tables: Sequence[tuple[ResponseTable | Frf, str]],
    options: ResponseOptions,
    configurations: FloatArray | None,
    joint_units: tuple[str, ...] | None,
    *,
    accelerations: bool | None,
) -> tuple[Frf, Kind]:
    """Puts responses of several configurations together; arguments as of `read_responses`.

    Args:
        tables: Responses as their files have them, each with what messages call it.
        options: What they mean.
        configurations: Arm-side joint positions.
        joint_units: Their units.
        accelerations: Whether motions become accelerations.

    Returns:
        The responses, and where their error comes from.

    Raises:
        DataError: If there are not as many as configurations, or one cannot be used.
    """
    places = np.zeros((len(tables), len(options.inputs))) if configurations is None else configurations
    _refuse_other_count(len(tables), len(places))
    frfs, kinds = [], set[Kind]()
    for (table, where), place in zip(tables, places, strict=True):
        if isinstance(table, Frf):
            frfs.append(table)
            kinds.add("stated")
            continue
        with contradictions_refused(where):
            frf, kind = frf_of(table, options, place, joint_units, where, accelerations=accelerations)
        frfs.append(frf)
        kinds.add(kind)
    whole = join(frfs, [where for _, where in tables]) if len(frfs) > 1 else frfs[0]
    told = max(kinds, key=list(TOLD).index)
    return replace(whole, notes=(*whole.notes, *notes_of(told))), told


def notes_of(kind: str) -> tuple[str, ...]:
    """Says where the error of responses comes from, and what they cannot tell without a record."""
    return f"Responses were measured elsewhere: {TOLD[kind]}.", NO_RECORD


def _located(
    paths: Mapping[str | None, Path], options: ResponseOptions, *, one: bool
) -> list[tuple[ResponseTable | Frf, str]]:
    """Responses of a configuration's files, or of all, with the file that messages name."""
    where = str(next(iter(paths.values())))
    with contradictions_refused(where):
        found = _tables(paths, options)
    if one and len(found) != 1:
        what = f"D632 the file has responses in {len(found)} configurations"
        raise DataError(what, where=where, remedy="leave `{configuration}` out of its name")
    return [(each, where) for each in found]


def _tables(paths: Mapping[str | None, Path], options: ResponseOptions) -> list[ResponseTable | Frf]:
    """Responses of one file, or of the files of one configuration's elements."""
    first = next(iter(paths.values()))
    own = _own_artifact(first)
    if own is not None:
        return own
    variables = {name: load_responses(path, options.format, options.dialect) for name, path in paths.items()}
    main = next(iter(variables.values()))
    if not options.elements:
        form = options.format or tell_response_format(first)
        if form == "uff":
            return list(universal_tables(main, options))
        if is_own(main):
            return list(own_tables(main, options))
        structure = find_object(main)
        if structure is not None:
            return [object_table(main, structure, options)]
    return [column_table(variables, options)]


def _own_artifact(path: Path) -> list[ResponseTable | Frf] | None:
    """Responses of a run folder's own `frf.h5`, one for each configuration; None of another file."""
    if path.suffix != ".h5":
        return None
    try:
        if kind_of(path) != FRF.name:
            return None
    except ArtifactError:
        return None
    frf = frf_from_artifact(read_artifact(path, FRF))
    return [frf.select([index]) for index in range(len(frf.configurations))]


def _refuse_other_count(n_response: int, n_configuration: int) -> None:
    if n_response != n_configuration:
        there, wanted = counted(n_response, "response"), counted(n_configuration, "configuration")
        what = f"D633 the files have {there}, for {wanted}"
        raise DataError(what, remedy="correct `configurations`, or put `{configuration}` into the file's name")
