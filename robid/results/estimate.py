"""What every fit returns, whatever its family: parameters, how far each may be off, and how the fit ended."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import norm

from robid.arrays import BoolArray, FloatArray
from robid.robot.parameters import DOUBT


@dataclass(frozen=True)
class Tied:
    """Parameters that follow another one.

    Attributes:
        names: Their names.
        to: Name of the parameter that each follows.
        nominal (n_tied,): Their values in the robot file.
        value (n_tied,): Their estimated values.
        lower (n_tied,): Lower ends of their intervals.
        upper (n_tied,): Upper ends.
    """

    names: tuple[str, ...] = ()
    to: tuple[str, ...] = ()
    nominal: FloatArray = field(default_factory=lambda: np.zeros(0))
    value: FloatArray = field(default_factory=lambda: np.zeros(0))
    lower: FloatArray = field(default_factory=lambda: np.zeros(0))
    upper: FloatArray = field(default_factory=lambda: np.zeros(0))


@dataclass(frozen=True)
class Estimate:
    """Estimated parameters, each in its own SI unit, with their uncertainty.

    What is relative of a parameter that may be zero is related to what is natural to it; a parameter that is itself a
    relative error is related to nothing.

    Attributes:
        names: Name of each parameter.
        kinds: Kind of each parameter.
        units: Unit of each parameter.
        nominal (n_param,): What the robot file says.
        value (n_param,): Estimated value.
        lower (n_param,): Lower end of the interval of the parameter itself; it need not lie around the value.
        upper (n_param,): Upper end of the interval.
        covariance (n_param, n_param): Covariance of the values, linearised, without any quantile.
        degrees_of_freedom (n_param,): Of Student's distribution, whose quantile of `covariance` an interval is;
            infinite for the normal one.
        confidence: Level of the intervals.
        interval_rule: What set the width of the intervals, in words.
        relative_std (n_param,): Standard deviation over the value.
        predicted_relative_std (n_param,): The same, predicted at the nominal values before the fit.
        prior_relative_std (n_param,): What was known beforehand, relative as the prediction; infinite for nothing.
        relative_half_width (n_param,): Half width of the interval over the value.
        identifiable (n_param,): Whether the data determine it, decided before the fit.
        identifiable_relative_std: Predicted deviation up to which a parameter counts as identifiable.
        undetermined: Combinations of parameters that the data do not determine, a sentence each.
        status: How the fit ended: `converged`, `iteration_limit` or `stalled`.
        advice: What to try next; empty when all is well.
        tied: Parameters that follow one of these.
        physical_value (n_param,): Middle of the interval, where it is not the estimated value; None where it is.
        effective_value (n_param,): What infinitely many places of this robot would give by this model, the value that
            predicts best; None where a family tells it from no other.
        effective_lower (n_param,): Lower end of its interval.
        effective_upper (n_param,): Upper end.
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    nominal: FloatArray
    value: FloatArray
    lower: FloatArray
    upper: FloatArray
    covariance: FloatArray
    degrees_of_freedom: FloatArray
    confidence: float
    interval_rule: str
    relative_std: FloatArray
    predicted_relative_std: FloatArray
    prior_relative_std: FloatArray
    relative_half_width: FloatArray
    identifiable: BoolArray
    identifiable_relative_std: float
    undetermined: tuple[str, ...]
    status: str
    advice: str
    tied: Tied = field(default_factory=Tied)
    physical_value: FloatArray | None = None
    effective_value: FloatArray | None = None
    effective_lower: FloatArray | None = None
    effective_upper: FloatArray | None = None

    @property
    def identified(self) -> BoolArray:
        """Which parameters (n_param,) were identifiable beforehand and have an interval that bears it out."""
        allowed = norm.ppf(0.5 + 0.5 * self.confidence) * self.identifiable_relative_std
        return np.asarray(self.identifiable & (self.relative_half_width <= allowed))

    @property
    def known_beforehand(self) -> BoolArray:
        """Which parameters (n_param,) the robot file knows well enough, and the data were not to know much better.

        What a user frees because the file is doubted is none of them: two that act alike would vouch for each other.
        """
        doubted = np.array([kind == DOUBT for kind in self.kinds], bool)
        known = self.prior_relative_std <= self.identifiable_relative_std
        return np.asarray(~self.identifiable & known & ~doubted)

    @property
    def middle(self) -> FloatArray:
        """Middle of each interval (n_param,), the estimate of the parameter itself."""
        return self.value if self.physical_value is None else self.physical_value

    @property
    def effective_interval(self) -> tuple[FloatArray, FloatArray]:
        """Ends (n_param,) of the intervals of what predicts; those of the parameters where nothing tells them apart."""
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
