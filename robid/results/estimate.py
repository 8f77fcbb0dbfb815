"""What every fit returns, whatever its family: parameters, how far each may be off, and how the fit ended."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from scipy.linalg import qr
from scipy.stats import norm

from robid.arrays import BoolArray, FloatArray, Quantity
from robid.robot.parameters import FRICTION_KIND, NUISANCE_KIND

_ADDED = 0.5
"""Share of what was known beforehand below which a standard deviation is the data's doing."""


@dataclass(frozen=True)
class Tied:
    """Parameters that follow another one."""

    names: Annotated[tuple[str, ...], Quantity("1", "tied", "Parameters that follow another one")] = ()
    to: Annotated[tuple[str, ...], Quantity("1", "tied", "Name of that one")] = ()
    nominal: Annotated[FloatArray, Quantity("as of to", "tied", "Values of the robot file")] = field(
        default_factory=lambda: np.zeros(0)
    )
    value: Annotated[FloatArray, Quantity("as of to", "tied", "Estimated values")] = field(
        default_factory=lambda: np.zeros(0)
    )
    lower: Annotated[FloatArray, Quantity("as of to", "tied", "Lower ends of their intervals")] = field(
        default_factory=lambda: np.zeros(0)
    )
    upper: Annotated[FloatArray, Quantity("as of to", "tied", "Upper ends of their intervals")] = field(
        default_factory=lambda: np.zeros(0)
    )


@dataclass(frozen=True)
class Estimate:
    """Estimated parameters, each in its own SI unit, with their uncertainty.

    What is relative of a parameter that may be zero is related to what is natural to it; a parameter that is itself a
    relative error is related to nothing.
    """

    names: Annotated[tuple[str, ...], Quantity("1", "parameter")]
    kinds: Annotated[tuple[str, ...], Quantity("1", "parameter")]
    units: Annotated[tuple[str, ...], Quantity("1", "parameter", "Unit of each parameter")]
    # NaN of what no robot file states, as poles
    nominal: Annotated[FloatArray, Quantity("as in units", "parameter", "Value of the robot file")]
    value: Annotated[FloatArray, Quantity("as in units", "parameter", "Estimated value")]
    # Lower end of the interval of the parameter itself; it need not lie around the value
    lower: Annotated[FloatArray, Quantity("as in units", "parameter", "Lower end of the interval")]
    upper: Annotated[FloatArray, Quantity("as in units", "parameter", "Upper end of the interval")]
    # Covariance of the values, linearised, without any quantile
    covariance: Annotated[FloatArray, Quantity("products of units", "parameter parameter", "Covariance of the values")]
    # Of Student's distribution, whose quantile of `covariance` an interval is; infinite for the normal one
    degrees_of_freedom: Annotated[
        FloatArray, Quantity("1", "parameter", "Of Student's distribution that the intervals follow")
    ]
    confidence: float  # Level of the intervals
    interval_rule: str  # What set the width of the intervals, in words
    relative_std: Annotated[FloatArray, Quantity("1", "parameter", "Relative standard deviation")]
    predicted_relative_std: Annotated[FloatArray, Quantity("1", "parameter", "The same, predicted before the fit")]
    # What was known beforehand, relative as the prediction; infinite for nothing
    prior_relative_std: Annotated[
        FloatArray, Quantity("1", "parameter", "What was known beforehand, as predicted_relative_std")
    ]
    relative_half_width: Annotated[FloatArray, Quantity("1", "parameter", "Half width of the interval over the value")]
    # Whether the data were to determine it, predicted before the fit: a statement about the design
    identifiable: Annotated[BoolArray, Quantity("1", "parameter", "Whether the prediction was small enough")]
    identifiable_relative_std: float  # Predicted deviation up to which a parameter counts as identifiable
    undetermined: Annotated[tuple[str, ...], Quantity("1", "combination", "What the data do not determine")]
    status: str  # How the fit ended: `converged`, `iteration_limit` or `stalled`
    advice: str  # What to try next; empty when all is well
    tied: Tied = field(default_factory=Tied)  # Parameters that follow one of these
    physical_value: Annotated[FloatArray | None, Quantity("as in units", "parameter", "Middle of the interval")] = None
    # What infinitely many configurations of this robot would give by this model, the value that predicts best; None
    # where a family has no other
    effective_value: Annotated[
        FloatArray | None, Quantity("as in units", "parameter", "What infinitely many configurations would give by it")
    ] = None
    effective_lower: Annotated[FloatArray | None, Quantity("as in units", "parameter", "Lower end of its interval")] = (
        None
    )
    effective_upper: Annotated[FloatArray | None, Quantity("as in units", "parameter", "Upper end of its interval")] = (
        None
    )

    @property
    def identified(self) -> BoolArray:
        """Which parameters (n_param,) the data determine, by their intervals, whatever the robot file says.

        What was known as well beforehand counts where the data have added to it.
        """
        allowed = norm.ppf(0.5 + 0.5 * self.confidence) * self.identifiable_relative_std
        known = self.prior_relative_std <= self.identifiable_relative_std
        added = ~known | self.identifiable | (self.relative_std < _ADDED * self.prior_relative_std)
        return np.asarray((self.relative_half_width <= allowed) & added)

    @property
    def of_model(self) -> BoolArray:
        """Which parameters (n_param,) the model is made of: all but corrections of compensated friction and ripple."""
        return np.array([kind != FRICTION_KIND for kind in self.kinds], bool)

    @property
    def count(self) -> tuple[int, int]:
        """How many parameters of the model are identified, and how many there are: the only count that is given."""
        return int(np.sum(self.identified & self.of_model)), int(np.sum(self.of_model))

    @property
    def known_beforehand(self) -> BoolArray:
        """Which parameters (n_param,) the robot file knows well enough, and the data were not to know much better.

        What a user frees because the file may be wrong is none of them: two that act alike would vouch for each other.
        """
        of_file = np.array([kind == NUISANCE_KIND for kind in self.kinds], bool)
        known = self.prior_relative_std <= self.identifiable_relative_std
        return np.asarray(~self.identifiable & ~self.identified & known & ~of_file)

    @property
    def middle(self) -> FloatArray:
        """Middle of each interval (n_param,), the estimate of the parameter itself."""
        return self.value if self.physical_value is None else self.physical_value

    @property
    def effective_interval(self) -> tuple[FloatArray, FloatArray]:
        """Ends (n_param,) of the intervals of what predicts; those of the parameters where they are the same."""
        if self.effective_lower is None or self.effective_upper is None:
            return self.lower, self.upper
        return self.effective_lower, self.effective_upper

    @property
    def found(self) -> dict[str, float]:
        """Estimated value of every parameter, tied ones too, by name."""
        return _by_name((self.names, self.value), (self.tied.names, self.tied.value))

    @property
    def stated(self) -> dict[str, float]:
        """The robot file's value of every parameter, tied ones too, by name."""
        return _by_name((self.names, self.nominal), (self.tied.names, self.tied.nominal))


