"""What a fit of gears found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray, Quantity
from robid.results.estimate import Estimate


@dataclass(frozen=True)
class Bodies:
    """Standard parameters of links and motors that the loads of the gears were computed with."""

    names: Annotated[tuple[str, ...], Quantity("1", "standard")]
    value: Annotated[FloatArray, Quantity("as in the rigid model", "standard", "Their values")]
    directions: Annotated[
        FloatArray, Quantity("as in the rigid model", "standard direction", "Independent errors of one deviation each")
    ]


@dataclass(frozen=True)
class Rows:
    """What was fitted, row by row."""

    time_s: Annotated[FloatArray, Quantity("s", "row", "Time since its motion began")]
    motion: Annotated[IntArray, Quantity("1", "row", "Index of the motion")]
    torque: Annotated[FloatArray, Quantity("N m, or N", "row gear", "Torque behind the gear", compact=True)]
    measured: Annotated[FloatArray, Quantity("rad, or m", "row gear", "Encoders' difference, their lag taken out")]
    model: Annotated[FloatArray, Quantity("rad, or m", "row gear", "The model's")]
    deflection: Annotated[FloatArray, Quantity("rad, or m", "row gear", "The part of it that the gear's law gives")]


@dataclass(frozen=True)
class Loops:
    """Torque over deflection as gear makers measure it, computed from the fitted laws."""

    torque: Annotated[FloatArray, Quantity("N m, or N", "loop gear", "Torque, from minus the rated one and back")]
    deflection: Annotated[FloatArray, Quantity("rad, or m", "loop gear", "Deflection")]


@dataclass(frozen=True)
class TransmissionSolution:
    """Gears of some joints, with what is known of them only together."""

    estimate: Estimate
    joints: Annotated[tuple[str, ...], Quantity("1", "gear", "Joint of each gear")]
    springs: Annotated[tuple[str, ...], Quantity("1", "gear", "Name of its transmission in the robot file")]
    motions: Annotated[tuple[str, ...], Quantity("1", "motion", "Name of each motion")]
    sampling_period_s: float
    rated: Annotated[FloatArray, Quantity("N m, or N", "gear", "Rated torque at which lost motion is measured")]
    rated_stated: Annotated[BoolArray, Quantity("1", "gear", "Whether it is stated; else the largest in the records")]
    reached: Annotated[FloatArray, Quantity("N m, or N", "gear", "Largest torque in the records, from their mean")]
    lag_s: Annotated[FloatArray, Quantity("s", "gear", "Lag of the encoders, viscous friction behind the gear with it")]
    lag_std_s: Annotated[FloatArray, Quantity("s", "gear", "Its standard deviation")]
    damping_s: Annotated[FloatArray, Quantity("s", "gear", "Damping over stiffness with the lag of the torque")]
    damping_std_s: Annotated[FloatArray, Quantity("s", "gear", "Its standard deviation")]
    loop: Annotated[FloatArray, Quantity("rad, or m", "gear", "Loop at zero torque with friction behind the gear")]
    loop_std: Annotated[FloatArray, Quantity("rad, or m", "gear", "Its standard deviation")]
    share: Annotated[FloatArray, Quantity("1", "gear", "Share of the motor's friction that acts behind the gear")]
    share_std: Annotated[FloatArray, Quantity("1", "gear", "Its standard deviation")]
    by_motion: Annotated[FloatArray, Quantity("N m/rad, or N/m", "gear motion", "Stiffness by each motion alone")]
    by_motion_std: Annotated[FloatArray, Quantity("1", "gear motion", "Relative deviation without what they share")]
    agreement: Annotated[FloatArray, Quantity("1", "gear", "Probability of such differences between motions")]
    between: Annotated[FloatArray, Quantity("1", "gear", "Relative deviation between motions beyond that")]
    residual: Annotated[FloatArray, Quantity("rad, or m", "gear", "Root mean square of what the model leaves")]
    size: Annotated[FloatArray, Quantity("rad, or m", "gear", "Root mean square of the deflection about its mean")]
    unexplained: Annotated[FloatArray, Quantity("1", "gear", "What bodies and friction leave of the motor's torque")]
    gain: Annotated[FloatArray, Quantity("1", "gear", "What recorded motor torques were multiplied by")]
    torque_ratio: Annotated[FloatArray, Quantity("1", "gear", "Recorded motor torques over those of the robot file")]
    own_names: Annotated[tuple[str, ...], Quantity("1", "own", "Names of the laws' own parameters")]
    values: Annotated[FloatArray, Quantity("1", "gear own", "Their values, related to guess and largest")]
    values_covariance: Annotated[FloatArray, Quantity("1", "gear own own", "Their covariance")]
    guess: Annotated[FloatArray, Quantity("N m/rad, or N/m", "gear", "Stiffness that they are related to")]
    largest: Annotated[FloatArray, Quantity("N m, or N", "gear", "Torque that they are related to")]
    bodies: Bodies
    rows: Rows
    loops: Loops

    @property
    def determined(self) -> BoolArray:
        """Which gears (n_gear,) have a stiffness that is identified."""
        at = [self.estimate.names.index(f"{spring}.stiffness") for spring in self.springs]
        return np.asarray(self.estimate.identified[at])
