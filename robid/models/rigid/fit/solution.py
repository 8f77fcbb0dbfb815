"""What a rigid fit returns."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from scipy.stats import t as student

from robid.arrays import BoolArray, FloatArray, IntArray, Quantity
from robid.models.rigid.fit.alone import Alone
from robid.results.estimate import Estimate

_TORQUE = "N m, or the drives' unit"


def no_rows() -> IntArray:
    """What stands for the records of rows in files that do not say them."""
    return np.zeros(0, int)


@dataclass(frozen=True)
class Base:
    """What the parameters of a rigid fit are: combinations of standard parameters."""

    # Each as its combination, such as `joint_1.ZZ + joint_2.YY`.
    labels: Annotated[tuple[str, ...], Quantity("1", "parameter", "Each base parameter as its combination")]
    standard: Annotated[tuple[str, ...], Quantity("1", "standard", "Names of the standard parameters")]
    combination: Annotated[
        FloatArray, Quantity("units over units", "parameter standard", "Base parameters of standard ones")
    ]
    silent: Annotated[tuple[str, ...], Quantity("1", "silent", "Standard parameters without any effect")]
    mixed: Annotated[tuple[str, ...], Quantity("1", "mixed", "Standard parameters known only together with others")]
    gap: float  # smallest singular value that counts over the largest one that does not, of the model alone
    condition: float  # condition number of the weighted rows' columns, each of norm 1
    unscaled_condition: float  # the same of the columns as they are
    rests_on: Annotated[IntArray, Quantity("1", "parameter", "Index of the motor whose torque tells most of it")]


@dataclass(frozen=True)
class Estimators:
    """Several estimators beside each other."""

    # `ordinary`, `weighted`, `huber` and, where the loop is known, `instruments`.
    names: Annotated[tuple[str, ...], Quantity("1", "estimator")]
    values: Annotated[FloatArray, Quantity("as in units", "estimator parameter", "Estimates")]
    std: Annotated[FloatArray, Quantity("as in units", "estimator parameter", "As if residuals were independent")]
    deviation: Annotated[FloatArray, Quantity(_TORQUE, "estimator joint", "Deviation of the residuals")]
    iterations: Annotated[IntArray, Quantity("1", "estimator", "Passes")]
    status: Annotated[tuple[str, ...], Quantity("1", "estimator", "How they ended")]
    bends: Annotated[FloatArray, Quantity("1", "bend", "Bends of Huber's estimator")]
    bent: Annotated[FloatArray, Quantity("as in units", "bend parameter", "Huber's estimates at these")]


@dataclass(frozen=True)
class Checks:
    """The verdict on least squares, and what it rests on; NaN of a joint with too few rows for a test."""

    trust: bool  # whether least squares is to be trusted
    sentence: str  # what the tests found, in words, with what to do
    huber_variation: Annotated[FloatArray, Quantity("1", "parameter", "Relative difference from Huber's estimate")]
    huber_p: Annotated[FloatArray, Quantity("1", "parameter", "Chance of it")]
    instrument_variation: Annotated[
        FloatArray | None, Quantity("1", "parameter", "Relative difference from instrumental variables")
    ]
    instrument_p: Annotated[FloatArray | None, Quantity("1", "parameter", "Chance of it")]
    skewness: Annotated[FloatArray, Quantity("1", "joint", "Of the residuals")]
    excess_kurtosis: Annotated[FloatArray, Quantity("1", "joint", "Of the residuals")]
    outlier_share: Annotated[FloatArray, Quantity("1", "joint", "Share beyond three deviations")]
    normality_p: Annotated[FloatArray, Quantity("1", "joint", "Chance of a Gaussian to look as odd")]
    correlation: Annotated[FloatArray, Quantity("1", "joint lag", "Autocorrelation, less the filter's own")]
    whiteness_p: Annotated[FloatArray, Quantity("1", "joint", "Chance of white noise to look as correlated")]
    odd: bool  # whether residuals are far from a Gaussian
    coloured: bool  # whether residuals are far from white
    huber_differs: bool  # whether Huber's estimate differs by more than chance and by more than matters
    instruments_differ: bool  # the same of the instrumental variables
    untested: bool  # whether a joint has too few rows for the tests of its residuals


@dataclass(frozen=True)
class Filtered:
    """How the record was filtered, and why."""

    cut_hz: float  # cut-off of the positions' low pass [Hz]
    decimation: int  # samples per row
    sampling_period_s: float  # period of the samples [s]
    motion_hz: Annotated[FloatArray, Quantity("Hz", "joint", "Below it lies 99 % of the power of the speed")]
    band_hz: float  # band of positions and torques in which cut-offs were compared; NaN where none were [Hz]
    trial_hz: Annotated[FloatArray, Quantity("Hz", "trial", "Cut-offs that were tried")]
    trial_error: Annotated[
        FloatArray, Quantity("1", "trial", "Error on left-out pieces over the torque, all motors alike (RMS)")
    ]
    # Standard error of the difference of its square from the smallest one's.
    trial_deviation: Annotated[FloatArray, Quantity("1", "trial", "Standard error of its square")]


@dataclass(frozen=True)
class RowResiduals:
    """Torques row by row, NaN where a row does not count."""

    time_s: Annotated[FloatArray, Quantity("s", "row", "Time, shots after each other")]
    torque: Annotated[FloatArray, Quantity(_TORQUE, "row joint", "Filtered torque", compact=True)]
    residual: Annotated[FloatArray, Quantity(_TORQUE, "row joint", "What the estimator leaves", compact=True)]
    weight: Annotated[FloatArray, Quantity("1", "row joint", "Huber's weight", compact=True)]
    shot: Annotated[IntArray, Quantity("1", "row", "Index of the record that each row is of")] = field(
        default_factory=no_rows
    )
    shots: Annotated[tuple[str, ...], Quantity("1", "shot", "Name of each record")] = ()

    @property
    def relative_error(self) -> FloatArray:
        """Norm of the residual over that of the torque (n_joint,)."""
        return np.asarray(np.sqrt(np.nansum(self.residual**2, axis=0) / np.nansum(self.torque**2, axis=0)))

    @property
    def total_error(self) -> float:
        """Norm of the residual over that of the torque, all joints together."""
        return float(np.sqrt(np.nansum(self.residual**2) / np.nansum(self.torque**2)))


@dataclass(frozen=True)
class NominalTorques:
    """Torques of the estimated links beside those of the robot file's, without motors, friction and offsets.

    What compares the two is NaN where either has no torque.
    """

    share: Annotated[FloatArray, Quantity("1", "joint", "Torque of the links over the measured one")]
    # Norm of the estimated ones over that of the robot file's
    ratio: Annotated[FloatArray, Quantity("1", "joint", "The same over that by the robot file")]
    likeness: Annotated[FloatArray, Quantity("1", "joint", "Correlation of these two")]
    whole_ratio: Annotated[FloatArray, Quantity("1", "joint", "The ratio of links and motors together")]


@dataclass(frozen=True)
class ExpectedError:
    """Errors of torques on other motions, each motor's over max(its RMS torque, a tenth of its rated torque)."""

    error: Annotated[FloatArray, Quantity("1", "joint", "Expected error on other motions of the robot, RMS")]
    bound: Annotated[FloatArray, Quantity("1", "joint", "What 95 % of these errors stay below")]
    # By pieces of the fit's own log that were left out; NaN where it is too short for that.
    left_out: Annotated[FloatArray, Quantity("1", "joint", "Error on left-out pieces of the fit's own log")]
    residual: Annotated[FloatArray, Quantity("1", "joint", "Residual of the fit's own log")]
    rated: Annotated[FloatArray, Quantity(_TORQUE, "joint", "Rated torque")]
    stated: Annotated[BoolArray, Quantity("1", "joint", "Whether the robot file states it")]


