"""What a fit returns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import norm

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.fit.model_error import ModelError


@dataclass(frozen=True)
class Solution:
    """Estimated parameters with their uncertainty, and how the fit got there.

    Attributes:
        family: Fit family.
        names: Name of each parameter.
        kinds: Kind of each parameter.
        units: Unit of each parameter.
        nominal (n_param,): Value of the robot file.
        estimate (n_param,): Estimated value.
        lower (n_param,): Lower end of the interval.
        upper (n_param,): Upper end of the interval.
        relative_std (n_param,): Standard deviation over the estimate (of the relative error for friction).
        predicted_relative_std (n_param,): The same, predicted at the nominal values before the fit.
        identifiable (n_param,): Whether the prediction was small enough and the data at least halve what was
            unknown before, decided before the fit.
        internal (n_param,): Optimizer's values.
        covariance (n_param, n_param): Covariance of the optimizer's values, without any quantile.
        singular_values (n_param,): Of the scaled information matrix, largest first.
        confidence: Level of the intervals.
        cost: Cost at the minimum.
        configuration_cost (n_conf,): Cost of each configuration.
        expected_cost (n_conf,): What the response's covariance alone would give.
        misfit: Cost over what noise and the assumed model error give; above 1 it multiplies the covariance.
        dropped: Response elements below 10 dB that the logarithm dropped.
        start_cost (n_start,): Cost each start ended at.
        start_iterations (n_start,): Its iterations.
        start_status: How each start ended.
        start_minimum (n_start,): Which distinct minimum it ended in, 0 is the best.
        status: `converged`, `iteration_limit` or `stalled`.
        advice: What to try next; empty when all is well.
        configurations (n_conf, n_joint): Configurations of the fit [rad].
        frequency_hz (n_freq,): Frequencies of the fit [Hz].
        measured (n_conf, n_freq, n_out, n_in): Response after the fitted friction compensation.
        modelled (n_conf, n_freq, n_out, n_in): Parametric response.
        undetermined: Combinations of parameters that the data do not determine, a sentence each.
        model_error: The residual of each element against its expectation; None without a covariance.
        realization_relative_std (n_param,): As `relative_std`, from what each realization does to the parameters
            instead of the structured covariance; None without realizations.
        bootstrap_relative_std (n_param,): The same from repeated fits; None without a bootstrap.
        bootstrap_lower (n_param,): Lower end of the bootstrap's interval.
        bootstrap_upper (n_param,): Upper end of the bootstrap's interval.
        tied_names: Parameters that follow another one.
        tied_to: Name of that one.
        tied_nominal (n_tied,): Their values in the robot file.
        tied_estimate (n_tied,): Their estimated values.
        tied_lower (n_tied,): Lower ends of their intervals.
        tied_upper (n_tied,): Upper ends.
        start_evaluations (n_start,): Points at which each start computed the cost; empty where they were not counted.
        degrees_of_freedom (n_param,): Of Student's distribution, whose quantile of `covariance` an interval is;
            infinite for the normal one. Empty where a file does not say: the normal one.
        interval_rule: What set the width of the intervals, in words.
        prior_relative_std (n_param,): What was known beforehand, relative as `predicted_relative_std`; empty where a
            file does not say.
        relative_half_width (n_param,): Half width of the interval over the estimate, or over what is natural to a
            parameter that may be zero; empty where a file does not say.
        identifiable_relative_std: Predicted deviation up to which a parameter counts as identifiable.
    """

    family: str
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    nominal: FloatArray
    estimate: FloatArray
    lower: FloatArray
    upper: FloatArray
    relative_std: FloatArray
    predicted_relative_std: FloatArray
    identifiable: BoolArray
    internal: FloatArray
    covariance: FloatArray
    singular_values: FloatArray
    confidence: float
    cost: float
    configuration_cost: FloatArray
    expected_cost: FloatArray
    misfit: float
    dropped: int
    start_cost: FloatArray
    start_iterations: IntArray
    start_status: tuple[str, ...]
    start_minimum: IntArray
    status: str
    advice: str
    configurations: FloatArray
    frequency_hz: FloatArray
    measured: ComplexArray
    modelled: ComplexArray
    undetermined: tuple[str, ...] = ()
    model_error: ModelError | None = None
    realization_relative_std: FloatArray | None = None
    bootstrap_relative_std: FloatArray | None = None
    bootstrap_lower: FloatArray | None = None
    bootstrap_upper: FloatArray | None = None
    tied_names: tuple[str, ...] = ()
    tied_to: tuple[str, ...] = ()
    tied_nominal: FloatArray = field(default_factory=lambda: np.zeros(0))
    tied_estimate: FloatArray = field(default_factory=lambda: np.zeros(0))
    tied_lower: FloatArray = field(default_factory=lambda: np.zeros(0))
    tied_upper: FloatArray = field(default_factory=lambda: np.zeros(0))
    start_evaluations: IntArray = field(default_factory=lambda: np.zeros(0, int))
    degrees_of_freedom: FloatArray = field(default_factory=lambda: np.zeros(0))
    interval_rule: str = ""
    prior_relative_std: FloatArray = field(default_factory=lambda: np.zeros(0))
    relative_half_width: FloatArray = field(default_factory=lambda: np.zeros(0))
    identifiable_relative_std: float = 0.2

    @property
    def identified(self) -> BoolArray:
        """Which parameters (n_param,) were identifiable beforehand and have an interval that bears it out."""
        if not self.relative_half_width.size:
            return self.identifiable
        allowed = norm.ppf(0.5 + 0.5 * self.confidence) * self.identifiable_relative_std
        return np.asarray(self.identifiable & (self.relative_half_width <= allowed))

    @property
    def known_beforehand(self) -> BoolArray:
        """Which parameters (n_param,) the robot file knows well enough, and the data were not to know much better."""
        if not self.prior_relative_std.size:
            return np.zeros(len(self.names), bool)
        return np.asarray(~self.identifiable & (self.prior_relative_std <= self.identifiable_relative_std))

    @property
    def fewest_degrees_of_freedom(self) -> float:
        """The fewest behind any parameter's interval, for what depends on several of them."""
        return float(np.min(self.degrees_of_freedom, initial=np.inf))

    @property
    def cap_share(self) -> float:
        """Share of the starts that the iteration limit ended."""
        return self.start_status.count("iteration_limit") / len(self.start_status)

    @property
    def found(self) -> dict[str, float]:
        """Estimate of every parameter, tied ones too, by name."""
        own, tied = (self.names, self.estimate), (self.tied_names, self.tied_estimate)
        return {
            name: value for names, values in (own, tied) for name, value in zip(names, values.tolist(), strict=True)
        }

    @property
    def stated(self) -> dict[str, float]:
        """The robot file's value of every parameter, tied ones too, by name."""
        own, tied = (self.names, self.nominal), (self.tied_names, self.tied_nominal)
        return {
            name: value for names, values in (own, tied) for name, value in zip(names, values.tolist(), strict=True)
        }
