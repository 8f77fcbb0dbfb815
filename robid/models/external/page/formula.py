"""Transfer functions as text."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.report.numbers import MINUS, significant

_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_DIGITS = 5


def transfer_text(numerator: FloatArray, denominator: FloatArray) -> str:
    """Writes a transfer function as `(0.2 s + 3) / (s² + 4 s + 3)`.

    Args:
        numerator (n_power,): Coefficients, highest power first; zeros in front are left out.
        denominator (n_power,): The same of the denominator.
    """
    above, below = polynomial_text(numerator), polynomial_text(denominator)
    return f"{_wrapped(above)} / {_wrapped(below)}"


def polynomial_text(coefficients: FloatArray) -> str:
    """Writes a polynomial in s, highest power first."""
    degree = len(coefficients) - 1
    text = ""
    for place, value in enumerate(np.asarray(coefficients, float).tolist()):
        if value == 0:
            continue
        sign = "" if not text and value > 0 else MINUS if not text else f" {MINUS} " if value < 0 else " + "
        text += sign + _term(abs(value), degree - place)
    return text or "0"


def _term(value: float, power: int) -> str:
    variable = "" if power == 0 else "s" if power == 1 else f"s{str(power).translate(_SUPERSCRIPTS)}"
    if value == 1 and variable:
        return variable
    return f"{significant(value, _DIGITS)} {variable}".strip()


def _wrapped(text: str) -> str:
    return f"({text})" if " + " in text or MINUS in text else text
