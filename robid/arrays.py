"""Array types and the one place where argument shapes are checked."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

FloatArray: TypeAlias = NDArray[np.floating[Any]]
ComplexArray: TypeAlias = NDArray[np.complexfloating[Any, Any]]
IntArray: TypeAlias = NDArray[np.integer[Any]]
BoolArray: TypeAlias = NDArray[np.bool_]

LARGEST = 1e18
"""Above any number that a robot has: what is made of larger ones overflows."""


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
