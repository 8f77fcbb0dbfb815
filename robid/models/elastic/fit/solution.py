"""What an elastic fit returns, and the robot that it found: the robot file with its estimates in place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
from scipy.stats import norm, t

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray, Quantity
from robid.clusters.pooling import ALONE
from robid.models.elastic.fit.model_error import ModelError
from robid.models.elastic.fit.nuisance.effects import moved_robot
from robid.models.elastic.fit.nuisance.listing import estimable_nuisances
from robid.results.estimate import Estimate
from robid.robot.description import Inertial, Joint, Motor, Robot, Spring
from robid.robot.parameters import NUISANCE_KIND, PARAMETER_KINDS

_RESPONSE = "configuration frequency output input"


@dataclass(frozen=True)
class Internal:
    """Where the optimizer ended, in its own coordinates."""

    values: Annotated[FloatArray, Quantity("1", "parameter", "Optimizer's values")]
    # Covariance of those that predict other clusters, without any quantile
    covariance: Annotated[FloatArray, Quantity("1", "parameter parameter", "Covariance of those that predict")]
    singular_values: Annotated[FloatArray, Quantity("1", "parameter", "Of the scaled information matrix")]
    degrees_of_freedom: Annotated[
        FloatArray | None, Quantity("1", "parameter", "Of the Student distribution that goes with it")
    ] = None


@dataclass(frozen=True)
class Costs:
    """Costs at the minimum."""

    total: float  # Cost at the minimum
    configuration: Annotated[FloatArray, Quantity("1", "configuration", "Cost of each configuration")]
    expected: Annotated[FloatArray, Quantity("1", "configuration", "Cost that the response's covariance alone gives")]
    dropped: int  # Response elements below 10 dB that the logarithm dropped
    told: int  # Response elements that their lines tell of, those included


@dataclass(frozen=True)
class Starts:
    """Where the starts of a fit ended."""

    cost: Annotated[FloatArray, Quantity("1", "start", "Cost that each start ended at")]
    iterations: Annotated[IntArray, Quantity("1", "start", "Iterations of each start")]
    evaluations: Annotated[IntArray, Quantity("1", "start", "Points at which each start computed the cost")]
    status: Annotated[tuple[str, ...], Quantity("1", "start", "How each start ended")]
    minimum: Annotated[IntArray, Quantity("1", "start", "Which distinct minimum it ended in, 0 is the best")]

    @property
    def cap_share(self) -> float:
        """Share of the starts that the iteration limit ended."""
        return self.status.count("iteration_limit") / len(self.status)


@dataclass(frozen=True)
class Responses:
    """What was fitted."""

    configurations: Annotated[FloatArray, Quantity("rad", "configuration joint", "Arm-side joint angles of the fit")]
    frequency_hz: Annotated[FloatArray, Quantity("Hz", "frequency", "Frequencies of the fit")]
    measured: Annotated[
        ComplexArray, Quantity("rad/s^2 per torque", _RESPONSE, "Response after the fitted friction compensation")
    ]
    modelled: Annotated[ComplexArray, Quantity("rad/s^2 per torque", _RESPONSE, "Parametric response")]


@dataclass(frozen=True)
class Resampled:
    """What repeated fits say of the parameters' uncertainty."""

    relative_std: Annotated[FloatArray, Quantity("1", "parameter", "Relative deviation from repeated fits")]
    lower: Annotated[FloatArray, Quantity("as in units", "parameter", "Lower end of the bootstrap's interval")]
    upper: Annotated[FloatArray, Quantity("as in units", "parameter", "Upper end of the bootstrap's interval")]


@dataclass(frozen=True)
class Between:
    """How much the internal parameters differ between clusters, and what each cluster says of them."""

    between_std: Annotated[
        FloatArray, Quantity("1", "parameter", "Deviation of the optimizer's values between clusters")
    ]
    degrees_of_freedom: Annotated[FloatArray, Quantity("1", "parameter", "Of what clusters really differ by")]
    dependence: Annotated[
        FloatArray, Quantity("1", "parameter", "Share of the information that a single cluster gives")
    ]

    @property
    def untested(self) -> BoolArray:
        """Which parameters (n_param,) a single cluster knows, so that the others do not test them."""
        return np.asarray(self.dependence > ALONE)


@dataclass(frozen=True)
class NuisanceEstimates:
    """What a fit says of what its robot file may have wrong, to first order."""

    names: Annotated[tuple[str, ...], Quantity("1", "doubt", "What the robot file may have wrong")]
    causes: Annotated[tuple[str, ...], Quantity("1", "doubt", "Likely cause that it stands for")]
    units: Annotated[tuple[str, ...], Quantity("1", "doubt", "Unit of its amounts")]
    prior_std: Annotated[
        FloatArray, Quantity("as in units", "doubt", "Deviation known beforehand, alike in all clusters")
    ]
    place_std: Annotated[FloatArray, Quantity("as in units", "doubt", "Deviation of what each cluster adds")]
    value: Annotated[FloatArray, Quantity("as in units", "doubt", "Estimated amount, zero where the file is right")]
    half_width: Annotated[FloatArray, Quantity("as in units", "doubt", "Half width of its interval")]
    # What its amount moves the middle of each internal parameter by; None in files of old
    moves: Annotated[
        FloatArray | None, Quantity("1", "parameter doubt", "What each amount moves each parameter's middle by")
    ] = None


