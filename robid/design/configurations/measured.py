"""Information that measured or simulated responses give about the parameters of a fit, by their own covariance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray, check_shape
from robid.design.configurations.candidates import choose_parameters, eliminated
from robid.design.configurations.options import ALONG
from robid.design.configurations.visits import FittedInformation
from robid.errors import DataError
from robid.frf.channels import require
from robid.frf.frf import Frf
from robid.frf.residual import LOGARITHM, Residual
from robid.robot.collocated import motor_rows
from robid.robot.derivatives import jacobian
from robid.robot.description import Robot
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import ElasticModel, build_model
from robid.robot.parameters import OF_SPRINGS
from robid.robot.response import nominal_parameters, response
from robid.signals.quantities import ACCELERATION, MOTOR_TORQUE

_ALIKE = 1 - 1e-12
"""Correlation of what the model lacks in both couplings of two motors; below 1 so that an inverse is there."""


@dataclass(frozen=True)
class _Errors:
    """Errors of a response in one configuration, its elements the rows one after the other."""

    noise: ComplexArray  # (n_freq, n_element, n_element) Covariance of the measured response, relative to `size`
    assumed: ComplexArray  # (n_freq, n_element) Standard deviation of the assumed model error, relative to `size`
    alike: FloatArray  # (n_element, n_element) Correlation of the assumed model error
    size: ComplexArray  # (n_freq, n_element) What both are relative to
    correlation: FloatArray | None  # (n_freq, n_next) Of each line's noise with the next lines', or None

    def covariance(self) -> ComplexArray:
        """Covariance (n_freq, n_element, n_element) of each line, the assumed model error included."""
        return self.noise + self.assumed[:, :, None] * self.assumed[:, None, :].conj() * self.alike

    def between(self, pull: ComplexArray) -> FloatArray:
        """What lines that share noise add (n_all, n_all) to the covariance of pulls (n_freq, n_element, n_all)."""
        n_all = pull.shape[-1]
        total = np.zeros((n_all, n_all))
        # Noise is relative to `size`: it is brought back on one side and taken off on the other.
        moved = self.size[..., None] * (self.noise @ pull)
        scaled = pull / self.size.conj()[..., None]
        # cov of scores at lines k and k + a is rho_a times the noise at both; both orders count.
        for ahead in range(1, 1 + (0 if self.correlation is None else min(self.correlation.shape[1], len(pull) - 1))):
            share = np.asarray(self.correlation)[:-ahead, ahead - 1, None, None]
            for here, there in ((slice(None, -ahead), slice(ahead, None)), (slice(ahead, None), slice(None, -ahead))):
                left = (share * scaled[here]).reshape(-1, n_all)
                total += 2 * np.real(left.conj().T @ moved[there].reshape(-1, n_all))
        return 0.5 * (total + total.T)


class Derivatives:
    """Derivatives of the residual by log-parameters and nuisances, and its covariance, one configuration each."""

    def __init__(self, robot: Robot, frf: Frf, delay_s: float, model_error: float, *wanted: Any) -> None:  # noqa: ANN401
        require(frf, MOTOR_TORQUE, ACCELERATION, "The elastic model's information")
        motors = tuple(joint.name for joint in robot.joints)
        if frf.input_names != motors:
            own = f"the response's inputs are {', '.join(frf.input_names)}, the robot's motors {', '.join(motors)}"
            remedy = "name the inputs after the robot's joints, in order"
            raise DataError(f"D001 {own}", where=robot.name, remedy=remedy)
        self.wanted = choose_parameters(robot, *wanted)
        self.names = self.wanted.names
        self.model: ElasticModel = build_model(robot)
        self.frf, self.delay_s, self.model_error = frf, delay_s, model_error
        with np.errstate(divide="ignore"):
            known = 1 / frf.coefficient_relative_std**2
        self.precision = np.concatenate([self.wanted.precision, np.where(np.isfinite(known), known, 0.0)])

    def at(self, index: int, residual: Residual = LOGARITHM) -> tuple[ComplexArray, _Errors]:
        """Derivatives (n_freq, n_element, n_all) of the complex residual and its errors.

        Friction scales are the last nuisances. Errors are those of the measured response, and friction moves it:
        both are relative to the measured one, springs and dampers to the modelled one, where the residual is. What
        the model lacks is reciprocal: one error for both couplings of two motors.
        """
        frf = self.frf
        # Linearised in this configuration alone: one task of memory, whatever the campaign's size.
        position = solve_statics(self.model, frf.configurations[index : index + 1])
        linear = replace(linearize(self.model, position, frf.output_names), rates=frf.output_rates)
        nominal = nominal_parameters(self.model.robot, linear, self.delay_s)
        result = response(linear, nominal, frf.frequency_hz, frf.hold_period_s)
        # Columns for log-parameters, and friction scales as the last nuisances.
        moved = jacobian(linear, nominal, result, self.wanted.kinds)[0]
        moved = moved[..., self.wanted.columns] * self.wanted.scales(nominal, frf.sampling_period_s)
        modelled, measured = residual.divisor(result.sampled[0]), residual.divisor(frf.response[index])
        friction = np.moveaxis(frf.sensitivity[index], 0, -1) / measured[..., None]
        own = np.concatenate([moved / modelled[..., None], friction], axis=-1)
        n_freq, n_out, n_in, n_all = own.shape
        # The structured covariance stacks columns of G; residuals here go row by row.
        by_row = np.arange(n_out * n_in).reshape(n_in, n_out).T.ravel()
        size = measured.reshape(n_freq, -1)
        covariance = frf.full_covariance(index)[:, by_row][:, :, by_row] / (size[:, :, None] * size[:, None, :].conj())
        assumed = self.model_error * residual.per_relative(frf.response[index]).reshape(n_freq, -1)
        correlation = None if frf.line_correlation is None else frf.line_correlation[index]
        errors = _Errors(covariance, assumed, _alike(motor_rows(linear), n_out, n_in), size, correlation)
        return own.reshape(n_freq, -1, n_all), errors


def _alike(rows: dict[int, int], n_out: int, n_in: int) -> FloatArray:
    """Correlation (n_element, n_element) of the model's own errors."""
    alike = np.eye(n_out * n_in)
    for first, second in combinations(rows, 2):
        pair = [rows[first] * n_in + second, rows[second] * n_in + first]
        # Reciprocity: what the model lacks is one error in G_ij and G_ji.
        alike[pair, pair[::-1]] = _ALIKE
    return alike


