"""Options of an algorithm from what a caller gives by name, checked against their declaration."""

from __future__ import annotations

import numbers
import operator
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from types import UnionType
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from robid.errors import DataError

_Options = TypeVar("_Options")
_NUMBERS: dict[type, type] = {int: numbers.Integral, float: numbers.Real}
_LIMITS = {
    "ge": ("at least", operator.ge),
    "gt": ("above", operator.gt),
    "le": ("at most", operator.le),
    "lt": ("below", operator.lt),
}


def options_from(kind: type[_Options], given: Mapping[str, Any], called: str) -> _Options:
    """Makes options of what was given by name; a section of options may be a mapping, as in an experiment file.

    Args:
        kind: The frozen dataclass of the options.
        given: Values by name.
        called: The function that they were given to.

    Raises:
        DataError: If there is no such option, or one has a value that it cannot have.
    """
    known = [each.name for each in fields(kind)]  # type: ignore[arg-type]
    unknown = [name for name in given if name not in known]
    if unknown:
        what = f"D290 there is no option {', '.join(f'`{name}`' for name in unknown)}"
        raise DataError(what, where=called, remedy=f"options are: {', '.join(known)}")
    hints = get_type_hints(kind)
    values = {name: _value(value, hints[name], f"{called}, {name}") for name, value in given.items()}
    problems = _problems(kind, hints, values)
    try:
        made = None if problems else kind(**values)
    except (TypeError, ValueError) as error:
        problems, made = [str(error)], None
    if made is None:
        raise DataError(f"D291 {'; '.join(problems)}", where=called, remedy="correct the option")
    return made


def _problems(kind: type, hints: Mapping[str, Any], values: Mapping[str, Any]) -> list[str]:
    """What is wrong with values: their type, or a limit that a number does not keep."""
    metadata, problems = {each.name: each.metadata for each in fields(kind)}, []
    for name, value in values.items():
        if not _is_some(value, hints[name]):
            problems.append(f"`{name}` is {value!r}, but must be {_wanted(hints[name])}")
        elif isinstance(value, numbers.Real):
            stated = [(*_LIMITS[one], limit) for one, limit in metadata[name].items() if one in _LIMITS]
            broken = [f"{word} {limit:g}" for word, keeps, limit in stated if not keeps(value, limit)]
            problems += [f"`{name}` is {value!r}, but must be {limit}" for limit in broken]
    return problems


def _value(value: Any, hint: Any, called: str) -> Any:  # noqa: ANN401
    """A value as options have it: sections of mappings, tuples of lists."""
    inner = get_args(hint)[:1]
    if get_origin(hint) is tuple and is_dataclass(inner[0]) and isinstance(value, list | tuple):
        return tuple(_value(each, inner[0], f"{called}[{index}]") for index, each in enumerate(value, start=1))
    if is_dataclass(hint) and isinstance(value, Mapping):
        return options_from(hint, value, called)  # type: ignore[arg-type]
    return tuple(value) if get_origin(hint) is tuple and isinstance(value, list) else value


def _is_some(value: Any, hint: Any) -> bool:  # noqa: ANN401
    """Whether a value has a declared type; types that are not simple are left to the options themselves."""
    origin, inner = get_origin(hint), get_args(hint)
    if hint is None or hint is type(None):
        return value is None
    if origin is Literal:
        return any(value == one for one in inner)
    if origin in (Union, UnionType):
        return any(_is_some(value, one) for one in inner)
    if origin is tuple:
        each = inner[:1] * len(value) if isinstance(value, tuple) and inner[1:] == (...,) else inner
        return isinstance(value, tuple) and len(each) == len(value) and all(map(_is_some, value, each))
    if origin is not None:
        return not isinstance(origin, type) or isinstance(value, origin)
    if hint in _NUMBERS:
        return isinstance(value, _NUMBERS[hint]) and not isinstance(value, bool)
    return not isinstance(hint, type) or isinstance(value, hint)


def _wanted(hint: Any) -> str:  # noqa: ANN401
    """Says what a value of a declared type is."""
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Literal:
        return f"one of {', '.join(map(repr, inner))}"
    if origin in (Union, UnionType):
        return " or ".join(dict.fromkeys(map(_wanted, inner)))
    if origin is tuple:
        several = inner[1:] == (...,)
        return f"a list of {_wanted(inner[0])}" if several else f"a list of {len(inner)} values"
    names = {int: "a whole number", float: "a number", bool: "True or False", str: "a text", type(None): "None"}
    if hint in names:
        return names[hint]
    return f"a {getattr(origin or hint, '__name__', hint)}".replace("a Mapping", "a mapping")
