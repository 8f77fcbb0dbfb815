"""Numbers as engineers write them: SI prefixes, and no more digits than are known."""

from __future__ import annotations

import math
from dataclasses import dataclass

_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G", 12: "T"}
_AS_THEY_ARE = ("%", "mm")  # units that take no prefix
_PREFIXED_UNITS = ("N", "s", "A", "V", "W", "Hz", "m", "rad")
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
MISSING = "\N{EN DASH}"
MINUS = "\N{MINUS SIGN}"
_TIMES = "\N{MULTIPLICATION SIGN}"
MAX_DIGITS = 6
_NOTHING = 1e3  # times smaller than its half width, a number is as good as zero


@dataclass(frozen=True)
class Scale:
    """How the numbers of one row are written: a common factor, unit and number of decimals."""

    exponent: int  # numbers are divided by 10 to this power
    unit: str  # unit that belongs to the divided numbers
    decimals: int  # digits after the decimal point

    def text(self, value: float | None) -> str:
        """Writes a number in this scale, without the unit."""
        if value is None or math.isnan(value):
            return MISSING
        if math.isinf(value):
            return "∞" if value > 0 else MINUS + "∞"
        scaled = value / 10.0**self.exponent
        if abs(scaled) >= 1e5:
            return _power(scaled, 2)
        decimals = self.decimals
        if 0 < abs(scaled) < 10.0 ** (1 - decimals):
            decimals = min(decimals + 3, 1 - math.floor(math.log10(abs(scaled))))
        written = f"{scaled:.{decimals}f}"
        return written.replace("-", MINUS) if float(written) else "0"


def scale_for(value: float, unit: str = "", half_width: float | None = None) -> Scale:
    """Chooses the scale of a number in SI units: its half width gets two digits; without it the number gets four.

    A number that is next to nothing beside its half width is written in the scale of that.
    """
    if half_width is not None and math.isfinite(half_width) and half_width > _NOTHING * abs(value) > 0:
        value = half_width
    if not math.isfinite(value) or value == 0:
        return Scale(0, pretty_unit(unit), 3)
    digits = 4
    if half_width is not None and half_width > 0:
        known = math.log10(abs(value) / half_width) if math.isfinite(half_width) else 0.0
        digits = min(max(math.floor(known) + 2, 3), MAX_DIGITS)
    order = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    exponent = min(max(3 * (order // 3), -12), 12)
    if not unit:
        exponent = 0 if -3 <= order < 4 else exponent
    if unit.startswith(_AS_THEY_ARE):
        exponent = 0
    return Scale(exponent, _scaled_unit(exponent, unit), max(digits - 1 - (order - exponent), 0))


def engineering(value: float | None, unit: str = "", half_width: float | None = None) -> str:
    """Writes one number with its unit, as in `4.58 MN m/rad`."""
    if value is None:
        return MISSING
    scale = scale_for(value, unit, half_width)
    return f"{scale.text(value)} {scale.unit}".strip()


def joint_text(value: float, unit: str) -> str:
    """Writes a joint's position in degrees to a tenth, in metres to a millimetre."""
    written = f"{value:.3f}" if unit == "m" else f"{value:.1f}"
    return written.lstrip("-") if float(written) == 0 else written.replace("-", MINUS)


def significant(value: float | None, digits: int = 3) -> str:
    """Writes a number without a prefix to so many significant digits."""
    if value is None or math.isnan(value):
        return MISSING
    if math.isinf(value):
        return "∞" if value > 0 else MINUS + "∞"
    if value == 0:
        return "0"
    order = int(f"{value:.{digits - 1}e}".split("e")[1])
    if not -4 <= order < 6:
        return _power(value, digits)
    return f"{value:.{max(digits - 1 - order, 0)}f}".replace("-", MINUS)


def percent(fraction: float | None, *, signed: bool = False) -> str:
    """Writes a fraction in percent with two significant digits, one where it is tiny, as in `+1.2 %`."""
    if fraction is None or math.isnan(fraction):
        return MISSING
    value = 100 * fraction
    if value == 0:
        return "0 %"
    if math.isinf(value) or abs(value) >= 1e4:
        return "> 10 000 %"
    decimals = 0 if abs(value) >= 9.95 else 1 if abs(value) >= 0.995 else 2
    if 0 < abs(value) < 0.00995:
        decimals = min(-math.floor(math.log10(abs(value))), 4)
    written = f"{value:+.{decimals}f}" if signed else f"{value:.{decimals}f}"
    return f"{written.replace('-', MINUS)} %"


def duration(seconds: float | None) -> str:
    """Writes a time span, as in `850 ms`, `12.3 s` or `4 min 20 s`."""
    if seconds is None:
        return MISSING
    if seconds < 0.9995:
        return f"{1000 * seconds:.0f} ms"
    if seconds < 59.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest:02d} s"
    return f"{minutes // 60} h {minutes % 60:02d} min"


def number_of(index: int) -> str:
    """Writes an index, which counts from 0, as the reader counts: from 1."""
    return str(index + 1)


def pretty_unit(unit: str) -> str:
    """Writes the powers of a unit as superscripts, as in `rad/s²`."""
    parts = unit.split("^")
    for position in range(1, len(parts)):
        part = parts[position]
        length = len(part) - len(part.lstrip("-0123456789"))
        parts[position] = part[:length].translate(_SUPERSCRIPTS) + part[length:]
    return "".join(parts)


def _scaled_unit(exponent: int, unit: str) -> str:
    pretty = pretty_unit(unit)
    if exponent == 0:
        return pretty
    if unit.replace("/", " ").split(" ")[0] in _PREFIXED_UNITS:
        return _PREFIXES[exponent] + pretty
    return f"{_TIMES}10{str(exponent).translate(_SUPERSCRIPTS)} {pretty}".strip()


def _power(value: float, digits: int) -> str:
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}{_TIMES}10{str(int(exponent)).translate(_SUPERSCRIPTS)}".replace("-", MINUS)


def rounded(value: float | None, digits: int = 5) -> float | None:
    """Rounds to so many significant digits, for a figure; None where it is not finite."""
    return None if value is None or not math.isfinite(value) else float(f"{value:.{digits}g}")


def fixed(value: float, decimals: int) -> float | None:
    """Rounds to so many decimals, for a figure; None where it is not finite."""
    return round(float(value), decimals) if math.isfinite(value) else None
