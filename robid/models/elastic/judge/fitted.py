"""A fitted elastic model set against frequency responses, whether the fit saw them or not, and its poles and zeros."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.fitting import check_inputs
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.parameters import ParameterMap, map_parameters
from robid.models.elastic.fit.problem import Problem, make_problem
from robid.models.elastic.fit.rest_model import rest_model
from robid.models.elastic.fit.solution import ElasticSolution
from robid.robot.derivatives import loaded_slopes
from robid.robot.description import Robot
from robid.robot.linearize import LinearModel
from robid.robot.parameters import NUISANCE_KIND
from robid.robot.response import ElasticParameters, at_rest, motion_matrices, nominal_parameters

_SAME_VALUE = 1e-6
_PAYLOAD_MASS = "payload.mass"


@dataclass(frozen=True)
class ModelAt:
    """A model in the configurations of a frequency response."""

    problem: Problem  # The least-squares problem of this response, weighted as the fit's own
    internal: FloatArray  # (n_param,) Internal parameters, in the problem's order

    @property
    def parameters(self) -> ElasticParameters:
        """All parameter values, fitted and fixed."""
        return self.problem.parameters.parameters(self.internal)

    @property
    def linear(self) -> tuple[LinearModel, ElasticParameters]:
        """The linearised robot and its parameters."""
        return self.problem.model, self.parameters

    @property
    def measured(self) -> ComplexArray:
        """Measured response (n_conf, n_freq, n_out, n_in), compensated with the estimated friction scales."""
        return self.problem.measured(self.internal)

    @property
    def cost(self) -> float:
        """Cost, with what is known beforehand."""
        return self.problem.cost(self.internal)


@dataclass(frozen=True)
class FittedModel(ModelAt):
    """A fitted model in the configurations of a frequency response."""

    dropped: int  # Elements that the logarithm drops
    robot: Robot  # The robot file that the fit started from, with the payload of the response's campaign
    options: ElasticOptions  # Options of the fit
    solution: ElasticSolution  # What the fit found

    @property
    def physical(self) -> FloatArray:
        """Internal parameters (n_param,) with springs and dampers in the middle of their physical intervals."""
        found = self.solution.estimate
        if found.physical_value is None:
            return self.internal
        rows = zip(found.names, found.value.tolist(), found.physical_value.tolist(), strict=True)
        moved = {name: np.log(middle / value) for name, value, middle in rows if min(value, middle) > 0}
        pairs = zip(self.problem.parameters.names, self.problem.parameters.logarithmic.tolist(), strict=True)
        return np.asarray(self.internal + [moved.get(name, 0.0) if is_log else 0.0 for name, is_log in pairs])

    @property
    def placed(self) -> dict[str, float]:
        """Springs that the physical model has put in place, each with its compliance over its gear's [%]."""
        doubts = self.solution.doubts
        if doubts is None:
            return {}
        rows = zip(doubts.names, doubts.prior_std.tolist(), doubts.value.tolist(), strict=True)
        return {name.rpartition(".")[0]: value for name, std, value in rows if std == np.inf}


def fitted_model(
    robot: Robot, solution: ElasticSolution, frf: Frf, options: ElasticOptions, delay_s: float
) -> FittedModel:
    """Evaluates a fitted model in a response's configurations, statics solved for the fitted springs.

    Args:
        robot: The robot file that the fit started from.
        solution: What the fit found.
        frf: Frequency responses, of the fit or of another campaign.
        options: Options of the fit.
        delay_s: Nominal delay of the fit, hold excluded [s].

    Returns:
        The model; friction scales that the fit does not know stay at the robot file's values.

    Raises:
        DataError: If the response's inputs are not the robot's motors, or robot, options or delay are not
            those of the fit.
    """
    check_inputs(robot, frf)
    model = rest_model(robot, frf, options, delay_s)
    values = _parameters(robot, model, frf, options, delay_s)
    model = rest_model(robot, frf, options, delay_s, values.parameters(_internal(robot, solution, values)))
    parameters = _parameters(robot, model, frf, options, delay_s)
    internal = _internal(robot, solution, parameters)
    problem, dropped = make_problem(frf, model, parameters, options, internal, _level(solution, frf))
    return FittedModel(problem, internal, dropped, robot, options, solution)


def _parameters(robot: Robot, model: LinearModel, frf: Frf, options: ElasticOptions, delay_s: float) -> ParameterMap:
    known = frf.coefficient_names, frf.coefficient_relative_std, frf.coefficient_offset
    return map_parameters(robot, nominal_parameters(robot, model, delay_s), options, *known)