@dataclass(frozen=True)
class Detectable:
    """How large a defect a fit's residual would have shown, to first order."""

    names: Annotated[tuple[str, ...], Quantity("1", "defect", "What may be wrong")]
    causes: Annotated[tuple[str, ...], Quantity("1", "defect", "Likely cause that it stands for")]
    units: Annotated[tuple[str, ...], Quantity("1", "defect", "Unit of its amounts")]
    lower: Annotated[FloatArray, Quantity("as in units", "defect", "Least amount, by what is known beforehand")]
    upper: Annotated[FloatArray, Quantity("as in units", "defect", "Largest amount, by what is known beforehand")]
    amount: Annotated[
        FloatArray, Quantity("as in units", "defect", "Smallest amount shown with a power of 80 %; infinite if none is")
    ]
    moves: Annotated[
        FloatArray, Quantity("1", "parameter, defect", "What an amount of one moves each parameter by, internal")
    ]
    asked: Annotated[
        FloatArray, Quantity("as in units", "defect", "Amount by which each alone would explain most of the residual")
    ]
    gain: Annotated[
        FloatArray, Quantity("1", "defect", "Cost that this saves, over what a random column saves of it in the mean")
    ]


@dataclass(frozen=True)
class GearsAlone:
    """What gears alone may be: what lies in line with them is part of the value that a fit gives them.

    No response tells the two apart, so this rests on what is known beforehand of the share of the compliance that is
    not the gear's.
    """

    names: Annotated[tuple[str, ...], Quantity("1", "gear", "Parameters that are a gear with what lies in line")]
    share_std: Annotated[FloatArray, Quantity("1", "gear", "Deviation of that share, known beforehand")]
    value: Annotated[FloatArray, Quantity("as of estimate/units", "gear", "Stiffness of the gear alone")]
    lower: Annotated[FloatArray, Quantity("as of estimate/units", "gear", "Lower end of its interval")]
    upper: Annotated[FloatArray, Quantity("as of estimate/units", "gear", "Upper end of its interval")]


LONGEST_STEP = 0.5
"""Of an internal parameter; beyond, nothing is linear, and what is known no better stays."""
LEARNT_SHARE = 0.5
"""Of what was known of a parameter beforehand, as much may stay unknown."""


