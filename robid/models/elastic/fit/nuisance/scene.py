"""A fitted robot that can be changed: its response with other values, springs, links or rest positions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.rest_model import (
    rest_model,
    spring_load,
)
from robid.robot.derivatives import jacobian
from robid.robot.description import Robot, Spring
from robid.robot.linearize import LinearModel, Shifts
from robid.robot.parameters import NUISANCE_KIND
from robid.robot.response import ElasticParameters, Response, response, with_values


@dataclass(frozen=True)
class Scene:
    """A problem at some values of its parameters, with the robot behind it."""

    problem: Problem  # The problem
    internal: FloatArray  # (n_param,) Internal parameters
    robot: Robot  # The robot file's robot
    options: ElasticOptions  # Options of the fit

    @cached_property
    def values(self) -> ElasticParameters:
        """Values of all parameters."""
        return self.problem.parameters.parameters(self.internal)

    @cached_property
    def stated(self) -> ElasticParameters:
        """Values as the robot file has them: what no fit estimates is off by shares of these."""
        robot = self.robot
        return replace(
            self.problem.parameters.nominal,
            stiffness=np.array([spring.stiffness for spring in robot.springs]),
            damping=np.array([spring.damping for spring in robot.springs]),
            motor_inertia=robot.motor_inertia_kgm2,
        )

    @cached_property
    def response(self) -> Response:
        """The model's response."""
        return self._response(self.problem.model, self.values)

    @cached_property
    def at_rest(self) -> ComplexArray:
        """Response (n_conf, n_freq, n_out, n_in) of the robot itself, at rest with these values."""
        return self.sampled(self.robot)

    @cached_property
    def gear_slopes(self) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_spring) of the log response by the springs' relative slopes.

        The slope alone changes, not where the spring rests: what moves it is added to the motion, not to the load.
        """
        # Without cubic coefficients, moves of the rest and what was added, the derivative is that by the slope alone,
        # whose relative size the factor undoes.
        linear = replace(self.values, cubic=np.zeros_like(self.values.cubic))
        stiffness = self.response.springs.stiffness
        still = replace(self.response.model, rest=replace(self.response.model.rest, moves=None), added=None)
        found = jacobian(still, linear, replace(self.response, model=still), ("stiffness",))
        slopes = found / still.rest.factor[:, None, None, None] * stiffness[:, None, None, None]
        return np.asarray(slopes / self.response.sampled[..., None])

    @cached_property
    def _slopes(self) -> dict[str, ComplexArray]:
        return {}

    def slopes(self, kind: str) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_element) of the log response by a kind's elements."""
        if kind not in self._slopes:
            found = jacobian(self.problem.model, self.values, self.response, (kind,))
            self._slopes[kind] = np.asarray(found / self.response.sampled[..., None])
        return self._slopes[kind]

    @cached_property
    def swing(self) -> FloatArray:
        """Mean square deflections (n_conf, n_freq, n_spring) at each line; zero where the torques are not known."""
        frf, values = self.problem.frf, self.values
        if frf.input_amplitude is None or any(name not in frf.output_names for name in frf.input_names):
            return np.zeros((*frf.response.shape[:2], len(self.robot.springs)))
        power = np.nan_to_num(spring_load(self.robot, frf, values).power)
        square = (2 * np.pi * frf.frequency_hz[:, None]) ** 2
        return np.asarray(power / (values.stiffness**2 + square * values.damping**2))

    def sampled(self, robot: Robot) -> ComplexArray:
        """Response (n_conf, n_freq, n_out, n_in) of another robot of the same springs, with the fitted values."""
        return self._response(*self.rested(robot, self.values)).sampled

    def extended(self, spring: Spring) -> ComplexArray:
        """Response (n_conf, n_freq, n_out, n_in) of the robot with one spring more."""
        robot = replace(self.robot, springs=(*self.robot.springs, spring))
        return self._response(*self.rested(robot, extended_values(self.values, [spring]))).sampled

    def rested(self, robot: Robot, values: ElasticParameters) -> tuple[LinearModel, ElasticParameters]:
        """Another robot where gravity lets it rest, so that no derivative of its matrices by the rest is needed."""
        frf, free = self.problem.frf, tuple(kind for kind in self.options.kinds if kind != "location")
        options = replace(self.options, statics="updates", free=free)
        model = with_estimated_links(rest_model(robot, frf, options, float(values.delay[0]), values), self.problem)
        inertia = values.link_inertia + model.axial - self.problem.model.axial
        added = self.problem.model.added
        if added is not None:
            further = len(robot.springs) - added.shape[-1]
            added = np.pad(added, ((0, 0), (0, 0), (0, further)))
        model = replace(model, added=added, clinging=self.problem.model.clinging)
        return model, with_values(values, "link_inertia", inertia)

    def settled(self) -> Scene:
        """The same where gravity lets the robot rest with these values."""
        return replace(self, problem=replace(self.problem, model=self.rested(self.robot, self.values)[0]))

    def along(self, shifts: Shifts) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_shift) of the log response along shifts of the matrices."""
        model = replace(self.response.model, shifts=shifts, effects=None)
        values = replace(self.values, doubt=shifts.amounts)
        moved = jacobian(model, values, replace(self.response, model=model), (NUISANCE_KIND,))
        return np.asarray(moved / self.response.sampled[..., None])

    def _response(self, model: LinearModel, values: ElasticParameters) -> Response:
        return response(model, values, self.problem.frf.frequency_hz, self.problem.frf.hold_period_s)


def extended_values(values: ElasticParameters, springs: Sequence[Spring]) -> ElasticParameters:
    """Returns values of parameters with those of further springs."""
    own = {"stiffness": "stiffness", "damping": "damping", "cubic": "cubic", "location": "point_m"}
    more = {kind: [getattr(spring, name) for spring in springs] for kind, name in own.items()}
    return replace(values, **{kind: np.append(getattr(values, kind), each) for kind, each in more.items()})


def with_estimated_links(model: LinearModel, problem: Problem) -> LinearModel:
    """Returns the model of a robot that is off, links' own inertias that the fit estimates as the robot file has them.

    What is off of these is estimated, and is no nuisance besides.
    """
    masks = dict(zip(problem.parameters.kinds, problem.parameters.masks, strict=True))
    estimated = masks.get("link_inertia", np.zeros(model.axial.size, bool))
    return replace(model, axial=np.where(estimated, problem.model.axial, model.axial))


def moves_matrices_alone(problem: Problem, internal: FloatArray) -> bool:
    """Whether a robot that is off has other matrices and nothing else: no stiffness that grows with its load."""
    return problem.model.shifts is None and not problem.parameters.parameters(internal).cubic.any()
