"""Options of a rigid fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from robid.arrays import group, option
from robid.robot.regressor.drives import BaseOptions, RigidOptions

if TYPE_CHECKING:
    from robid.signals.filters import Decimator

EstimatorName = Literal["ordinary", "weighted", "huber", "instruments"]


@dataclass(frozen=True)
class ConsistencyOptions:
    """How bodies are made real."""

    margin: float = option(1e-4, "Smallest eigenvalue of a pseudo-inertia over the body's size.", ge=0)
    pull: float = option(0.03, "Weight of the nominal parameters where no real body has the estimate.", gt=0)


@dataclass(frozen=True)
class HuberOptions:
    """How Huber's estimator weighs its rows."""

    bend: float = option(1.345, "Residual in deviations beyond which a row loses weight.", gt=0)
    covariance: Literal["weighted", "asymptotic"] = option(
        "asymptotic", "Covariance of the weighted rows (eq. 19), or the M-estimator's asymptotic one."
    )
    tolerance: float = option(1e-2, "Step to stop at, in standard deviations of the parameters.", gt=0)
    iteration_limit: int = option(100, "Reweighted fits at most.", ge=1, le=100_000)


@dataclass(frozen=True)
class InstrumentOptions:
    """When instrumental variables have converged."""

    tolerance: float = option(0.05, "Step to stop at, in standard deviations of the parameters.", gt=0)
    iteration_limit: int = option(20, "Simulations at most.", ge=1, le=100_000)


@dataclass(frozen=True)
class PreprocessingOptions:
    """Filters of an inverse-dynamics fit."""

    position_cut_hz: float | None = option(
        None,
        "Cut-off of the positions' low pass [Hz]. When not given, the lowest above the motion's band that "
        "leaves white residuals.",
        gt=0,
    )
    position_order: int = option(4, "Order of one of its two passes.", ge=1, le=20)
    decimation: int = option(0, "Samples per kept sample; 0 keeps twice the cut-off's rate.", ge=0, le=100_000)
    drop_rest: bool = option(
        True,
        "Whether rows of a motor that stands still are dropped, where its friction has a Coulomb term: that takes any "
        "value there. Rows of a motor that hardly moves in the whole record stay.",
    )
    drop_deviations: float = option(
        0.0, "Deviations of the speed's noise below which rows are dropped; 0 keeps all.", ge=0
    )
    drop_below_rad_s: float = option(
        0.0, "Motor speed below which rows are dropped, where friction is not Coulomb's [rad/s]; 0 keeps all.", ge=0
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

    level: float = option(0.02, "Chance of a false alarm of all tests together.", gt=0, lt=1)
    variation: float = option(0.05, "Relative difference of two estimates that matters.", ge=0)
    shape: float = option(0.25, "Skewness, or half the excess kurtosis, that matters.", ge=0)
    correlation: float = option(0.2, "Autocorrelation that matters.", ge=0)
    lags: int = option(10, "Lags of the whiteness test.", ge=1, le=10_000)


@dataclass(frozen=True)
class ConclusionOptions:
    """How rows are fitted and judged."""

    weighted: bool = option(True, "Whether each joint's rows weigh by their residual variance.")
    huber: HuberOptions = field(default_factory=HuberOptions)  # Huber's estimator
    verdict: VerdictOptions = field(default_factory=VerdictOptions)


@dataclass(frozen=True)
class RigidFitOptions:
    """How rigid dynamics and friction are estimated from records."""

    model: RigidOptions = group(RigidOptions, "Parts of the model in addition to its links.")
    filters: PreprocessingOptions = group(PreprocessingOptions, "Filters of positions, torques and columns.")
    estimator: EstimatorName = option(
        "weighted",
        "Estimator of the result: least squares, plain or weighted per joint, Huber's estimator, or "
        "instrumental variables. The others are shown beside it.",
    )
    instruments: Literal["auto", "none"] = option(
        "auto",
        "Whether a simulation of the model in the robot's loop gives the instruments: where controller and "
        "position commands are known (`auto`), or never.",
    )
    gain_std: float | None = option(
        None,
        "Relative prior standard deviation of a gain for each motor, true over recorded torque. It is "
        "estimated from the known `payload` of records with and without it; when not given, torques are used "
        "as recorded.",
        gt=0,
    )
    huber: HuberOptions = group(HuberOptions, "Huber's estimator.")
    sweep: tuple[float, ...] = option((), "Further bends of Huber's estimator, shown beside it.")
    convergence: InstrumentOptions = group(InstrumentOptions, "Convergence of the instrumental variables.")
    base: BaseOptions = group(BaseOptions, "Computation of the base parameters.")
    physical: bool = option(
        True,
        "Whether the fit also finds the standard parameters of real bodies that have the estimated base "
        "parameters and are nearest to the robot file's. They are exported and passed on.",
    )
    consistency: ConsistencyOptions = group(ConsistencyOptions, "Conditions on real bodies.")
    verdict: VerdictOptions = group(VerdictOptions, "Limits of the verdict against least squares.")
    judge: tuple[str, ...] = option(
        (), "Joints whose motors are graded; when not given, all whose torques are more than noise and friction."
    )
    confidence: float = option(0.95, "Level of the intervals.", gt=0, lt=1)
    identifiable_relative_std: float = option(
        0.2, "Predicted relative standard deviation up to which a parameter counts as identifiable.", gt=0
    )
