"""Responses in datasets 58 of Universal Files, by entity, node and direction."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.logs.formats.variables import Variables
from robid.logs.responses.table import ResponseTable, check_pairs, with_notes
from robid.signals.response_options import ResponseOptions

_FREQUENCY_RESPONSE, _COHERENCE, _GENERAL = 4, 6, 0


def universal_tables(variables: Variables, options: ResponseOptions) -> list[ResponseTable]:
    """Responses in a Universal File, one for each version number, which our exports count configurations by."""
    count = sum(name.endswith(".func_type") for name in variables)
    sets = [f"set({number})" for number in range(1, count + 1) if f"set({number}).data" in variables]
    kinds = {name: _number(variables, f"{name}.func_type") for name in sets}
    versions = sorted({_number(variables, f"{name}.ver_num") for name in sets if kinds[name] == _FREQUENCY_RESPONSE})
    if not versions:
        message = "D613 the file has no frequency response: no dataset 58 of function type 4"
        raise DataError(message, where=str(variables.file), remedy="export responses, and their coherence as type 6")
    return [
        _universal_table(variables, options, [n for n in sets if _number(variables, f"{n}.ver_num") == v], kinds)
        for v in versions
    ]


def channels_of_sets(
    variables: Variables,
) -> tuple[tuple[str, ...], tuple[str, ...], int, set[int], FloatArray] | None:
    """Outputs, inputs, number of versions, function types and lines of a Universal File; None without responses."""
    count = sum(name.endswith(".func_type") for name in variables)
    sets = [f"set({number})" for number in range(1, count + 1) if f"set({number}).data" in variables]
    kinds = {name: _number(variables, f"{name}.func_type") for name in sets}
    told = [name for name in sets if kinds[name] == _FREQUENCY_RESPONSE]
    if not told:
        return None
    outputs, inputs = (
        tuple(dict.fromkeys(_entity_name(variables, name, side) for name in told)) for side in ("rsp", "ref")
    )
    versions = len({_number(variables, f"{name}.ver_num") for name in told})
    return outputs, inputs, versions, set(kinds.values()), np.ravel(variables[f"{told[0]}.x"]).astype(float)


def _entity_name(variables: Variables, name: str, side: str) -> str:
    """The name that `variable` would give it."""
    entity, place, _ = _entity(variables, name, side)
    return place if entity in ("", "NONE") else entity


def _number(variables: Variables, name: str) -> int:
    return int(np.ravel(variables[name])[0])


def _universal_table(
    variables: Variables, options: ResponseOptions, sets: Sequence[str], kinds: dict[str, int]
) -> ResponseTable:
    shape = len(options.outputs), len(options.inputs)
    found: dict[str, dict[tuple[int, int], str]] = {"response": {}, "deviation": {}, "coherence": {}}
    for name in sets:
        place = _place(variables, options, name)
        deviation = kinds[name] == _GENERAL and "deviation" in variables.texts.get(f"{name}.id1", "").lower()
        role = {_FREQUENCY_RESPONSE: "response", _COHERENCE: "coherence"}.get(kinds[name], "deviation" * deviation)
        if place is not None and role:
            if place in found[role]:
                pair = f"`{options.outputs[place[0]].variable}` per `{options.inputs[place[1]].variable}`"
                message = f"D614 the response of {pair} is there twice"
                raise DataError(message, where=str(variables.file), remedy="keep one of them in the file")
            found[role][place] = name
    check_pairs(options, found["response"], str(variables.file), _known_pairs(variables, sets, kinds))
    frequency = np.unique(np.concatenate([np.ravel(variables[f"{n}.x"]) for n in found["response"].values()]))
    response: ComplexArray = np.full((frequency.size, *shape), complex(np.nan, np.nan))
    parts = {role: np.full((frequency.size, *shape), np.nan) for role in ("deviation", "coherence")}
    for role, places in found.items():
        for (row, column), name in places.items():
            at = np.searchsorted(frequency, np.ravel(variables[f"{name}.x"]))
            target = response if role == "response" else parts[role]
            data = np.ravel(variables[f"{name}.data"])
            target[at, row, column] = data if role == "response" else data.real
    told = {role: part if found[role] else None for role, part in parts.items()}
    variance = None if told["deviation"] is None else told["deviation"] ** 2
    notes = {variables.texts.get(f"{name}.rsp_ent_name", ""): variables.texts.get(f"{name}.id3", "") for name in sets}
    return with_notes(ResponseTable(frequency, response, variance, told["coherence"]), notes, options)


def _place(variables: Variables, options: ResponseOptions, name: str) -> tuple[int, int] | None:
    """Which output and input a dataset is of: by names of its entities, or by node and direction as `12:3`."""
    found: list[int | None] = []
    for side, channels in (("rsp", options.outputs), ("ref", options.inputs)):
        known = _entity(variables, name, side)
        at = [index for index, channel in enumerate(channels) if channel.variable in known]
        found.append(at[0] if at else None)
    return None if None in found else (int(found[0] or 0), int(found[1] or 0))


def _entity(variables: Variables, name: str, side: str) -> tuple[str, ...]:
    node, direction = (_number(variables, f"{name}.{side}_{part}") for part in ("node", "dir"))
    return variables.texts.get(f"{name}.{side}_ent_name", ""), f"{node}:{direction}", str(node)


def _known_pairs(variables: Variables, sets: Sequence[str], kinds: dict[str, int]) -> list[str]:
    return [
        " per ".join(_entity_name(variables, name, side) for side in ("rsp", "ref"))
        for name in sets
        if kinds[name] == _FREQUENCY_RESPONSE
    ]