def measured_information(
    robot: Robot,
    frf: Frf,
    delay_s: float,
    *,
    kinds: Sequence[str] = OF_SPRINGS,
    nuisance: Sequence[str] = ALONG,
    fixed: Sequence[str] = (),
    weights: FloatArray | None = None,
    model_error: float = 0.0,
    prior_decades: float = np.inf,
    corrected: bool = True,
) -> tuple[FloatArray, tuple[str, ...]]:
    """Information (n_conf, n_param, n_param) of a response about log-parameters by its covariance, and their names.

    `J^H W^1/2 Lambda^-1 W^1/2 J`, its nuisance parameters (the friction scales among them) eliminated in each
    configuration; so a nuisance may differ from one to the other, and what the robot file knows of it counts in each.
    Where lines share noise, it is the inverse covariance of the estimate by these weights.

    Args:
        robot: Nominal robot, where the derivatives are taken.
        frf: Response with its covariance, of a simulated or a measured campaign.
        delay_s: Nominal delay from recorded to applied torque [s].
        kinds: Kinds of parameters that the design is about, of `LOGARITHMIC`.
        nuisance: Kinds that are estimated along.
        fixed: Names of single parameters that are known.
        weights (n_conf, n_freq, n_out, n_in): Design weights, 1 for full importance; elements at 0 are left out,
            their covariance with them.
        model_error: Relative model error that the covariance allows for, besides, one for both couplings of two motors.
        prior_decades: What the robot file knows of springs, dampers and link inertias that are estimated along.
        corrected: Whether the inverse is corrected for the covariance's degrees of freedom.

    Raises:
        SettingsError: If a kind cannot be designed for, or a fixed name is unknown.
        DataError: If the inputs are not the robot's motors, or the covariance has no inverse.

    Source:
        Zimmermann et al. (2023), eq. 4; docs/methods, sec. 4 and 6.
    """
    derivatives = Derivatives(robot, frf, delay_s, model_error, kinds, nuisance, fixed, prior_decades)
    freedom, n_out = frf.degrees_of_freedom, frf.response.shape[2]
    _check_freedom(frf)
    importance = _importance(frf, weights)
    matrices = []
    for index, weight in enumerate(importance):
        own, errors = derivatives.at(index)
        # Best weights; where lines share noise, the meat holds what they add, and B S^-1 B is the information.
        pull, best = _best(own, errors, weight)
        parts = [best, best + errors.between(pull)]
        # An inverse complex Wishart matrix has the mean nu / (nu - n) times the inverse covariance.
        scale = (freedom - n_out) / freedom if corrected else 1.0
        parts = eliminated([scale * part for part in parts], derivatives.precision, len(derivatives.names))
        matrices.append(parts[0] if errors.correlation is None else _outside(*parts))
    return np.array(matrices), derivatives.names