@dataclass(frozen=True)
class Spread:
    """Internal parameters and how far they may be off."""

    values: FloatArray  # (n_param,) Middle of their intervals
    covariance: FloatArray  # (n_param, n_param) Their covariance, without any quantile
    degrees_of_freedom: FloatArray  # (n_param,) What the quantile of each interval follows, infinite for the normal one
    rule: str = ""  # What set the width, in words
    beside: Spread | None = None  # The same from where data say as good as the same; intervals hold both

    @property
    def std(self) -> FloatArray:
        """Standard deviation (n_param,) of each."""
        return np.sqrt(np.diag(self.covariance))

    def reach(self, confidence: float) -> FloatArray:
        """Half width (n_param,) of the intervals of a level."""
        return np.asarray(t.ppf(0.5 + 0.5 * confidence, self.degrees_of_freedom) * self.std)

    def ends(self, confidence: float, prior_std: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Lower and upper ends (n_param,) of the intervals of a level.

        Where a parameter has run off to where data say no more of it than was known beforehand, around zero, its
        interval holds what was known as well: there, nothing leads back.

        Args:
            confidence: The level.
            prior_std (n_param,): Deviation known beforehand, infinite where nothing is known.
        """
        reach, known = self.reach(confidence), norm.ppf(0.5 + 0.5 * confidence) * prior_std
        lower, upper = self.values - reach, self.values + reach
        undetermined = self.std > np.maximum(LONGEST_STEP, LEARNT_SHARE * prior_std)
        lower = np.where(undetermined, np.minimum(lower, -known), lower)
        upper = np.where(undetermined, np.maximum(upper, known), upper)
        if self.beside is None:
            return lower, upper
        least, most = self.beside.ends(confidence, prior_std)
        return np.minimum(lower, least), np.maximum(upper, most)


@dataclass(frozen=True)
class ElasticSolution:
    """Estimated parameters of an elastic model, and how the fit got there."""

    estimate: Estimate  # The parameters with their uncertainty
    internal: Internal  # Where the optimizer ended
    costs: Costs  # Costs there
    misfit: float  # Cost over what noise and the assumed model error give
    starts: Starts  # Where each start ended
    responses: Responses  # What was fitted
    # The residual of each element against its expectation; None without a covariance
    model_error: ModelError | None = None
    # As `relative_std` of the estimate, from what each realization does to the parameters instead of the structured
    # covariance; None without realizations
    realization_relative_std: Annotated[
        FloatArray | None, Quantity("1", "parameter", "Relative deviation from each realization's influence")
    ] = None
    bootstrap: Resampled | None = None  # The uncertainty from repeated fits; None without a bootstrap
    effective: Between | None = None  # How clusters differ; None with fewer than four clusters, or without a covariance
    # What the data say of the robot file's nuisances; None where it has none, and in files of old
    doubts: NuisanceEstimates | None = None
    # What gears alone may be; None without gears that the fit estimates, and in files of old
    gears: GearsAlone | None = None
    # How large a defect the residual would have shown; None without a covariance, and in files of old
    detectable: Detectable | None = None


_LEAST_FACTOR = 0.01
_SPRING_VALUES = [kind for kind, about in PARAMETER_KINDS.items() if about.owner in ("spring", "transmission")]


def fitted_robot(robot: Robot, estimate: Estimate) -> Robot:
    """Puts estimates into a robot; what was not estimated stays as it is.

    Args:
        robot: The robot file that the fit started from; with another payload, what the fit found of it is as much more.
        estimate: What the fit found.

    Returns:
        The robot with springs, dampers, viscous friction, inertias, and, where the fit corrected them, the
        coefficients of friction and ripple, and moved by its nuisances. A friction's lag and a torque's scale
        belong to the measurement.
    """
    every = estimable_nuisances(robot) if NUISANCE_KIND in estimate.kinds else ()
    off = [each for each in every if each.name in estimate.found]
    amounts = np.array([estimate.found[each.name] - estimate.stated[each.name] for each in off])
    return with_estimates(moved_robot(robot, off, amounts), estimate.found, estimate.stated)


def with_estimates(robot: Robot, found: Mapping[str, float], nominal: Mapping[str, float]) -> Robot:
    """Puts estimates into a robot, as `fitted_robot` does.

    Args:
        robot: The robot file that the fit started from.
        found: Estimates by name of the parameter.
        nominal: Values of the robot file, of at least these.
    """
    springs = tuple(_spring(spring, found) for spring in robot.springs)
    joints = tuple(_joint(joint, found, nominal) for joint in robot.joints)
    return replace(robot, springs=springs, joints=joints)


def fitted_delay_s(estimate: Estimate, nominal_s: float) -> float:
    """Returns the estimated delay, or the nominal one where it was not estimated [s]."""
    return estimate.found.get("delay", nominal_s)


def _spring(spring: Spring, found: Mapping[str, float]) -> Spring:
    point = [found.get(f"{spring.name}.location_{axis}") for axis in "xyz"]
    moved = any(value is not None for value in point)
    return replace(
        spring,
        **{kind: found.get(f"{spring.name}.{kind}", getattr(spring, kind)) for kind in _SPRING_VALUES},
        point_m=np.where([value is None for value in point], spring.point_m, np.array(point, float))
        if moved
        else spring.point_m,
    )


def _joint(joint: Joint, found: Mapping[str, float], nominal: Mapping[str, float]) -> Joint:
    name, link = f"{joint.name}.link_inertia", joint.link
    if name in found:
        # The fit counts a link's own inertia about its joint axis, or its mass, whatever else the last link carries.
        more = found[name] - nominal[name]
        if joint.type == "prismatic":
            link = Inertial(link.mass_kg + more, link.com_m, link.inertia_kgm2)
        else:
            link = Inertial(link.mass_kg, link.com_m, link.inertia_kgm2 + np.diag([0.0, 0.0, more]))
    arm_viscous = found.get(f"{joint.name}.arm_viscous", joint.arm_viscous)
    return replace(joint, link=link, motor=_motor(joint.name, joint.motor, found), arm_viscous=arm_viscous)


def _motor(name: str, motor: Motor, found: Mapping[str, float]) -> Motor:
    law = motor.friction
    level, shape = (max(_LEAST_FACTOR, 1 + found.get(f"{name}.{kind}", 0.0)) for kind in ("level", "shape"))
    viscous = found.get(f"{name}.viscous", law.viscous_nms_rad)
    friction = replace(law.scaled(level, shape), viscous_nms_rad=viscous)
    changed = replace(motor, inertia_kgm2=found.get(f"{name}.motor_inertia", motor.inertia_kgm2), friction=friction)
    if f"{name}.ripple_sin" not in found:
        return changed
    # What the fit counts opposes the motion; the description's ripple drives it.
    sine, cosine = -found[f"{name}.ripple_sin"], -found[f"{name}.ripple_cos"]
    size, phase = float(np.hypot(sine, cosine)), float(np.arctan2(cosine, sine))
    return replace(changed, ripple_nm=motor.ripple_nm * size, ripple_phase_rad=phase)
