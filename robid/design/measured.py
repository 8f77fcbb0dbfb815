"""Information that measured or simulated responses give about the parameters of a fit, by their own covariance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from robid.arrays import ComplexArray, FloatArray, check_shape
from robid.design.fitted import FittedInformation
from robid.design.wanted import NUISANCE, choose_parameters, eliminated
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.robot.derivatives import jacobian
from robid.robot.description import Robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import ElasticModel, build_model
from robid.robot.response import nominal_parameters, response


class _Derivatives:
    """Derivatives of the log response by log-parameters and nuisances, and its covariance, one configuration each."""

    def __init__(
        self,
        robot: Robot,
        frf: Frf,
        delay_s: float,
        kinds: Sequence[str],
        nuisance: Sequence[str],
        fixed: Sequence[str],
        model_error: float,
    ) -> None:
        _check_inputs(robot, frf)
        self.wanted = choose_parameters(robot, kinds, nuisance, fixed)
        self.names = self.wanted.names
        self.model: ElasticModel = build_model(robot)
        self.frf, self.delay_s, self.model_error = frf, delay_s, model_error
        with np.errstate(divide="ignore"):
            known = 1 / frf.coefficient_relative_std**2
        free = int(self.wanted.columns.sum())
        self.precision = np.concatenate([np.zeros(free), np.where(np.isfinite(known), known, 0.0)])

    def at(self, index: int, *, plain: bool = False) -> tuple[ComplexArray, ComplexArray]:
        """Derivatives (n_freq, n_element, n_all) and covariance (n_freq, n_element, n_element) of the log response.

        The elements are the rows of the response one after the other; friction scales are the last nuisances. The
        covariance is that of the measured response, and friction moves it: both are relative to the measured one,
        springs and dampers to the modelled one. With `plain` nothing is relative to anything.
        """
        frf = self.frf
        position = solve_statics(self.model, frf.configurations[index : index + 1])
        linear = linearize(self.model, position, frf.output_names)
        nominal = nominal_parameters(self.model.robot, linear, self.delay_s)
        result = response(linear, nominal, frf.frequency_hz, frf.hold_period_s)
        moved = jacobian(linear, nominal, result, self.wanted.kinds, frf.hold_period_s)[0]
        moved = moved[..., self.wanted.columns] * self.wanted.scales(nominal, frf.sampling_period_s)
        modelled, measured = (
            np.ones_like(each) if plain else each for each in (result.sampled[0], frf.response[index])
        )
        friction = np.moveaxis(frf.sensitivity[index], 0, -1) / measured[..., None]
        own = np.concatenate([moved / modelled[..., None], friction], axis=-1)
        n_freq, n_out, n_in, n_all = own.shape
        by_row = np.arange(n_out * n_in).reshape(n_in, n_out).T.ravel()
        size = measured.reshape(n_freq, -1)
        covariance = frf.full_covariance(index)[:, by_row][:, :, by_row] / (size[:, :, None] * size[:, None, :].conj())
        error = self.model_error * np.abs(frf.response[index] / measured).reshape(n_freq, -1)
        return own.reshape(n_freq, -1, n_all), covariance + error[..., None] ** 2 * np.eye(n_out * n_in)


def measured_information(
    robot: Robot,
    frf: Frf,
    delay_s: float,
    *,
    kinds: Sequence[str] = ("stiffness", "damping"),
    nuisance: Sequence[str] = NUISANCE,
    fixed: Sequence[str] = (),
    weights: FloatArray | None = None,
    model_error: float = 0.0,
    corrected: bool = True,
) -> tuple[FloatArray, tuple[str, ...]]:
    """Information of each configuration of a response about the log-parameters, by its structured covariance.

    `J^H W^1/2 Lambda^-1 W^1/2 J`, its nuisance parameters (the friction scales among them, with what the robot file
    knows of them) eliminated in each configuration; so a nuisance may differ from one to the other.

    Args:
        robot: Nominal robot, where the derivatives are taken.
        frf: Response with its covariance, of a simulated or a measured campaign.
        delay_s: Nominal delay from recorded to applied torque [s].
        kinds: Kinds of parameters that the design is about, of `LOGARITHMIC`.
        nuisance: Kinds that are estimated along.
        fixed: Names of single parameters that are known.
        weights (n_conf, n_freq, n_out, n_in): Design weights, 1 for full importance; elements at 0 are left out,
            their covariance with them.
        model_error: Relative model error that the covariance allows for, besides.
        corrected: Whether the inverse is corrected for the covariance's degrees of freedom.

    Returns:
        Matrices (n_conf, n_param, n_param) and the parameters' names.

    Raises:
        SettingsError: If a kind cannot be designed for, or a fixed name is unknown.
        DataError: If the inputs are not the robot's motors, or the covariance has no inverse.

    Source:
        Zimmermann et al. (2023), eq. 4; METHODS sec. 4 and 6.
    """
    derivatives = _Derivatives(robot, frf, delay_s, kinds, nuisance, fixed, model_error)
    freedom, n_out = frf.degrees_of_freedom, frf.response.shape[2]
    _check_freedom(frf)
    importance = _importance(frf, weights)
    matrices = []
    for index, weight in enumerate(importance):
        found = _best(*derivatives.at(index), weight) * ((freedom - n_out) / freedom if corrected else 1.0)
        matrices.append(eliminated([found], derivatives.precision, len(derivatives.names))[0])
    return np.array(matrices), derivatives.names


def fitted_information(
    robot: Robot,
    frf: Frf,
    delay_s: float,
    weights: FloatArray,
    *,
    whitening: ComplexArray | None = None,
    estimator: Literal["lls", "nls", "llsm"] = "lls",
    kinds: Sequence[str] = ("stiffness", "damping"),
    nuisance: Sequence[str] = NUISANCE,
    fixed: Sequence[str] = (),
    model_error: float = 0.0,
) -> tuple[FittedInformation, tuple[str, ...]]:
    """What a fit with weights of its own makes of each configuration.

    The covariance of such a fit is a sandwich, which does not add over configurations, but its two parts do. As in
    the fit, nuisance parameters, the friction scales last, are the same in all configurations, and what the robot
    file knows of friction counts once, in the unit of the weights.

    Args:
        robot: Nominal robot.
        frf: Response with its covariance.
        delay_s: Nominal delay from recorded to applied torque [s].
        weights (n_conf, n_freq, n_out, n_in): Weights of the squared residuals as the fit computes them, 0 for what
            it drops: over the variance of a residual, not merely in proportion.
        whitening (n_conf, n_freq, n_element, n_element): What multiplies the residuals of a line in place of the
            weights' root, where the fit takes correlations into account.
        estimator: Residual of the fit: of the logarithm, of the plain response, of the logarithm's real part.
        kinds: As for `measured_information`.
        nuisance: Kinds that are estimated along.
        fixed: Names of single parameters that are known.
        model_error: Relative model error that the covariance allows for, besides.

    Returns:
        Parts of every configuration, for one draw, and the names of the wanted parameters.

    Raises:
        SettingsError: If a kind cannot be designed for, or a fixed name is unknown.
        DataError: If the inputs are not the robot's motors, or the covariance has no inverse.

    Source:
        Wernholt and Moberg (2008), eq. 5, and its logarithmic forms.
    """
    derivatives = _Derivatives(robot, frf, delay_s, kinds, nuisance, fixed, model_error)
    _check_freedom(frf)
    found = []
    for index, weight in enumerate(_importance(frf, weights)):
        own, covariance = derivatives.at(index, plain=estimator == "nls")
        best = _best(own, covariance, np.ones_like(weight))
        own = own.real + 0j if estimator == "llsm" else own
        if whitening is None:
            weighted = weight[..., None] * own
        else:
            weighted = whitening[index].conj().swapaxes(1, 2) @ (whitening[index] @ own)
        n_all = own.shape[-1]
        bread = 2 * np.real(own.reshape(-1, n_all).conj().T @ weighted.reshape(-1, n_all))
        meat = 2 * np.real(weighted.reshape(-1, n_all).conj().T @ (covariance @ weighted).reshape(-1, n_all))
        found.append((bread, meat, best))
    bread, meat, best = (np.array(part)[None] for part in zip(*found, strict=True))
    return FittedInformation(bread, meat, best, derivatives.precision), derivatives.names


def _best(own: ComplexArray, covariance: ComplexArray, weight: FloatArray) -> FloatArray:
    """Information (n_all, n_all) by the inverse covariance, what has no weight left out."""
    used = weight > 0
    both = used[:, :, None] & used[:, None, :]
    root = np.linalg.cholesky(np.where(both, covariance, np.eye(used.shape[1])))
    rows = np.linalg.solve(root, np.sqrt(weight)[..., None] * own).reshape(-1, own.shape[-1])
    return np.asarray(2 * np.real(rows.conj().T @ rows))


def _importance(frf: Frf, weights: FloatArray | None) -> FloatArray:
    """Weights (n_conf, n_freq, n_element), rows of the response one after the other."""
    if weights is None:
        return np.ones((*frf.response.shape[:2], frf.response.shape[2] * frf.response.shape[3]))
    n_conf, n_freq, n_out, n_in = frf.response.shape
    check_shape("weights", weights, "n_conf n_freq n_out n_in", n_conf=n_conf, n_freq=n_freq, n_out=n_out, n_in=n_in)
    return np.asarray(weights.reshape(n_conf, n_freq, -1))


def _check_inputs(robot: Robot, frf: Frf) -> None:
    motors = tuple(joint.name for joint in robot.joints)
    if frf.input_names != motors:
        message = f"the response's inputs are {', '.join(frf.input_names)}, the robot's motors {', '.join(motors)}"
        raise DataError(message, where=robot.name, remedy="name the inputs after the robot's joints, in order")


def _check_freedom(frf: Frf) -> None:
    freedom, n_out = frf.degrees_of_freedom, frf.response.shape[2]
    if freedom <= n_out:
        message = f"the design needs more than {n_out} degrees of freedom of the response's covariance, not {freedom:g}"
        raise DataError(message, where="design", remedy="simulate more realizations or periods, or assume noise")