def fitted_information(
    robot: Robot,
    frf: Frf,
    delay_s: float,
    weights: FloatArray,
    *,
    whitening: ComplexArray | None = None,
    residual: Residual = LOGARITHM,
    kinds: Sequence[str] = OF_SPRINGS,
    nuisance: Sequence[str] = ALONG,
    fixed: Sequence[str] = (),
    model_error: float = 0.0,
    prior_decades: float = np.inf,
) -> tuple[FittedInformation, tuple[str, ...]]:
    """Parts of every configuration in a fit with weights of its own, for one draw, and the parameters' names.

    The covariance of such a fit is a sandwich, which does not add over configurations, but its two parts do. As in
    the fit, nuisance parameters, the friction scales last, are the same in all configurations, and what the robot
    file knows of friction and motor inertias counts once, in the unit of the weights. Lines that share noise count
    in the meat alone; the best weights are those of independent lines.

    Args:
        robot: Nominal robot.
        frf: Response with its covariance.
        delay_s: Nominal delay from recorded to applied torque [s].
        weights (n_conf, n_freq, n_out, n_in): Weights of the squared residuals as the fit computes them, 0 for what
            it drops: over the variance of a residual, not merely in proportion.
        whitening (n_conf, n_freq, n_element, n_element): What multiplies the residuals of a line in place of the
            weights' root, where the fit takes correlations into account.
        residual: Residual of the fit.
        kinds: As for `measured_information`.
        nuisance: Kinds that are estimated along.
        fixed: Names of single parameters that are known.
        model_error: As for `measured_information`.
        prior_decades: As for `measured_information`.

    Raises:
        SettingsError: If a kind cannot be designed for, or a fixed name is unknown.
        DataError: If the inputs are not the robot's motors, or the covariance has no inverse.

    Source:
        Wernholt and Moberg (2008), eq. 5, and its logarithmic forms.
    """
    derivatives = Derivatives(robot, frf, delay_s, model_error, kinds, nuisance, fixed, prior_decades)
    found = []
    for row in weighted_rows(derivatives, weights, whitening, residual):
        n_all = row.own.shape[-1]
        # Sandwich of the fit: bread J^H W J, meat J^H W Lambda W J (docs/methods, sec. 5).
        pull = row.weighted.reshape(-1, n_all).conj().T
        bread = 2 * np.real(pull @ row.own.reshape(-1, n_all))
        found.append((bread, row.meat(), row.best))
    bread, meat, best = (np.array(part)[None] for part in zip(*found, strict=True))
    return FittedInformation(bread, meat, best, derivatives.precision), derivatives.names


