"""Options of the elastic fit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from robid.frf.residual import RESIDUALS, EstimatorKind, Residual
from robid.robot.parameters import ELASTIC, FREE, ElasticKind

WeightsKind = Literal["user", "optimal", "optimal_full", "inflated", "estimated"]
Optimizer = Literal["levenberg", "scipy", "nlopt", "nlopt_global"]
BY_SPRING: tuple[ElasticKind, ...] = ("stiffness", "damping")
"""Kinds that a spring's name frees of it."""
_COMPLIANCE = ".compliance"


def spring_of(name: str) -> str:
    """Name of the spring that something frees which may end as a doubt of its compliance does."""
    return name.removesuffix(_COMPLIANCE)


@dataclass(frozen=True)
class Weights:
    """Weights of the residual."""

    kind: WeightsKind = field(
        default="inflated",
        metadata={
            "description": "Constant per element; 1/variance; inverse covariance, correlations of a line's elements"
            " included; 1/(variance + model error); the same with the model error that the residuals of each"
            " element show, after a first fit by `inflated`."
        },
    )
    off_diagonal: float = field(
        default=0.3, metadata={"description": "User weight of off-diagonal elements, diagonal is 1.", "ge": 0}
    )
    low_cut_hz: float = field(default=0.0, metadata={"description": "Lines below get no weight [Hz].", "ge": 0})
    model_error: float = field(
        default=0.02,
        metadata={"description": "Relative model error that `inflated` adds, and `estimated` at first.", "ge": 0},
    )


@dataclass(frozen=True)
class ElasticOptions:
    """The elastic fit."""

    estimator: EstimatorKind = field(
        default="lls",
        metadata={"description": "Logarithmic or plain least squares, or logarithmic of magnitudes only."},
    )
    weights: Weights = field(default_factory=Weights, metadata={"description": "Weights of the residual."})
    free: tuple[ElasticKind | str, ...] = field(
        default=FREE,
        metadata={
            "description": f"Kinds of parameters that are estimated ({', '.join(f'`{kind}`' for kind in ELASTIC)}),"
            " and what the robot file may have wrong, by name or group: `payload`, `masses`, `axis_2.mass`,"
            " `axis_2.com`, `gear_coupling`, `torque_constant`, `counterbalance`, `load_damping`, `hysteresis`,"
            " `bearing_axis_2_x`. Where only such doubts are named,"
            " the default kinds are estimated too."
        },
    )
    fixed: tuple[str, ...] = field(
        default=(), metadata={"description": "Names of single parameters that stay at the robot file's value."}
    )
    tied: Mapping[str, str] = field(
        default_factory=dict,
        metadata={
            "description": "Parameters that share the correction of another one of their kind, by name: a common factor"
            " on the robot file's values, for linear kinds a common multiple of their scales."
        },
    )
    bounds: Mapping[str, tuple[float, float]] = field(
        default_factory=dict,
        metadata={"description": "Lower and upper bound of single parameters, by name, in their own units."},
    )
    starts: int = field(
        default=1, metadata={"description": "Number of starts; the first is the robot file's values.", "ge": 1}
    )
    start_decades: float = field(
        default=1.0, metadata={"description": "Further starts are log-uniform within this many decades.", "ge": 0}
    )
    prior_decades: float = field(
        default=1.0,
        metadata={
            "description": "Standard deviation of what the robot file knows of springs, dampers, link inertias"
            " [decades]; that of motor inertias is the file's `inertia_relative_std`.",
            "gt": 0,
        },
    )
    strategy: Literal["staged", "plain"] = field(
        default="staged",
        metadata={
            "description": "From a start to a minimum: over heavier dampers and fewer lines, what ran away put back;"
            " or straight down."
        },
    )
    optimizer: Optimizer = field(
        default="levenberg",
        metadata={
            "description": "What ends each start: ours, scipy's least_squares, nlopt's SLSQP, or nlopt's MLSL over the"
            " bounds before ours."
        },
    )
    correct_torques: bool = field(
        default=True,
        metadata={"description": "Whether the compensated friction and ripple are corrected along, as nuisances."},
    )
    max_iterations: int = field(default=200, metadata={"description": "Iteration limit of one start.", "ge": 1})
    statics: Literal["updates", "every_iterate"] = field(
        default="updates",
        metadata={
            "description": "Whether inertia and gravity stay between updates as they were at rest, or follow the rest"
            " position of every iterate to first order, as they do where locations are free."
        },
    )
    statics_updates: int = field(
        default=4,
        metadata={
            "description": "How often the equilibrium is solved again for the fitted springs, at most; 0 is never.",
            "ge": 0,
        },
    )
    identifiable_relative_std: float = field(
        default=0.2,
        metadata={
            "description": "Predicted relative deviation up to which a parameter counts as identifiable.",
            "gt": 0,
        },
    )
    bootstrap: int = field(
        default=0,
        metadata={
            "description": "Fits repeated on realizations weighted anew, for intervals that assume nothing about how"
            " a realization's errors are correlated; 0 for none.",
            "ge": 0,
        },
    )
    confidence: float = field(default=0.95, metadata={"description": "Level of the intervals.", "gt": 0, "lt": 1})
    seed: int = field(default=1, metadata={"description": "Seed of the starts.", "ge": 0})

    @property
    def kinds(self) -> tuple[ElasticKind, ...]:
        """Kinds of parameters that are estimated."""
        named = sorted((kind for kind in ELASTIC if kind in self.free), key=self.free.index)
        return tuple(named) or (FREE if self.freed else ())

    @property
    def freed(self) -> tuple[str, ...]:
        """Names of doubts that are estimated, or of groups of them."""
        return tuple(dict.fromkeys(name for name in self.free if name not in ELASTIC))

    def frees(self, kind: str, name: str) -> bool:
        """Whether a parameter is of a kind that is free, or of a spring that is freed by its name."""
        by_spring = kind in BY_SPRING and name.removesuffix(f".{kind}") in map(spring_of, self.freed)
        return kind in self.kinds or by_spring

    def estimates(self, kind: str, name: str) -> bool:
        """Whether a parameter is estimated: free and not fixed."""
        return self.frees(kind, name) and name not in self.fixed

    @property
    def residual(self) -> Residual:
        """How the estimator compares responses."""
        return RESIDUALS[self.estimator]
