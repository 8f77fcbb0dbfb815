"""A fitted model whose robot can be changed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.elastic.fit.doubts.extension import extended_values
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.rest_model import rest_model, spring_load
from robid.robot.derivatives import jacobian
from robid.robot.description import Robot, Spring
from robid.robot.linearize import LinearModel, Shifts
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
    def stiffness_slopes(self) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_spring) of the log response by the springs' relative slopes."""
        linear = replace(self.values, cubic=np.zeros_like(self.values.cubic))
        stiffness = self.response.springs.stiffness
        still = replace(self.response.model, rest=replace(self.response.model.rest, moves=None), added=None)
        found = jacobian(still, linear, replace(self.response, model=still), ("stiffness",))
        slopes = found / still.rest.factor[:, None, None, None] * stiffness[:, None, None, None]
        return np.asarray(slopes / self.response.sampled[..., None])

    @cached_property
    def spring_slopes(self) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_spring) of the log response by the springs' relative sizes."""
        return np.asarray(self._slopes("stiffness") * self.values.stiffness)

    @cached_property
    def damper_slopes(self) -> ComplexArray:
        """The same by their dampers'."""
        return np.asarray(self._slopes("damping") * self.values.damping)

    @cached_property
    def compliance_slopes(self) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_spring) of the log response by the springs' relative compliances.

        Dampers go with them.
        """
        return np.asarray(-(self.spring_slopes + self.damper_slopes))

    @cached_property
    def rotor_slopes(self) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_joint) of the log response by the rotors' inertias."""
        return self._slopes("motor_inertia")

    @cached_property
    def delay_slopes(self) -> ComplexArray:
        """Derivative (n_conf, n_freq, n_out, n_in, 1) of the log response by the drives' delay."""
        return self._slopes("delay")

    @cached_property
    def viscous_slopes(self) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_joint) of the log response by the motors' viscous friction."""
        return self._slopes("viscous")

    @cached_property
    def arm_slopes(self) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_joint) of the log response by the arms' viscous friction."""
        return self._slopes("arm_viscous")

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
        moved = jacobian(model, values, replace(self.response, model=model), ("doubt",))
        return np.asarray(moved / self.response.sampled[..., None])

    @property
    def _period(self) -> float | None:
        return self.problem.frf.hold_period_s

    def _slopes(self, *kinds: str) -> ComplexArray:
        found = jacobian(self.problem.model, self.values, self.response, kinds)
        return np.asarray(found / self.response.sampled[..., None])

    def _response(self, model: LinearModel, values: ElasticParameters) -> Response:
        return response(model, values, self.problem.frf.frequency_hz, self._period)


def with_estimated_links(model: LinearModel, problem: Problem) -> LinearModel:
    """Returns the model of a robot that is off, links' own inertias that the fit estimates as the robot file has them.

    What is off of these is estimated, and is nothing to doubt besides.
    """
    masks = dict(zip(problem.parameters.kinds, problem.parameters.masks, strict=True))
    estimated = masks.get("link_inertia", np.zeros(model.axial.size, bool))
    return replace(model, axial=np.where(estimated, problem.model.axial, model.axial))


def moves_matrices_alone(problem: Problem, internal: FloatArray) -> bool:
    """Whether a robot that is off has other matrices and nothing else: no stiffness that grows with its load."""
    return problem.model.shifts is None and not problem.parameters.parameters(internal).cubic.any()