@dataclass(frozen=True)
class WeightedRow:
    """Derivatives of one configuration's residual, weighted as in a fit."""

    own: ComplexArray  # (n_freq, n_element, n_all) By the parameters
    weighted: ComplexArray  # (n_freq, n_element, n_all) The same, weighted: `W J`
    best: FloatArray  # (n_all, n_all) Information by optimal weights
    errors: _Errors

    def meat(self) -> FloatArray:
        """Covariance (n_all, n_all) of the scores by noise, `2 Re J^H W Lambda W J`."""
        n_all, weighted = self.own.shape[-1], self.weighted
        moved = self.errors.covariance() @ weighted
        meat = 2 * np.real(weighted.reshape(-1, n_all).conj().T @ moved.reshape(-1, n_all))
        return np.asarray(meat + self.errors.between(weighted))


def weighted_rows(
    derivatives: Derivatives, weights: FloatArray, whitening: ComplexArray | None, residual: Residual
) -> Iterator[WeightedRow]:
    """Derivatives of each configuration, by the arguments of `fitted_information`."""
    _check_freedom(derivatives.frf)
    for index, weight in enumerate(_importance(derivatives.frf, weights)):
        own, errors = derivatives.at(index, residual)
        best = _best(own, errors, np.ones_like(weight))[1]
        own = residual.part(own)
        if whitening is None:
            weighted = weight[..., None] * own
        else:
            # W'W J, so that correlated weights enter bread and meat as they do in the fit.
            weighted = whitening[index].conj().swapaxes(1, 2) @ (whitening[index] @ own)
        yield WeightedRow(own, weighted, best, errors)


def _best(own: ComplexArray, errors: _Errors, weight: FloatArray) -> tuple[ComplexArray, FloatArray]:
    """What errors pull by the inverse covariance of each line, and the information (n_all, n_all) of lines by it.

    What has no weight is left out.
    """
    used = weight > 0
    both = used[:, :, None] & used[:, None, :]
    # Elements without weight get a covariance of their own, so that the others keep theirs alone.
    root = np.linalg.cholesky(np.where(both, errors.covariance(), np.eye(used.shape[1])))
    white = np.linalg.solve(root, np.sqrt(weight)[..., None] * own)
    pull = np.linalg.solve(root.conj().swapaxes(1, 2), white)
    rows = white.reshape(-1, own.shape[-1])
    return pull, np.asarray(2 * np.real(rows.conj().T @ rows))


def _outside(bread: FloatArray, meat: FloatArray) -> FloatArray:
    """Information `B S^-1 B` (n_param, n_param) where some directions may be unseen."""
    scale = np.sqrt(np.where(np.diag(bread) > 0, np.diag(bread), 1.0))
    unit = scale[:, None] * scale
    # Unseen directions have neither bread nor meat: the pseudo-inverse leaves them out.
    inverse = np.linalg.pinv(meat / unit, rcond=1e-13, hermitian=True)
    return np.asarray(unit * ((bread / unit) @ inverse @ (bread / unit)))


def _importance(frf: Frf, weights: FloatArray | None) -> FloatArray:
    """Weights (n_conf, n_freq, n_element), rows of the response one after the other."""
    n_conf, n_freq, n_out, n_in = frf.response.shape
    told = np.ones(frf.response.shape) if frf.dropped is None else np.repeat(~frf.dropped[:, :, None], n_out, axis=2)
    if weights is None:
        return np.asarray(told.reshape(n_conf, n_freq, -1), float)
    check_shape("weights", weights, "n_conf n_freq n_out n_in", n_conf=n_conf, n_freq=n_freq, n_out=n_out, n_in=n_in)
    return np.asarray((weights * told).reshape(n_conf, n_freq, -1))


def _check_freedom(frf: Frf) -> None:
    freedom, n_out = frf.degrees_of_freedom, frf.response.shape[2]
    if freedom <= n_out:
        needed = f"more than {n_out} degrees of freedom of the response's covariance, not {freedom:g}"
        remedy = "simulate more realizations or periods, or assume noise"
        raise DataError(f"D002 the design needs {needed}", where="design", remedy=remedy)
