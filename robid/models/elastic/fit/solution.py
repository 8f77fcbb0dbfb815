"""What an elastic fit returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.clusters.pooling import ALONE
from robid.models.elastic.fit.model_error import ModelError
from robid.results.estimate import Estimate


@dataclass(frozen=True)
class Internal:
    """Where the optimizer ended, in its own coordinates.

    Attributes:
        values (n_param,): Optimizer's values.
        covariance (n_param, n_param): Covariance of those that predict other places, without any quantile.
        degrees_of_freedom (n_param,): Of the Student distribution that goes with it; infinite for the normal one.
        singular_values (n_param,): Of the scaled information matrix, largest first.
    """

    values: FloatArray
    covariance: FloatArray
    singular_values: FloatArray
    degrees_of_freedom: FloatArray | None = None


@dataclass(frozen=True)
class Costs:
    """Costs at the minimum.

    Attributes:
        total: Cost at the minimum.
        configuration (n_conf,): Cost of each configuration.
        expected (n_conf,): What the response's covariance alone would give.
        dropped: Response elements below 10 dB that the logarithm dropped.
        told: Response elements that their lines tell of, those included.
    """

    total: float
    configuration: FloatArray
    expected: FloatArray
    dropped: int
    told: int


@dataclass(frozen=True)
class Starts:
    """Where the starts of a fit ended.

    Attributes:
        cost (n_start,): Cost each start ended at.
        iterations (n_start,): Its iterations.
        evaluations (n_start,): Points at which it computed the cost.
        status: How each start ended.
        minimum (n_start,): Which distinct minimum it ended in, 0 is the best.
    """

    cost: FloatArray
    iterations: IntArray
    evaluations: IntArray
    status: tuple[str, ...]
    minimum: IntArray

    @property
    def cap_share(self) -> float:
        """Share of the starts that the iteration limit ended."""
        return self.status.count("iteration_limit") / len(self.status)


@dataclass(frozen=True)
class Responses:
    """What was fitted.

    Attributes:
        configurations (n_conf, n_joint): Configurations of the fit [rad, or m].
        frequency_hz (n_freq,): Frequencies of the fit [Hz].
        measured (n_conf, n_freq, n_out, n_in): Response after the fitted friction compensation.
        modelled (n_conf, n_freq, n_out, n_in): Parametric response.
    """

    configurations: FloatArray
    frequency_hz: FloatArray
    measured: ComplexArray
    modelled: ComplexArray


@dataclass(frozen=True)
class Resampled:
    """What repeated fits say of the parameters' uncertainty.

    Attributes:
        relative_std (n_param,): As in `Estimate`.
        lower (n_param,): Lower end of the interval.
        upper (n_param,): Upper end of the interval.
    """

    relative_std: FloatArray
    lower: FloatArray
    upper: FloatArray


@dataclass(frozen=True)
class Between:
    """How much the internal parameters differ between places, and what each place says of them.

    Attributes:
        between_std (n_param,): Their standard deviation between places.
        degrees_of_freedom (n_param,): Of what places really differ by.
        dependence (n_param,): Share of the information about each that a single place gives.
    """

    between_std: FloatArray
    degrees_of_freedom: FloatArray
    dependence: FloatArray

    @property
    def untested(self) -> BoolArray:
        """Which parameters (n_param,) a single place knows, so that the others do not test them."""
        return np.asarray(self.dependence > ALONE)


@dataclass(frozen=True)
class NamedDoubts:
    """What a fit says of what its robot file may have wrong, to first order.

    Attributes:
        names: Name of each doubt.
        causes: Likely cause that each stands for.
        units: Unit of each amount.
        prior_std (n_doubt,): Deviation known beforehand, of the amounts that all places share.
        place_std (n_doubt,): Deviation of what each place adds.
        value (n_doubt,): Estimated amounts; zero where the file is right.
        half_width (n_doubt,): Half widths of their intervals.
    """

    names: tuple[str, ...]
    causes: tuple[str, ...]
    units: tuple[str, ...]
    prior_std: FloatArray
    place_std: FloatArray
    value: FloatArray
    half_width: FloatArray


@dataclass(frozen=True)
class ElasticSolution:
    """Estimated parameters of an elastic model, and how the fit got there.

    Attributes:
        estimate: The parameters with their uncertainty.
        internal: Where the optimizer ended.
        costs: Costs there.
        misfit: Cost over what noise and the assumed model error give.
        starts: Where each start ended.
        responses: What was fitted.
        model_error: The residual of each element against its expectation; None without a covariance.
        realization_relative_std (n_param,): As `relative_std` of the estimate, from what each realization does to the
            parameters instead of the structured covariance; None without realizations.
        bootstrap: The uncertainty from repeated fits; None without a bootstrap.
        effective: How places differ; None with fewer than four places, or without a covariance.
        doubts: What the data say of the robot file's doubts; None where it has none, and in files of old.
    """

    estimate: Estimate
    internal: Internal
    costs: Costs
    misfit: float
    starts: Starts
    responses: Responses
    model_error: ModelError | None = None
    realization_relative_std: FloatArray | None = None
    bootstrap: Resampled | None = None
    effective: Between | None = None
    doubts: NamedDoubts | None = None