@dataclass(frozen=True)
class Travel:
    """Where the arm was during the fit's record, and where it may be."""

    shot: Annotated[IntArray, Quantity("1", "moment", "Shot of each moment")]
    time_s: Annotated[FloatArray, Quantity("s", "moment", "Time since the shot began")]
    position: Annotated[FloatArray, Quantity("rad, or m", "moment joint", "Arm positions at some moments")]
    lowest: Annotated[FloatArray, Quantity("rad, or m", "joint", "Lowest arm position of the record")]
    highest: Annotated[FloatArray, Quantity("rad, or m", "joint", "Highest one")]
    fastest: Annotated[FloatArray, Quantity("rad/s, or m/s", "joint", "Highest arm speed of the record")]
    lower_limit: Annotated[FloatArray, Quantity("rad, or m", "joint", "The robot file's limit below")]
    upper_limit: Annotated[FloatArray, Quantity("rad, or m", "joint", "The same above")]


@dataclass(frozen=True)
class StandardSet:
    """Standard parameters of real bodies, nearest to the robot file's, with the estimated base parameters."""

    names: Annotated[tuple[str, ...], Quantity("1", "standard")]
    units: Annotated[tuple[str, ...], Quantity("1", "standard")]
    nominal: Annotated[FloatArray, Quantity("as in units", "standard", "Values of the robot file")]
    value: Annotated[FloatArray, Quantity("as in units", "standard", "Nearest real bodies with the base parameters")]
    covariance: Annotated[FloatArray, Quantity("products of units", "standard standard", "By what was estimated")]
    moved: Annotated[FloatArray, Quantity("1", "parameter", "How far base parameters moved, in deviations")]
    real: Annotated[BoolArray, Quantity("1", "body", "Which of the robot file's bodies are real ones")]
    status: str  # `estimated`, `moved` or `failed`