def _level(solution: ElasticSolution, frf: Frf) -> FloatArray | None:
    """Model error (n_conf, n_out, n_in) of each element: root mean square over the fit's configurations."""
    if solution.model_error is None:
        return None
    mean = np.sqrt((solution.model_error.level**2).mean(axis=0))
    return np.asarray(np.broadcast_to(mean, (len(frf.configurations), *mean.shape)))


def _internal(robot: Robot, solution: ElasticSolution, parameters: ParameterMap) -> FloatArray:
    """Orders the fitted internal values as the map does and checks that they mean the same."""
    names = solution.estimate.names
    fitted = dict(zip(names, solution.internal.values.tolist(), strict=True))
    estimate = dict(zip(names, solution.estimate.value.tolist(), strict=True))
    stated = solution.estimate.stated
    internal = np.array([fitted.get(name, 0.0) for name in parameters.names])
    for index, kind in enumerate(parameters.kind_of):
        if kind == NUISANCE_KIND:  # as many kilograms with another payload too
            name = parameters.names[index]
            internal[index] = (estimate[name] - stated[name]) / parameters.scale[index]
            if name == _PAYLOAD_MASS and internal[index] < parameters.lower[index] - _SAME_VALUE:
                raise _too_light(estimate[name] - stated[name], robot)
    for index, offset in enumerate(parameters.friction_offset, start=len(internal) - parameters.n_friction):
        internal[index] = estimate.get(parameters.names[index], offset) - offset
    values = dict(zip(parameters.names, parameters.values(internal).tolist(), strict=True))
    kinds = dict(zip(names, solution.estimate.kinds, strict=True)) | dict(
        zip(parameters.names, parameters.kind_of, strict=True)
    )
    differing = [
        name
        for name, kind in kinds.items()
        if kind not in ("friction", NUISANCE_KIND)
        and not np.isclose(values.get(name, np.nan), estimate.get(name, np.nan), rtol=_SAME_VALUE, atol=1e-12)
    ]
    if differing:
        message = f"D135 robot, options or delay are not those of the fit: {', '.join(differing)} would change"
        raise DataError(message, where=robot.name, remedy="fit again with the present robot and settings")
    return internal


def _too_light(more_kg: float, robot: Robot) -> DataError:
    message = (
        f"D136 the fit found a payload {-more_kg:.3g} kg lighter than stated; that leaves nothing of the"
        f" {robot.payload.mass_kg:.3g} kg here"
    )
    return DataError(message, where=robot.name, remedy="correct `payload_kg` of the campaigns and fit again")


_PASSES = 3


@dataclass(frozen=True)
class Modes:
    """Oscillating modes, upper half plane, by rising size."""

    roots: ComplexArray  # (n_mode,) Roots of the characteristic equation [rad/s]
    shapes: ComplexArray  # (n, n_mode) Their shapes in the model's coordinates; zero at a locked motor
    slopes: ComplexArray  # (n_mode,) `x' (2 s M + D) x` of each root `s` and shape `x`


def poles(model: LinearModel, parameters: ElasticParameters, configuration: int) -> Modes:
    """Returns the oscillating modes with free motors."""
    return _modes(model, parameters, configuration, None)


def zeros(model: LinearModel, parameters: ElasticParameters, configuration: int, motor: int) -> Modes:
    """Returns the zeros of a motor's own response.

    They are the modes with that motor locked: its row and column leave the equations of motion, as the
    numerator of a diagonal element of an inverse matrix is the minor without that row and column.
    """
    return _modes(model, parameters, configuration, motor)


def damping_ratio(roots: ComplexArray) -> FloatArray:
    """Damping ratios of modes [rad/s]."""
    return np.asarray(-roots.real / np.abs(roots))


