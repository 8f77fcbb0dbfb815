"""A fitted elastic model set against frequency responses, whether the fit saw them or not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.checks import check_inputs
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.parameters import ParameterMap, map_parameters
from robid.models.elastic.fit.problem import Problem, make_problem
from robid.models.elastic.fit.rest_model import rest_model
from robid.models.elastic.fit.solution import ElasticSolution
from robid.robot.description import Robot
from robid.robot.linearize import LinearModel
from robid.robot.parameters import DOUBT
from robid.robot.response import ElasticParameters, nominal_parameters

_SAME_VALUE = 1e-6
_PAYLOAD_MASS = "payload.mass"


@dataclass(frozen=True)
class FittedModel:
    """A fitted model in the configurations of a frequency response.

    Attributes:
        problem: The least-squares problem of this response, weighted as the fit's own.
        internal (n_param,): The fitted internal parameters, in the problem's order.
        dropped: Elements that the logarithm drops.
    """

    problem: Problem
    internal: FloatArray
    dropped: int

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
        """Measured response (n_conf, n_freq, n_out, n_in), compensated with the fitted friction scales."""
        return self.problem.measured(self.internal)


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
    return FittedModel(problem, internal, dropped)


def _parameters(robot: Robot, model: LinearModel, frf: Frf, options: ElasticOptions, delay_s: float) -> ParameterMap:
    return map_parameters(
        robot,
        nominal_parameters(robot, model, delay_s),
        options,
        frf.coefficient_names,
        frf.coefficient_relative_std,
        frf.coefficient_offset,
    )


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
        if kind == DOUBT:  # as many kilograms with another payload too
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
        if kind not in ("friction", DOUBT)
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
