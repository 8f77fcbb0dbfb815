"""What a rigid fit returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.results.estimate import Estimate


@dataclass(frozen=True)
class Base:
    """What the parameters of a rigid fit are: combinations of standard parameters.

    Attributes:
        labels: Each as its combination, such as `joint_1.ZZ + joint_2.YY`.
        standard: Names (n_std) of the standard parameters.
        combination (n_base, n_std): The base parameters are `combination @ standard`.
        silent: Standard parameters without any effect.
        mixed: Those that are known only together with others.
        gap: Smallest singular value that counts over the largest one that does not, of the model alone.
        condition: Condition number of the weighted rows' columns, each of norm 1.
        unscaled_condition: The same of the columns as they are.
    """

    labels: tuple[str, ...]
    standard: tuple[str, ...]
    combination: FloatArray
    silent: tuple[str, ...]
    mixed: tuple[str, ...]
    gap: float
    condition: float
    unscaled_condition: float


@dataclass(frozen=True)
class Estimators:
    """Several estimators beside each other.

    Attributes:
        names: `ordinary`, `weighted`, `huber` and, where the loop is known, `instruments`.
        values (n_estimator, n_base): Their estimates.
        std (n_estimator, n_base): Deviations by their own formulas, as if residuals were independent.
        deviation (n_estimator, n_joint): Standard deviation of each joint's residual [N m].
        iterations (n_estimator,): Passes that they took.
        status: How they ended.
        bends (n_bend,): Bends `H` of Huber's estimator that were swept.
        bent (n_bend, n_base): Estimates at these.
    """

    names: tuple[str, ...]
    values: FloatArray
    std: FloatArray
    deviation: FloatArray
    iterations: IntArray
    status: tuple[str, ...]
    bends: FloatArray
    bent: FloatArray


@dataclass(frozen=True)
class Checks:
    """The verdict on least squares, and what it rests on.

    Attributes:
        trust: Whether least squares is to be trusted.
        sentence: The verdict in words, with what to do.
        huber_variation (n_base,): Relative difference from Huber's estimate (eq. 22).
        huber_p (n_base,): Chance of it.
        instrument_variation (n_base,): The same from the instrumental variables; None without.
        instrument_p (n_base,): Chance of it.
        skewness (n_joint,): Of the residuals.
        excess_kurtosis (n_joint,): Of the residuals.
        outlier_share (n_joint,): Share of the residuals beyond three deviations.
        normality_p (n_joint,): Chance of a Gaussian to look as odd.
        correlation (n_joint, n_lag): Autocorrelation at lags 1 and on, less the filter's own.
        whiteness_p (n_joint,): Chance of white torque noise to look as correlated.
        odd: Whether residuals are far from a Gaussian.
        coloured: Whether residuals are far from white.
        huber_differs: Whether Huber's estimate differs by more than chance and by more than matters.
        instruments_differ: The same of the instrumental variables.
        untested: Whether a joint has too few rows for the tests of its residuals.
    """

    trust: bool
    sentence: str
    huber_variation: FloatArray
    huber_p: FloatArray
    instrument_variation: FloatArray | None
    instrument_p: FloatArray | None
    skewness: FloatArray
    excess_kurtosis: FloatArray
    outlier_share: FloatArray
    normality_p: FloatArray
    correlation: FloatArray
    whiteness_p: FloatArray
    odd: bool
    coloured: bool
    huber_differs: bool
    instruments_differ: bool
    untested: bool


@dataclass(frozen=True)
class Filtered:
    """How the record was filtered, and why.

    Attributes:
        cut_hz: Cut-off of the positions' low pass [Hz].
        decimation: Samples per row.
        sampling_period_s: Period of the samples [s].
        excited_hz (n_joint,): Frequency below which 99 % of each joint's acceleration lies [Hz].
        trial_hz (n_trial,): Cut-offs that were tried; none where one was stated.
        trial_correlation (n_trial, n_joint): Correlation of the residuals that each left.
        white: Whether the chosen one leaves white residuals.
    """

    cut_hz: float
    decimation: int
    sampling_period_s: float
    excited_hz: FloatArray
    trial_hz: FloatArray
    trial_correlation: FloatArray
    white: bool


@dataclass(frozen=True)
class RowResiduals:
    """Torques row by row, NaN where a row does not count.

    Attributes:
        time_s (n_row,): Time of each row from the beginning, shots after each other [s].
        torque (n_row, n_joint): Filtered torque [N m].
        residual (n_row, n_joint): What least squares leaves of it [N m].
        weight (n_row, n_joint): Huber's weight.
    """

    time_s: FloatArray
    torque: FloatArray
    residual: FloatArray
    weight: FloatArray

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

    Attributes:
        share (n_joint,): Norm of the estimated ones over that of the measured torque.
        ratio (n_joint,): Norm of the estimated ones over that of the robot file's; NaN where either has none.
        likeness (n_joint,): Their correlation: 1 where they differ by a factor alone.
        whole_ratio (n_joint,): The same as `ratio`, of links and motors together.
    """

    share: FloatArray
    ratio: FloatArray
    likeness: FloatArray
    whole_ratio: FloatArray


@dataclass(frozen=True)
class Travel:
    """Where the arm was during the fit's record, and where it may be.

    Attributes:
        shot (n_moment,): Shot of each of the moments that were kept.
        time_s (n_moment,): Their time since the shot began [s].
        position (n_moment, n_joint): Arm positions then [rad, or m].
        lowest (n_joint,): Lowest position of the whole record [rad, or m].
        highest (n_joint,): Highest one.
        lower_limit (n_joint,): The robot file's limits [rad, or m].
        upper_limit (n_joint,): The same above.
    """

    shot: IntArray
    time_s: FloatArray
    position: FloatArray
    lowest: FloatArray
    highest: FloatArray
    lower_limit: FloatArray
    upper_limit: FloatArray


@dataclass(frozen=True)
class StandardSet:
    """Standard parameters of real bodies, nearest to the robot file's, with the estimated base parameters.

    Attributes:
        names: Their names.
        units: Their units.
        nominal (n_std,): Values of the robot file.
        value (n_std,): The values.
        covariance (n_std, n_std): Their covariance by what was estimated; what was not stays as the file has it.
        moved (n_base,): How far the base parameters had to move, in standard deviations.
        real (n_body,): Which of the file's bodies are real ones.
        status: `estimated`, `moved` or `failed`.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    nominal: FloatArray
    value: FloatArray
    covariance: FloatArray
    moved: FloatArray
    real: BoolArray
    status: str


@dataclass(frozen=True)
class RigidSolution:
    """Estimated base parameters of a rigid model, and how far they are to be trusted.

    Attributes:
        estimate: The base parameters by the chosen estimator.
        base: What they are.
        estimators: Several estimators beside each other.
        checks: The verdict on least squares.
        filtered: How the record was filtered.
        residuals: Torques and residuals row by row.
        against_nominal: Torques of the links beside those of the robot file's.
        travel: Where the arm was.
        standard: The standard parameters of real bodies that are handed on; None where none were found.
        chosen: Name of the estimator whose result it is.
        torque_unit: What stands for N m: A where torques are currents.
    """

    estimate: Estimate
    base: Base
    estimators: Estimators
    checks: Checks
    filtered: Filtered
    residuals: RowResiduals
    against_nominal: NominalTorques
    travel: Travel
    standard: StandardSet | None
    chosen: str
    torque_unit: str = "N m"