def _by_name(*groups: tuple[tuple[str, ...], FloatArray]) -> dict[str, float]:
    return {name: value for names, values in groups for name, value in zip(names, values.tolist(), strict=True)}


_ALSO_MOVES = 0.3
_MOST = 3


def undetermined_combinations(
    names: tuple[str, ...], covariance: FloatArray, relative: FloatArray, limit: float
) -> tuple[str, ...]:
    """Writes out the directions in which the parameters are uncertain, one sentence each.

    Args:
        names: Name of each parameter.
        covariance (n_param, n_param): Covariance of the internal parameters, logarithms.
        relative (n_param,): What an internal parameter's change by 1 changes the value relatively; 1 for logarithms.
        limit: Relative deviation above which a direction counts as not determined.

    Returns:
        One sentence for each such direction, named after the parameter that shows it best.
    """
    scaled = covariance * np.outer(relative, relative)
    variance, directions = np.linalg.eigh(scaled)
    free = directions[:, variance > limit**2]
    if free.size == 0:
        return ()
    _, _, order = qr(free.T, pivoting=True, mode="economic")
    leaders = order[: free.shape[1]]
    moves = free @ np.linalg.inv(free[leaders])
    deviation = np.sqrt(np.diag(scaled))
    return tuple(
        _sentence(names, leader, column, deviation[leader]) for leader, column in zip(leaders, moves.T, strict=True)
    )


def _sentence(names: tuple[str, ...], leader: int, move: FloatArray, deviation: float) -> str:
    others = [index for index in np.argsort(-np.abs(move)) if index != leader and abs(move[index]) > _ALSO_MOVES]
    known = f"{names[leader]} is known only to {_factor(float(deviation))}"
    if not others:
        return known
    told = [
        f"{names[index]} {'rises' if move[index] > 0 else 'falls'} (exponent {move[index]:.2g})" for index in others
    ]
    more = f" and {len(others) - _MOST} more" if len(others) > _MOST else ""
    together = ", ".join(told[:_MOST])
    return f"{known}: where it rises, {together}{more}, and only the combination is determined"


def _factor(deviation: float) -> str:
    if deviation < 1:
        return f"{100 * deviation:.0f} %"
    return f"a factor of {np.exp(min(deviation, 20.0)):.3g}"
