"""What arguments from Python must be: of which type, in which order, and arrays of which shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from robid.arrays import LARGEST, FloatArray, check_shape, quantities
from robid.errors import SettingsError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

_Wanted = TypeVar("_Wanted")


def wrong_type(what: str, called: str, remedy: str) -> SettingsError:
    """Returns the refusal of arguments that are something else than a function takes."""
    return SettingsError(f"S576 {what}", where=called, remedy=remedy)


def wrong_shape(what: str, called: str, remedy: str) -> SettingsError:
    """Returns the refusal of an array that is not numbers or has other axes."""
    return SettingsError(f"S577 {what}", where=called, remedy=remedy)


def required(value: object, wanted: type[_Wanted], name: str, called: str, made_by: str) -> _Wanted:
    """Returns an argument that must be of a type.

    Args:
        value: The argument.
        wanted: Its type.
        name: Its name.
        called: The function that it was given to.
        made_by: The call that makes such a value, as `robid.load_robot(path)`.

    Raises:
        SettingsError: If it is of another type.
    """
    if isinstance(value, wanted):
        return value
    what = f"`{name}` is {kind_of(value)}, but must be {with_article(wanted.__name__)}"
    raise wrong_type(what, called, f"give what `{made_by}` returns")


def shaped(values: object, name: str, axes: str, called: str, **sizes: int) -> FloatArray:
    """Returns an argument as real numbers of a shape.

    Args:
        values: The argument.
        name: Its name.
        axes: Names of its axes, separated by spaces, as of `check_shape`.
        called: The function that it was given to.
        **sizes: Sizes of the axes that are fixed.

    Raises:
        SettingsError: If it is not numbers, or has another shape.
    """
    array = numbers(values, name, called, _listed(axes))
    try:
        check_shape(name, array, axes, **sizes)
    except ValueError as error:
        remedy = "bring its axes into that order"
        if array.ndim == len(axes.split()) - 1:
            remedy = f"give one alone as an array of shape {(1, *array.shape)}, as `np.atleast_2d` makes"
        raise wrong_shape(f"{error}".rstrip("."), called, remedy) from error
    return array


def placed(configurations: FloatArray, name: str, called: str) -> FloatArray:
    """Returns configurations (n_conf, n_joint) that a robot can be in.

    Raises:
        SettingsError: If there is none, or a position is not finite.
    """
    if not len(configurations):
        what, remedy = f"S599 `{name}` has no configuration", "give at least one row of joint positions"
        raise SettingsError(what, where=called, remedy=remedy)
    if not (np.abs(configurations) < LARGEST).all():
        row = int(np.argwhere(~(np.abs(configurations) < LARGEST))[0, 0])
        what = f"S600 `{name}` has positions that are not finite, the first in row {row}"
        raise SettingsError(what, where=called, remedy="give joint positions in rad, or m")
    return configurations


def sampled(frequency_hz: object, called: str, sampling_period_s: float | None) -> FloatArray:
    """Returns frequencies (n_freq,) that signals of a sampling period have; None for continuous time [Hz].

    Raises:
        SettingsError: If there is none, or one is not above zero and below half the sampling rate.
    """
    lines = shaped(frequency_hz, "frequency_hz", "n_freq", called)
    highest = LARGEST if sampling_period_s is None else 0.5 / sampling_period_s
    wrong = lines[~((lines > 0) & (lines < highest))]
    if wrong.size or not lines.size:
        shown = f"has {wrong[0]:g} Hz" if wrong.size else "is empty"
        what = f"S602 `frequency_hz` {shown}, but must hold frequencies above 0 and below {highest:g} Hz"
        raise SettingsError(what, where=called, remedy="give frequencies in Hz, below half the sampling rate")
    return lines


def numbers(values: object, name: str, called: str, axes: str) -> FloatArray:
    """Returns an argument as an array of real numbers; `axes` names those of its array, for the message.

    Raises:
        SettingsError: If it is not numbers.
    """
    try:
        return np.asarray(values, float)
    except (TypeError, ValueError) as error:
        what = f"`{name}` is {kind_of(values)}, which is no array of numbers"
        raise wrong_shape(what, called, f"give an array ({axes})") from error


def check_axes(value: DataclassInstance, called: str) -> None:
    """Checks that the arrays of a response or record have the axes that its class states, each axis of one length.

    The length of an axis is that of the names or frequencies along it, where there are such: they are one-dimensional.

    Raises:
        SettingsError: If arrays do not agree, with both of them.
    """
    known: dict[str, tuple[int, str]] = {}
    arrays = {name: (said.axes.split(), getattr(value, name)) for name, said in quantities(type(value)).items()}
    # What is not known is None, or no names at all.
    present = {
        name: one
        for name, one in arrays.items()
        if one[1] is not None and not (isinstance(one[1], tuple) and not one[1])
    }
    for name, (axes, array) in sorted(present.items(), key=lambda item: len(item[1][0])):
        shape = (len(array),) if isinstance(array, tuple) else np.shape(array)
        whole = f"`{name}` of {with_article(type(value).__name__)} has shape {shape}, but must have"
        if len(shape) != len(axes):
            raise wrong_shape(f"{whole} the axes ({_listed(' '.join(axes))})", called, "bring the array to these axes")
        for axis, size in zip(axes, shape, strict=True):
            length, source = known.setdefault(axis, (size, name))
            if size != length:
                told = f"{length} along the axis `{axis}` of ({_listed(' '.join(axes))}), as `{source}` has"
                raise wrong_shape(f"{whole} {told}", called, "bring the axes into that order")


@dataclass(frozen=True)
class Wanted:
    """What an argument must be."""

    name: str  # Its name
    kind: type  # Its type
    made_by: str  # The call that makes one
    several: bool = False  # Whether a list of them will do

    def accepts(self, value: object) -> bool:
        """Whether a value will do."""
        each = value if self.several and isinstance(value, list | tuple) and value else (value,)
        return all(isinstance(one, self.kind) for one in each)

    def __str__(self) -> str:
        return f"`{self.name}`, {with_article(self.kind.__name__)}{' or a list of them' if self.several else ''}"


def in_order(data: Sequence[object], wanted: Sequence[Wanted], called: str) -> None:
    """Checks the arguments of a call that takes several in an order.

    Args:
        data: The arguments.
        wanted: What each must be.
        called: The call, as `fit_model("elastic", ...)`.

    Raises:
        SettingsError: If one is missing, too many, of another type or in another place; it says what was given.
    """
    if len(data) == len(wanted) and all(one.accepts(each) for one, each in zip(wanted, data, strict=True)):
        return
    given = ", then ".join(map(kind_of, data)) or "nothing"
    what = f"it takes {', then '.join(map(str, wanted))}; it was given {given}"
    makers = " and ".join(f"`{one.made_by}`" for one in wanted)
    raise wrong_type(what, called, f"give what {makers} return{'s' if len(wanted) == 1 else ''}")


def kind_of(value: object) -> str:
    """Says what a value is, as `an array of shape (3, 2)` or `a RobotModel`."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if isinstance(value, str):
        return f"the text `{value}`"
    if value is None:
        return "None"
    if isinstance(value, list | tuple) and value:
        kinds = dict.fromkeys(type(each).__name__ for each in value)
        return f"{with_article(type(value).__name__)} of {' and '.join(kinds)}"
    return with_article(type(value).__name__)


def with_article(noun: str) -> str:
    """Puts the article before a name of a type."""
    spoken_vowel = noun[:1].lower() in "aeio" or noun.startswith("Frf")
    return f"an {noun}" if spoken_vowel else f"a {noun}"


def _listed(axes: str) -> str:
    return ", ".join(axes.split())
