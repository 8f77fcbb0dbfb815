"""Estimated parameters as a table that a notebook shows."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

from robid.errors import require_module

if TYPE_CHECKING:
    from pandas import DataFrame

    from robid.arrays import FloatArray
    from robid.results.estimate import Estimate


@dataclass(frozen=True)
class Parameter:
    """One parameter, in its SI unit.

    Two intervals are told apart: `lower` to `upper` holds the parameter itself, `effective_lower` to `effective_upper`
    what the model needs to predict; they are the same where a kind of model has one.
    """

    name: str  # As `axis_2.stiffness`
    kind: str  # As `stiffness`
    unit: str  # As `N m/rad`
    nominal: float  # Value of the robot file; NaN of what none states, as poles
    value: float  # Estimated value, the one that predicts best
    lower: float  # Lower end of the parameter's interval
    upper: float  # Upper end of it
    effective_lower: float  # Lower end of the interval of what predicts
    effective_upper: float  # Upper end of it
    identified: bool  # Whether the data determine it, by its interval


class Parameters(Mapping[str, Parameter]):
    """Parameters by name, in their order; `estimate` holds the arrays, and `covariance` that of the values.

    Args:
        estimate: What a fit found.
    """

    def __init__(self, estimate: Estimate) -> None:
        self.estimate = estimate
        self._rows = {str(name): _parameter(estimate, row) for row, name in enumerate(estimate.names)}

    def __getitem__(self, name: str) -> Parameter:
        if name not in self._rows:
            raise KeyError(f"there is no parameter `{name}`; there are {', '.join(self._rows)}")
        return self._rows[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._rows)

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def covariance(self) -> FloatArray:
        """Covariance (n_param, n_param) of the values, in products of their units."""
        return self.estimate.covariance

    @property
    def counted(self) -> str:
        """How many parameters of the model are identified, in words, and how many more are of friction and ripple."""
        (found, every), along = self.estimate.count, int((~self.estimate.of_model).sum())
        return f"{found} of {every} parameters identified" + (f", {along} more of friction and ripple" if along else "")

    @property
    def confidence(self) -> float:
        """Level of the intervals."""
        return self.estimate.confidence

    def to_pandas(self) -> DataFrame:
        """Returns a table, one row a parameter, its name the index.

        Raises:
            SettingsError: If pandas is not installed.
        """
        require_module("pandas", "notebook", "A table")
        from pandas import DataFrame

        names = [each.name for each in fields(Parameter)]
        table = DataFrame([[getattr(row, name) for name in names] for row in self.values()], columns=names)
        return table.set_index("name")

    def __repr__(self) -> str:
        if not self._rows:
            return "Parameters()"
        width = max(map(len, self._rows))
        head = f"{'parameter':{width}}  {'estimate':>11}  {100 * self.confidence:g} % interval of the parameter itself"
        lines = [
            f"{row.name:{width}}  {row.value:11.5g}  [{row.lower:.5g}, {row.upper:.5g}] {row.unit}"
            + ("" if row.identified else "  not identified")
            for row in self.values()
        ]
        return "\n".join([head, *lines])


def _parameter(estimate: Estimate, row: int) -> Parameter:
    low, high = estimate.effective_interval
    return Parameter(
        name=str(estimate.names[row]),
        kind=str(estimate.kinds[row]),
        unit=str(estimate.units[row]),
        nominal=float(estimate.nominal[row]),
        value=float(estimate.value[row]),
        lower=float(estimate.lower[row]),
        upper=float(estimate.upper[row]),
        effective_lower=float(low[row]),
        effective_upper=float(high[row]),
        identified=bool(estimate.identified[row]),
    )
