"""Options of a rigid fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from robid.robot.regressor.drives import BaseOptions, RigidOptions

if TYPE_CHECKING:
    from robid.signals.filters import Decimator

EstimatorName = Literal["ordinary", "weighted", "huber", "instruments"]


@dataclass(frozen=True)
class ConsistencyOptions:
    """How bodies are made real."""

    margin: float = field(
        default=1e-4,
        metadata={"description": "Smallest eigenvalue of a pseudo-inertia over the body's size.", "ge": 0},
    )
    pull: float = field(
        default=0.03,
        metadata={"description": "Weight of the nominal parameters where no real body has the estimate.", "gt": 0},
    )


@dataclass(frozen=True)
class HuberOptions:
    """How Huber's estimator weighs its rows."""

    bend: float = field(
        default=1.345, metadata={"description": "Residual in deviations beyond which a row loses weight.", "gt": 0}
    )
    covariance: Literal["weighted", "asymptotic"] = field(
        default="asymptotic",
        metadata={"description": "Covariance of the weighted rows (eq. 19), or the M-estimator's asymptotic one."},
    )
    tolerance: float = field(
        default=1e-2, metadata={"description": "Step to stop at, in standard deviations of the parameters.", "gt": 0}
    )
    iteration_limit: int = field(default=100, metadata={"description": "Reweighted fits at most.", "ge": 1})


@dataclass(frozen=True)
class InstrumentOptions:
    """When instrumental variables have converged."""

    tolerance: float = field(
        default=0.05, metadata={"description": "Step to stop at, in standard deviations of the parameters.", "gt": 0}
    )
    iteration_limit: int = field(default=20, metadata={"description": "Simulations at most.", "ge": 1})


@dataclass(frozen=True)
class PreprocessingOptions:
    """Filters of an inverse-dynamics fit."""

    position_cut_hz: float | None = field(
        default=None,
        metadata={
            "description": "Cut-off of the positions' low pass [Hz]; when not given the lowest above the motion's band"
            " that leaves white residuals.",
            "gt": 0,
        },
    )
    position_order: int = field(default=4, metadata={"description": "Order of one of its two passes.", "ge": 1})
    decimation: int = field(
        default=0, metadata={"description": "Samples per kept sample; 0 keeps twice the cut-off's rate.", "ge": 0}
    )
    drop_deviations: float = field(
        default=0.0,
        metadata={"description": "Deviations of the speed's noise below which rows are dropped; 0 keeps all.", "ge": 0},
    )
    drop_below_rad_s: float = field(
        default=0.0,
        metadata={
            "description": "Motor speed below which rows are dropped, where friction is not Coulomb's [rad/s]; 0 keeps"
            " all.",
            "ge": 0,
        },
    )

    @property
    def cut_hz(self) -> float:
        """The cut-off, once it is known [Hz]."""
        if self.position_cut_hz is None:
            message = "the cut-off is to be chosen from the data first"
            raise ValueError(message)
        return self.position_cut_hz

    def decimator(self, sampling_period_s: float) -> Decimator:
        """Designs the filter that torques and columns pass."""
        from robid.signals.filters import design_decimator

        twice = round(1 / (2 * self.cut_hz * sampling_period_s))
        return design_decimator(self.decimation or max(1, twice))


@dataclass(frozen=True)
class VerdictOptions:
    """When the verdict speaks against least squares."""

    level: float = field(
        default=0.02, metadata={"description": "Chance of a false alarm of all tests together.", "gt": 0, "lt": 1}
    )
    variation: float = field(
        default=0.05, metadata={"description": "Relative difference of two estimates that matters.", "ge": 0}
    )
    shape: float = field(
        default=0.25, metadata={"description": "Skewness, or half the excess kurtosis, that matters.", "ge": 0}
    )
    correlation: float = field(default=0.2, metadata={"description": "Autocorrelation that matters.", "ge": 0})
    lags: int = field(default=10, metadata={"description": "Lags of the whiteness test.", "ge": 1})


@dataclass(frozen=True)
class ConclusionOptions:
    """How rows are fitted and judged."""

    weighted: bool = field(
        default=True, metadata={"description": "Whether each joint's rows weigh by their residual variance."}
    )
    huber: HuberOptions = field(default_factory=HuberOptions)  # Huber's estimator
    verdict: VerdictOptions = field(default_factory=VerdictOptions)


@dataclass(frozen=True)
class RigidFitOptions:
    """How rigid dynamics and friction are estimated from records."""

    model: RigidOptions = field(
        default_factory=RigidOptions, metadata={"description": "What the model has beside its links."}
    )
    filters: PreprocessingOptions = field(
        default_factory=PreprocessingOptions, metadata={"description": "Filters of positions, torques and columns."}
    )
    estimator: EstimatorName = field(
        default="weighted",
        metadata={
            "description": "Whose values and intervals are the result: least squares, plain or weighted per joint,"
            " Huber's estimator, or instrumental variables; the others are shown beside it."
        },
    )
    instruments: Literal["auto", "none"] = field(
        default="auto",
        metadata={
            "description": "Whether the model is simulated in the robot's loop as instrument: where controller and"
            " position commands are known (`auto`), or never."
        },
    )
    huber: HuberOptions = field(default_factory=HuberOptions, metadata={"description": "Huber's estimator."})
    sweep: tuple[float, ...] = field(
        default=(), metadata={"description": "Further bends of Huber's estimator, to be shown beside it."}
    )
    convergence: InstrumentOptions = field(
        default_factory=InstrumentOptions, metadata={"description": "Convergence of the instrumental variables."}
    )
    base: BaseOptions = field(default_factory=BaseOptions, metadata={"description": "How base parameters are found."})
    physical: bool = field(
        default=True,
        metadata={
            "description": "Whether the standard parameters of real bodies nearest to the robot file's are found, with"
            " the estimated base parameters; they are what is exported and handed on."
        },
    )
    consistency: ConsistencyOptions = field(
        default_factory=ConsistencyOptions, metadata={"description": "How bodies are made real."}
    )
    verdict: VerdictOptions = field(
        default_factory=VerdictOptions, metadata={"description": "When the verdict speaks against least squares."}
    )
    confidence: float = field(default=0.95, metadata={"description": "Level of the intervals.", "gt": 0, "lt": 1})
    identifiable_relative_std: float = field(
        default=0.2,
        metadata={
            "description": "Predicted relative standard deviation up to which a parameter counts as identifiable.",
            "gt": 0,
        },
    )
