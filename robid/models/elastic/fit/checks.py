"""What a fit refuses before it starts, with what to do about it."""

from __future__ import annotations

import numpy as np

from robid.arrays import BoolArray
from robid.errors import DataError
from robid.frf.channels import require
from robid.frf.frf import Frf
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.robot.description import Robot
from robid.signals.quantities import ACCELERATION, MOTOR_TORQUE

_NO_INFLUENCE = 1e-14  # of the largest: rounding


def check_inputs(robot: Robot, frf: Frf) -> None:
    """Refuses a response that is not one from motor torques to accelerations, or not of the robot's motors.

    Raises:
        DataError: If it is so.
    """
    require(frf, MOTOR_TORQUE, ACCELERATION, "An elastic model")
    motors = tuple(joint.name for joint in robot.joints)
    if frf.input_names != motors:
        message = f"D129 the response's inputs are {', '.join(frf.input_names)}, the robot's motors {', '.join(motors)}"
        raise DataError(message, where=robot.name, remedy="name the inputs after the robot's joints, in order")


def check_data(robot: Robot, frf: Frf, options: ElasticOptions) -> None:
    """Refuses responses and covariances that the options cannot use, everything at once.

    Raises:
        DataError: If response or covariance are not finite, or too few realizations stand behind what is asked.
    """
    problems = [*_not_finite(frf), *_covariance(frf, options), *_realizations(frf, options)]
    if problems:
        messages, remedies = zip(*problems, strict=True)
        raise DataError("; ".join(messages), where=robot.name, remedy="; ".join(dict.fromkeys(remedies)))


def check_influence(problem: Problem) -> None:
    """Refuses weights that leave no line, and free parameters that change nothing.

    Raises:
        DataError: If it is so.
    """
    if not problem.weight.any():
        remedy = "lower `weights.low_cut_hz`, excite more, or average over more realizations"
        raise DataError(
            "D130 no line of the response has a weight: all are cut off or below 10 dB", where="fit", remedy=remedy
        )
    parameters = problem.parameters
    prior = 0.5 / parameters.prior_std**2
    influence = np.diag(problem.normal(np.zeros(len(parameters.names))).hessian) - prior
    known = np.isin(parameters.kind_of, ("friction", "doubt"))  # beforehand: they stay where they are
    none = (influence <= _NO_INFLUENCE * influence.max()) & ~known
    silent = [name for name, without in zip(parameters.names, none, strict=True) if without]
    if silent:
        message = f"D131 free parameters change nothing: {', '.join(silent)}"
        raise DataError(message, where="fit", remedy="list them under `fixed`, or measure other configurations")


def _not_finite(frf: Frf) -> list[tuple[str, str]]:
    found = []
    told = True if frf.dropped is None else ~frf.dropped[:, :, None]
    for what, values in (("response", frf.response), ("covariance", frf.element_variance())):
        bad = np.asarray((told & ~np.isfinite(values)).any(axis=(0, 2, 3)))
        if bad.any():
            found.append((f"D241 the {what} is not finite at {_shown(frf, bad)} Hz", "estimate it again"))
    return found


def _covariance(frf: Frf, options: ElasticOptions) -> list[tuple[str, str]]:
    """A variance of zero where others have one, or none at all, gives optimal weights no size."""
    variance = frf.element_variance()
    if frf.dropped is not None:
        variance = np.where(frf.dropped[:, :, None], np.nanmax(variance[np.isfinite(variance)], initial=0.0), variance)
    if not options.weights.kind.startswith("optimal") or not np.isfinite(variance).all():
        return []
    if not variance.any():
        remedy = "record two or more realizations of two or more periods, or use the weights `user` or `inflated`"
        return [("D242 the response has no covariance, which optimal weights invert", remedy)]
    nothing = np.asarray(~(variance > 0).all(axis=(0, 2, 3)))
    if not nothing.any():
        return []
    message = f"D243 the covariance is singular at {_shown(frf, nothing)} Hz, and optimal weights invert it"
    return [(message, "use the weights `inflated` or `user`, or look for a channel without noise")]


def _realizations(frf: Frf, options: ElasticOptions) -> list[tuple[str, str]]:
    found = []
    if options.weights.kind.startswith("optimal") and frf.total_covariance is None and frf.noise_covariance is not None:
        message = "D244 optimal weights need the total covariance, but one realization shows noise only"
        found.append((message, "record two or more realizations, or use the weights `inflated` or `user`"))
    if options.bootstrap and frf.realization_error is None:
        message = "D245 `bootstrap` weights realizations anew, but the response holds none"
        remedy = "record two or more realizations and estimate the response by blocks, or set `bootstrap` to 0"
        found.append((message, remedy))
    return found


def _shown(frf: Frf, chosen: BoolArray) -> str:
    return ", ".join(f"{frequency:.3g}" for frequency in frf.frequency_hz[chosen][:5])
