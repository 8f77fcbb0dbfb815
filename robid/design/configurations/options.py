"""Options of the choice of configurations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from robid.arrays import FloatArray, group, option
from robid.design.configurations.criteria import Criterion
from robid.robot.parameters import FREE, OF_SPRINGS, LogarithmicKind, ResponseNuisance

ALONG = tuple(kind for kind in FREE if kind not in OF_SPRINGS)
"""Kinds that are estimated along unless something else is said."""

CriterionName = Literal["d", "a", "e", "prediction"]

OutputName = Literal["response", "resonances", "tool_displacement", "feedforward_torque"]

NuisanceKind = Literal[LogarithmicKind, ResponseNuisance]


@dataclass(frozen=True)
class DesignOptions:
    """Choice of the configurations that tell most about the parameters."""

    count: int = option(8, "Number of different configurations to choose, at most.", ge=1, le=10_000)
    criterion: CriterionName = option(
        "d",
        "Minimised quantity: the volume of the parameters' confidence region (`d`), the sum of their relative "
        "variances (`a`), the largest variance of any combination (`e`), or the expected error of predicted responses "
        "(`prediction`). The first three serve a model whose springs are wanted, the last one a model that predicts.",
    )
    experiments: int | None = option(
        None,
        "Visits to share out among the chosen configurations, repeats allowed; one each when not given.",
        ge=1,
        le=100_000,
    )
    budget: float | None = option(
        None,
        "Largest total cost of all visits, in the unit of the candidates' costs. When not given, the number of "
        "visits times the mean cost.",
        gt=0,
    )
    restarts: int = option(4, "Random starts of the exchange.", ge=0, le=10_000)
    seed: int = option(1, "Seed of these starts.", ge=0)
    iterations: int = option(1000, "Limit on steps towards the optimal weights.", ge=1, le=10_000_000)
    gap: float = option(1e-8, "Certified relative gap at which they stop; 1e-4 at best for `e`.", gt=0)

    @property
    def of_information(self) -> Criterion:
        """The criterion, of information alone.

        Raises:
            ValueError: If it is `prediction`.
        """
        if self.criterion == "prediction":
            raise ValueError("Argument `options` must have a criterion of information, but has `prediction`.")
        return self.criterion


@dataclass(frozen=True)
class DesignWeights:
    """Weights of the response's elements in a design."""

    off_diagonal: float = option(1.0, "Weight of off-diagonal elements, diagonal is 1.", ge=0)
    low_cut_hz: float = option(0.0, "Lines below have no weight [Hz].", ge=0)
    mean: Literal["importance", "fit"] = option(
        "importance",
        "`importance`: the weights multiply the inverse covariance. `fit`: they are the user weights that a "
        "fit will have, scaled and cut at 10 dB as in the fit. The choice is then made for the covariance of "
        "that fit.",
    )


@dataclass(frozen=True)
class BetweenRelativeStd:
    """How far what a parameter comes out as differs from one configuration to another, by what the model lacks."""

    stiffness: float = option(0.02, "Of springs, relative.", ge=0)
    damping: float = option(0.2, "Of dampers, relative.", ge=0)
    motor_inertia: float = option(0.02, "Of motor inertias, relative.", ge=0)
    link_inertia: float = option(0.02, "Of link inertias, relative.", ge=0)

    def of(self, names: Sequence[str]) -> FloatArray:
        """Deviations (n_name,) of parameters."""
        return np.array([getattr(self, name.rpartition(".")[2]) for name in names])


@dataclass(frozen=True)
class InformationOptions:
    """What configurations tell, and about which parameters."""

    information: Literal["assumed", "measured"] = option(
        "assumed",
        "`assumed`: the same relative error of every response element. `measured`: the responses of the "
        "campaign and their covariance; the campaign is measured or simulated first.",
    )
    assumed_relative_error: float = option(0.03, "Assumed relative standard deviation of each response element.", gt=0)
    model_error: float = option(0.0, "Additional relative model error that measured information allows for.", ge=0)
    between_relative_std: BetweenRelativeStd = group(
        BetweenRelativeStd,
        "Scatter of the parameters between configurations; it limits the information of repeated visits to one "
        "configuration. 0 means no scatter.",
    )
    free: tuple[LogarithmicKind, ...] = option(("stiffness", "damping"), "Kinds of wanted parameters.")
    nuisance: tuple[NuisanceKind, ...] | None = option(
        None,
        "Kinds of nuisance parameters, estimated in each configuration; with `mean: fit` once for all. When "
        "not given: what the fit under `fit` estimates in addition to `free`; without a fit, `viscous`, "
        "`motor_inertia` and `delay`.",
    )
    fixed: tuple[str, ...] = option((), "Names of single parameters that are known, as in a fit.")
    weights: DesignWeights = group(DesignWeights, "Weights of the response's elements.")
    draws: int = option(
        1,
        "Draws of the unknown springs and dampers over which the criterion is averaged; 1 uses the robot "
        "file's values.",
        ge=1,
        le=10_000,
    )
    draw_factor: float = option(1.5, "The draws are log-uniform within this factor.", gt=1)
    draw_seed: int = option(1, "Seed of the draws.", ge=0)

    def along(self, estimated: Sequence[str] | None = None) -> tuple[NuisanceKind, ...]:
        """Returns the kinds that are estimated along, by those that the fit frees which the choice is for, if any."""
        if self.nuisance is not None:
            return self.nuisance
        every = ALONG if estimated is None else estimated
        return tuple(kind for kind in get_args(NuisanceKind) if kind in every and kind not in self.free)


@dataclass(frozen=True)
class CostOptions:
    """What a visit to a configuration costs."""

    cost: Literal["equal", "travel"] = option(
        "equal",
        "Equal for every visit, or the seconds of its experiments and of the way from the campaign's first "
        "configuration.",
    )
    joint_speed_share: float = option(0.3, "Share of the joints' largest speed at which the robot travels.", gt=0, le=1)