@dataclass(frozen=True)
class Gains:
    """What each motor's true torque is over its recorded one."""

    gain: Annotated[FloatArray, Quantity("1", "joint", "True torque over the recorded one")]
    covariance: Annotated[FloatArray, Quantity("1", "joint joint", "Of the gains")]
    # Whether the load tells it; the others are the prior's for the most part.
    determined: Annotated[BoolArray, Quantity("1", "joint", "Whether the known load tells it")]
    freedom: float  # degrees of freedom of the variances

    @property
    def deviation(self) -> FloatArray:
        """Standard deviation (n_joint,) of each gain."""
        return np.sqrt(np.diag(self.covariance))

    def half_width(self, level: float) -> FloatArray:
        """Returns half the width (n_joint,) of the gains' intervals of a level."""
        return np.asarray(student.ppf(0.5 + level / 2, self.freedom) * self.deviation)

    @property
    def relative_covariance(self) -> FloatArray:
        """Covariance (n_joint, n_joint) of the gains, each over itself."""
        return np.asarray(self.covariance / np.outer(self.gain, self.gain))


@dataclass(frozen=True)
class RigidSolution:
    """Estimated base parameters of a rigid model, and how far they are to be trusted."""

    estimate: Estimate  # the base parameters by the chosen estimator
    base: Base  # what they are
    estimators: Estimators  # several estimators beside each other
    checks: Checks  # the verdict on least squares
    filtered: Filtered  # how the record was filtered
    residuals: RowResiduals  # torques and residuals row by row
    against_nominal: NominalTorques  # torques of the links beside those of the robot file's
    travel: Travel  # where the arm was
    expected: ExpectedError  # errors of torques to be expected on other motions
    # The standard parameters of real bodies that are handed on; None where none were found.
    standard: StandardSet | None
    chosen: str  # name of the estimator whose result it is
    torque_unit: str = "N m"  # what stands for N m: A where torques are currents
    gains: Gains | None = None  # what the torques were multiplied by; None where they are as recorded
    alone: Alone | None = None  # what explains torques apart from the model; None in files that do not say it
