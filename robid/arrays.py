"""Array types, the declarations of what an array or a field is, and the one place where argument shapes are checked."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Instance = TypeVar("Instance", bound="DataclassInstance")
Default = TypeVar("Default")

FloatArray: TypeAlias = NDArray[np.floating[Any]]
ComplexArray: TypeAlias = NDArray[np.complexfloating[Any, Any]]
IntArray: TypeAlias = NDArray[np.integer[Any]]
BoolArray: TypeAlias = NDArray[np.bool_]

LARGEST = 1e18
"""Above any number that a robot has: what is made of larger ones overflows."""


@dataclass(frozen=True)
class Quantity:
    """What a field of a result is, once: stands in its annotation, as in `Annotated[FloatArray, Quantity("s", "row")]`.

    Files, their documentation and the choice of a part along an axis follow from it.
    """

    unit: str  # SI unit of the values, `1` for none; `{name}` for one that the dataclass's `own_units` say
    axes: str  # Name of each axis, separated by spaces
    meaning: str = ""  # What it is, in one sentence
    compact: bool = False  # Whether float32 with a scale is enough to keep


@dataclass(frozen=True)
class Meaning:
    """What a field that commands print is, once: as in `Annotated[str, Meaning("its name")]`; their schema says it."""

    text: str

    def __get_pydantic_json_schema__(self, core: Any, handler: Callable[[Any], dict[str, Any]]) -> dict[str, Any]:  # noqa: ANN401
        """Describes the field in the schema that pydantic makes."""
        return {**handler(core), "description": self.text}


@cache
def quantities(cls: type[DataclassInstance]) -> Mapping[str, Quantity]:
    """Returns what the annotations of a dataclass declare, by field."""
    hints = get_type_hints(cls, include_extras=True)
    extras = {field.name: getattr(hints[field.name], "__metadata__", ()) for field in dataclasses.fields(cls)}
    return {name: said for name, extra in extras.items() for said in extra if isinstance(said, Quantity)}


def places_of(cls: type[DataclassInstance], axis: str) -> Mapping[str, int]:
    """Returns the place of an axis in every field that has it."""
    axes = {name: said.axes.split() for name, said in quantities(cls).items()}
    return {name: all_axes.index(axis) for name, all_axes in axes.items() if axis in all_axes}


def part_of(value: Instance, axis: str, chosen: slice | IntArray) -> Instance:
    """Returns a dataclass with a part of an axis, in everything that has it."""
    part: dict[str, Any] = {}
    for name, place in places_of(type(value), axis).items():
        whole = getattr(value, name)
        if isinstance(whole, tuple):
            part[name] = tuple(whole[index] for index in np.arange(len(whole))[chosen])
        else:
            part[name] = None if whole is None else whole[(*[slice(None)] * place, chosen)]
    return dataclasses.replace(value, **part)


def option(default: Default, description: str, **limits: float) -> Default:
    """Declares an option of an algorithm: its default, what it is, and limits such as `ge`, for schema and checks."""
    return field(default=default, metadata={"description": description, **limits})


def group(kind: Callable[[], Default], description: str) -> Default:
    """Declares a group of options, each with its default, as a field of a frozen dataclass."""
    declared: Any = field(default_factory=kind, metadata={"description": description})
    return declared  # type: ignore[no-any-return]


def check_shape(name: str, array: NDArray[Any], axes: str, **sizes: int) -> None:
    """Checks an argument's shape against named axes.

    Args:
        name: The argument's name, for the message.
        array: The array to check.
        axes: Axis names separated by spaces, as in `"n_freq n_in n_exp"`.
        **sizes: Sizes of the axes that are fixed.

    Raises:
        ValueError: If the number of axes or a fixed size differs.
    """
    names = axes.split()
    agrees = array.ndim == len(names) and all(
        sizes.get(axis, size) == size for axis, size in zip(names, array.shape, strict=True)
    )
    if not agrees:
        fixed = ", ".join(f"{axis}={size}" for axis, size in sizes.items() if axis in names)
        wanted = f"({', '.join(names)})" + (f" with {fixed}" if fixed else "")
        message = f"Argument `{name}` must have shape {wanted}, but has shape {array.shape}."
        raise ValueError(message)
