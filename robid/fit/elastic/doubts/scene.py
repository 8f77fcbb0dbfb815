"""A fitted model whose robot can be changed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.fit.elastic.options import ElasticOptions
from robid.fit.elastic.problem import Problem
from robid.fit.elastic.rest_model import rest_model
from robid.robot.derivatives import jacobian
from robid.robot.description import Robot
from robid.robot.response import ElasticParameters, Response, response, with_values


@dataclass(frozen=True)
class Scene:
    """A problem at some values of its parameters, with the robot behind it.

    Attributes:
        problem: The problem.
        internal (n_param,): Internal parameters.
        robot: The robot file's robot.
        options: Options of the fit.
    """

    problem: Problem
    internal: FloatArray
    robot: Robot
    options: ElasticOptions

    @cached_property
    def values(self) -> ElasticParameters:
        """Values of all parameters."""
        return self.problem.parameters.parameters(self.internal)

    @cached_property
    def response(self) -> Response:
        """The model's response."""
        return self._responded(self.values)

    @cached_property
    def at_rest(self) -> ComplexArray:
        """Response (n_conf, n_freq, n_out, n_in) of the robot itself, at rest with these values."""
        return self.sampled(self.robot)

    def slopes(self, kind: str) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_element) of the log response by the values of one kind."""
        period = self.problem.frf.hold_period_s
        found = jacobian(self.problem.model, self.values, self.response, (kind,), period)
        return np.asarray(found / self.response.sampled[..., None])

    def sampled(self, robot: Robot) -> ComplexArray:
        """Response (n_conf, n_freq, n_out, n_in) of another robot of the same springs, with the fitted values.

        It rests where gravity lets it, so that no first derivative of its matrices by the rest is needed.
        """
        frf, free = self.problem.frf, tuple(kind for kind in self.options.free if kind != "location")
        options = replace(self.options, statics="updates", free=free)
        model = rest_model(robot, frf, options, float(self.values.delay[0]), self.values)
        inertia = self.values.link_inertia + model.axial - self.problem.model.axial
        values = with_values(self.values, "link_inertia", inertia)
        return response(model, values, frf.frequency_hz, frf.hold_period_s).sampled

    def _responded(self, values: ElasticParameters) -> Response:
        frf = self.problem.frf
        return response(self.problem.model, values, frf.frequency_hz, frf.hold_period_s)