def frequency_std(fitted: FittedModel, covariance: FloatArray, modes: Modes, configuration: int) -> FloatArray:
    """Standard deviation (n_mode,) of undamped frequencies by the delta method [Hz].

    Args:
        fitted: The fitted model.
        covariance (n_param, n_param): Covariance of its internal parameters.
        modes: Its modes in one configuration.
        configuration: Index of that configuration.

    Source:
        First-order perturbation of `(M s^2 + D s + K) x = 0` with symmetric matrices.
    """
    model, parameters, values = fitted.problem.model, fitted.problem.parameters, fitted.parameters
    s, x = modes.roots, modes.shapes
    motors, springs = x[: model.n_motor] ** 2, x[model.n_motor :] ** 2
    inertias, arms = _seen(model.link_inertia[configuration], x), (model.arm @ x) ** 2
    change = {
        "stiffness": model.rest.factor[configuration][:, None] * springs,
        "damping": s * springs,
        "viscous": s * motors,
        "arm_viscous": s * arms,
        "motor_inertia": s**2 * motors,
        "link_inertia": s**2 * inertias,
        "delay": np.zeros((1, s.size)),
    }
    if model.shifts is not None:
        by = model.shifts
        change[NUISANCE_KIND] = s**2 * _seen(by.mass[configuration], x) + _seen(by.gravity_stiffness[configuration], x)
    if model.effects is not None:
        by_effects = model.effects.slopes(values.doubt, values.damping, np.abs(s))[configuration]
        change[NUISANCE_KIND] = change[NUISANCE_KIND] + np.einsum("msd,sm->dm", by_effects, springs)
        change["damping"] = model.effects.growth(values.doubt)[configuration, :, None] * change["damping"]
    for kind, through in _through_rest(fitted, modes, configuration).items():
        change[kind] = through + (change[kind] if kind == "damping" else 0.0)
    moved = -np.concatenate([change[kind] for kind in parameters.kinds])[parameters.columns()] / modes.slopes
    rate = np.real(s.conj() * moved) / (2 * np.pi * np.abs(s))
    count = len(parameters.names) - parameters.n_friction
    rate = parameters.chain(fitted.internal)[: len(rate), :count].T @ rate
    own = covariance[: rate.shape[0], : rate.shape[0]]
    return np.asarray(np.sqrt(np.einsum("pm,pq,qm->m", rate, own, rate)))


def _through_rest(fitted: FittedModel, modes: Modes, configuration: int) -> dict[str, FloatArray]:
    """What parameters of each kind change (n, n_mode) by where the robot rests and how its springs are loaded there."""
    s, x, springs = modes.roots, modes.shapes, modes.shapes[fitted.problem.model.n_motor :] ** 2
    moving, at = at_rest(fitted.problem.model, fitted.parameters)
    moves, found = moving.rest.moves, {}
    for kind, slopes in loaded_slopes(moving, fitted.parameters, at, fitted.problem.parameters.kinds).items():
        found[kind] = slopes.stiffness[configuration].T @ springs
        if moves is not None:
            turned = s**2 * _seen(moves.mass[configuration], x) + _seen(moves.gravity_stiffness[configuration], x)
            found[kind] = found[kind] + slopes.displacement[configuration].T @ turned
    return found


def _seen(matrices: FloatArray, shapes: ComplexArray) -> ComplexArray:
    """Quadratic form (n_matrix, n_mode) of each matrix in each shape."""
    return np.asarray(np.einsum("im,lij,jm->lm", shapes, matrices, shapes))


def _modes(model: LinearModel, parameters: ElasticParameters, configuration: int, locked: int | None) -> Modes:
    """Modes, hysteresis as it is at each one's own frequency."""
    found = _solved(model, parameters, configuration, locked, None)
    if model.effects is None or not model.effects.bristles:
        return found
    columns = []
    for row, root in enumerate(found.roots):
        at = found
        for _ in range(_PASSES):
            omega = float(np.abs(root))
            at = _solved(model, parameters, configuration, locked, omega)
            row = min(row, at.roots.size - 1)
            root = at.roots[row]
        columns.append((at.roots[row], at.shapes[:, row], at.slopes[row]))
    roots, shapes, slopes = zip(*columns, strict=True) if columns else ((), (), ())
    return Modes(np.array(roots, complex), np.array(shapes).T.reshape(found.shapes.shape), np.array(slopes, complex))


def _solved(
    model: LinearModel, parameters: ElasticParameters, configuration: int, locked: int | None, omega: float | None
) -> Modes:
    """Solves `(M s^2 + D s + K) x = 0` for roots with positive imaginary part."""
    kept = np.delete(np.arange(model.mass.shape[-1]), [] if locked is None else [locked])
    inside = np.ix_(kept, kept)
    mass, damping, stiffness = (matrix[inside] for matrix in motion_matrices(model, parameters, configuration, omega))
    n = kept.size
    upper = np.hstack([np.zeros((n, n)), np.eye(n)])
    lower = -np.linalg.solve(mass, np.hstack([stiffness, damping]))
    roots, vectors = np.linalg.eig(np.vstack([upper, lower]))
    order = np.argsort(np.abs(roots))
    order = order[roots.imag[order] > 1e-6 * np.abs(roots[order])]
    shapes: ComplexArray = np.zeros((model.mass.shape[-1], order.size), complex)
    shapes[kept] = vectors[:n, order]
    x, s = shapes[kept], roots[order].astype(complex)
    slopes = 2 * s * np.einsum("im,ij,jm->m", x, mass, x) + np.einsum("im,ij,jm->m", x, damping, x)
    return Modes(s, shapes, np.asarray(slopes))
