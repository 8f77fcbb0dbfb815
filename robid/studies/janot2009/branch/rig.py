"""The branch in its control loop, and what is to be identified of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.result import first_moments
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import RigidModel, build_rigid_model
from robid.simulate.rigid_loop import simulate_rigid, simulate_rigid_loop
from robid.studies.janot2009.branch.motion import Branch, exciting_motion
from robid.studies.janot2009.seeded.identification import Machine, Recording

_SUBSTEPS = 2
_GUESS = 0.8  # of everything: what least squares makes of badly filtered rows need not be a robot at all
MODEL = RigidOptions(couplings=False)
"""The parallelogram's rods couple forearm and arm, not a gear with inertia and friction of its own."""


@dataclass(frozen=True)
class Rig:
    """The robot ready to be recorded.

    Attributes:
        branch: The robot.
        model: Its model with the columns of base parameters alone.
        truth (n_base,): The base parameters.
        command (n_sample, n_joint): Motor angles that it is told [rad].
    """

    branch: Branch
    model: RigidModel
    truth: FloatArray
    command: FloatArray

    @property
    def machine(self) -> Machine:
        """The robot as what is to be identified."""

        def simulate(parameters: FloatArray) -> FloatArray:
            command = np.broadcast_to(self.command, (len(parameters), *self.command.shape))
            return simulate_rigid(self.model, parameters, self.branch.robot, self.branch.controller, command)

        return Machine(
            self.model, self.truth, first_moments(self.model.names), simulate, weighted=True, guess=_GUESS * self.truth
        )


def make_rig(branch: Branch) -> Rig:
    """Finds the base parameters of a robot and a motion that excites them."""
    whole = build_rigid_model(branch.robot, MODEL)
    base = find_base_parameters(whole)
    model, truth = whole.only(base.columns.tolist()), base.values(whole.nominal)
    return Rig(branch, model, truth, exciting_motion(branch, model, truth))


def record_branch(rig: Rig, seeds: range) -> Recording:
    """Simulates the robot once a seed: the zeros of its encoders and its torque noise differ."""
    case, (n_sample, n_joint) = rig.branch.case, rig.command.shape
    generators = [np.random.default_rng(seed) for seed in seeds]
    quantum = case.resolution_rad
    zero = np.array([generator.uniform(0, quantum, n_joint) for generator in generators])
    command = np.broadcast_to(rig.command, (len(seeds), n_sample, n_joint))

    def measure(angle: FloatArray) -> FloatArray:
        return np.asarray(quantum * np.round((angle - zero) / quantum) + zero) if quantum else angle

    controller = rig.branch.controller
    angle, torque = simulate_rigid_loop(
        rig.model, rig.truth, rig.branch.robot, controller, command, measure=measure, substeps=_SUBSTEPS
    )
    noise = np.array([generator.standard_normal((n_sample, n_joint)) for generator in generators])
    seen = measure(angle.swapaxes(0, 1)).swapaxes(0, 1)
    return Recording(controller.sampling_period_s, seen, torque + case.torque_noise_nm * noise)
