"""What the rows of a fleet found, parameter by parameter, from their ledgers one after the other."""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
from scipy.stats import norm

from robid.arrays import FloatArray, IntArray
from robid.fleet.ledger import Ledger
from robid.robot.parameters import DOUBT, LOGARITHMIC, NUISANCE

Key = tuple[str, str]
"""Name of a fit, and of a parameter or misfit."""


def _numbers() -> array[float]:
    return array("d")


@dataclass
class Collected:
    """A parameter, or misfit, of one fit over the rows."""

    kind: str  # kind of the parameter; empty for a misfit
    unit: str
    confidence: float  # level of the intervals
    rows: array[int] = field(default_factory=lambda: array("q"))  # index of each row that has it
    # What the robot file says; not a number where it says nothing, as below.
    nominal: array[float] = field(default_factory=_numbers)
    middle: array[float] = field(default_factory=_numbers)  # the parameter itself; a misfit's value
    low: array[float] = field(default_factory=_numbers)  # lower end of its interval
    high: array[float] = field(default_factory=_numbers)  # upper end
    # What rows are compared by: the effective value where there is one, of an identified parameter, as a logarithm
    # where the kind is one.
    compared: array[float] = field(default_factory=_numbers)
    std: array[float] = field(default_factory=_numbers)  # standard deviation of that

    @property
    def is_misfit(self) -> bool:
        """Whether it says how badly a model fits."""
        return not self.kind

    @property
    def is_logarithmic(self) -> bool:
        """Whether rows are compared by its logarithm."""
        return self.is_misfit or self.kind in LOGARITHMIC

    @property
    def known(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Rows (n,) that can be compared, what they are compared by, and its standard deviations."""
        value, std = np.array(self.compared), np.array(self.std)
        kept = np.isfinite(value) & np.isfinite(std)
        return np.array(self.rows, int)[kept], value[kept], std[kept]

    def add(self, row: int, entry: Mapping[str, Any]) -> None:
        """Adds what a row found."""
        value, std = _compared(entry)
        middle = entry.get("physical")
        self.rows.append(row)
        self.nominal.append(_known(entry["nominal"]))
        self.middle.append(_known(entry["estimate"] if middle is None else middle))
        self.low.append(_known(entry["physical_low"]))
        self.high.append(_known(entry["physical_high"]))
        self.compared.append(value)
        self.std.append(std)

    def add_misfit(self, row: int, value: float) -> None:
        """Adds the misfit of a row; nobody knows its error."""
        self.rows.append(row)
        self.middle.append(value)
        self.compared.append(math.log(value))
        self.std.append(0.0)


def collect(ledgers: Iterable[Ledger | None]) -> dict[Key, Collected]:
    """Collects the parameters of all rows, those that are nuisances apart, and their misfits.

    Args:
        ledgers: Ledger of each row, in their order; None for a row that has none.
    """
    found: dict[Key, Collected] = {}
    misfits: dict[Key, Collected] = {}
    for row, ledger in enumerate(ledgers):
        if ledger is None:
            continue
        for entry in ledger.results:
            key = entry["fit"], entry["parameter"]
            if key not in found and entry["kind"] not in (DOUBT, NUISANCE):
                found[key] = Collected(entry["kind"], entry["unit"], entry["confidence"])
            if key in found:
                found[key].add(row, entry)
        for fit, told in ledger.misfits.items():
            for name, value in told.items():
                misfits.setdefault((fit, name), Collected("", "1", 0.0)).add_misfit(row, value)
    return found | misfits


def _compared(entry: Mapping[str, Any]) -> tuple[float, float]:
    """What a row is compared by in a parameter, and its standard deviation; not numbers where it is not."""
    if not entry["identified"] or entry["tied_to"]:
        return math.nan, math.nan
    value, low, high = (_known(entry.get(f"effective{end}")) for end in ("", "_low", "_high"))
    std = (high - low) / (2 * _quantile(entry["confidence"]))
    if not (math.isfinite(value) and math.isfinite(std)):
        value, std = _known(entry["estimate"]), _known(entry.get("standard_deviation"))
        low = high = math.nan
    if entry["kind"] not in LOGARITHMIC:
        return value, std
    if value <= 0:
        return math.nan, math.nan
    return math.log(value), math.log(high / low) / (2 * _quantile(entry["confidence"])) if low > 0 else std / value


@cache
def _quantile(confidence: float) -> float:
    return float(norm.ppf(0.5 + 0.5 * confidence))


def _known(value: float | None) -> float:
    return math.nan if value is None else float(value)
