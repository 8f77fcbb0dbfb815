"""A branch of a haptic interface with a parallelogram: its exciting motion, its loop, and what its seeds say."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError
from robid.models.rigid.fit.result import first_moments
from robid.pipeline.configurations import configurations_of
from robid.pipeline.graph import Run
from robid.report.section import Beside, Section
from robid.robot.description import Robot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import RigidModel, build_rigid_model
from robid.settings.robot_parts import plain_settings, require_controller, robot_settings
from robid.simulate.options import Controller
from robid.simulate.rigid_loop import simulate_rigid_loop
from robid.studies.janot2009 import seeded
from robid.studies.page import PartFound
from robid.studies.settings.parts import BranchCase
from robid.studies.study import Content, Part, Results, Task

_SUBSTEPS = 2
_GUESS = 0.8  # of everything: what least squares makes of badly filtered rows need not be a robot at all
MODEL = RigidOptions(couplings=False)
"""The parallelogram's rods couple forearm and arm, not a gear with inertia and friction of its own."""


@dataclass(frozen=True)
class Rig:
    """The robot ready to be recorded."""

    branch: Branch  # The robot
    model: RigidModel  # Its model with the columns of base parameters alone
    truth: FloatArray  # (n_base,) the base parameters
    command: FloatArray  # (n_sample, n_joint) motor angles that it is told [rad]

    @property
    def machine(self) -> seeded.Machine:
        """The robot as what is to be identified."""

        def simulate(parameters: FloatArray) -> FloatArray:
            command = np.broadcast_to(self.command, (len(parameters), *self.command.shape))
            return simulate_rigid_loop(self.model, parameters, self.branch.robot, self.branch.controller, command)[0]

        vectors = first_moments(self.model.names)
        return seeded.Machine(self.model, self.truth, vectors, simulate, weighted=True, guess=_GUESS * self.truth)


def make_rig(branch: Branch) -> Rig:
    """Finds the base parameters of a robot and a motion that excites them."""
    whole = build_rigid_model(branch.robot, MODEL)
    base = find_base_parameters(whole)
    model, truth = whole.only(base.columns.tolist()), base.values(whole.nominal)
    return Rig(branch, model, truth, exciting_motion(branch, model, truth))


def record_branch(rig: Rig, seeds: range) -> seeded.Recording:
    """Simulates the robot once a seed: the zeros of its encoders and its torque noise differ."""
    case, (n_sample, n_joint) = rig.branch.case, rig.command.shape
    generators = [np.random.default_rng(seed) for seed in seeds]
    quantum = case.resolution_rad
    zero = np.array([generator.uniform(0, quantum, n_joint) for generator in generators])
    command = np.broadcast_to(rig.command, (len(seeds), n_sample, n_joint))

    def measure(angle: FloatArray) -> FloatArray:
        return np.asarray(quantum * np.round((angle - zero) / quantum) + zero) if quantum else angle

    controller = rig.branch.controller
    loop = rig.model, rig.truth, rig.branch.robot, controller
    angle, torque = simulate_rigid_loop(*loop, command, measure=measure, substeps=_SUBSTEPS)
    noise = np.array([generator.standard_normal((n_sample, n_joint)) for generator in generators])
    seen = measure(angle.swapaxes(0, 1)).swapaxes(0, 1)
    return seeded.Recording(controller.sampling_period_s, seen, torque + case.torque_noise_nm * noise)


def _branch_tasks(run: Run, case: BranchCase, _earlier: Mapping[str, Results]) -> list[Task]:
    campaign = run.loaded.experiment.campaigns[case.campaign]
    decides = {
        **robot_settings(run.loaded, "mechanics", "rigid", "range", "motor_limits", "friction", "controller"),
        "configurations": plain_settings(campaign.configurations),
        "payload_kg": campaign.payload_kg,
    }
    middle = configurations_of(run.loaded, campaign, {})[0]
    robot = run.loaded.robot.to_robot(campaign.payload_kg)
    branch = Branch(case, robot, require_controller(run.loaded), middle)
    return seeded.chunk_tasks(case, "branch", decides, branch)


def _identify_branch(branch: Branch, case: BranchCase, seeds: range) -> Content:
    rig = make_rig(branch)
    return seeded.judge_chunk(rig.machine, record_branch(rig, seeds), case)


def _conclude_branch(run: Run, case: BranchCase, results: Results) -> PartFound:
    found = {filters: seeded.gather(results, filters) for filters in seeded.FILTERS}
    joints = tuple(joint.name for joint in run.loaded.robot.joints)
    lead = (
        "The paper says of its medical interface that it saw there what it saw on one axis. Its geometry is not"
        " published: this branch has the same topology, an arm whose forearm a parallelogram drives. Least squares"
        " and Huber's estimator share what bias there is, so that their difference alone need not show it: the"
        " instruments and the residuals' correlation do."
    )
    shown = [
        seeded.residual_figures(found[filters], index, (f"{joint}, {cut:g} Hz", "", ""))[0]
        for filters, cut in zip(seeded.FILTERS, seeded.cuts(case), strict=True)
        for index, joint in enumerate(joints)
    ]
    histograms, estimates = Beside(tuple(shown), columns=len(joints)), seeded.estimate_tables(found, case)
    title, parts = f"Branch of a haptic interface over {case.seeds} seeds", seeded.verdict_parts(found, case)
    section = Section(title, lead, (*parts, histograms, *estimates))
    asked = {f"branch.{filters}.verdict_share": each for filters, each in seeded.VERDICTS.items()}
    return PartFound(seeded.verdict_figures("branch", found), asked, (section,))


_COARSE = 200  # samples by which a series is chosen


@dataclass(frozen=True)
class Branch:
    """The robot with what moves it."""

    case: BranchCase
    robot: Robot
    controller: Controller
    middle_rad: FloatArray  # (n_joint,) arm positions about which it moves


@dataclass(frozen=True)
class _Series:
    """A Fourier series of arm positions about a middle."""

    middle: FloatArray  # (n_joint,) its middle [rad]
    sine: FloatArray  # (n_harmonic, n_joint) amplitudes of the sines [rad]
    cosine: FloatArray  # (n_harmonic, n_joint) amplitudes of the cosines [rad]
    period_s: float  # Its period [s]

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Returns positions, speeds and accelerations (n_sample, n_joint) at times (n_sample,)."""
        rate = 2 * np.pi * np.arange(1, len(self.sine) + 1) / self.period_s
        sine, cosine = np.sin(np.outer(time_s, rate)), np.cos(np.outer(time_s, rate))
        return (
            self.middle + sine @ self.sine + cosine @ self.cosine,
            (cosine * rate) @ self.sine - (sine * rate) @ self.cosine,
            -(sine * rate**2) @ self.sine - (cosine * rate**2) @ self.cosine,
        )


def exciting_motion(branch: Branch, model: RigidModel, truth: FloatArray) -> FloatArray:
    """Returns the best conditioned of random Fourier series within the limits of joints and torques.

    It is judged by the columns of the base parameters (n_base,), and given as motor angles (n_sample, n_joint) [rad].

    Raises:
        DataError: If every series needs more torque than there is.
    """
    case, period = branch.case, branch.controller.sampling_period_s
    generator = np.random.default_rng(case.draw_seed)
    drawn = [_draw(branch, generator) for _ in range(case.draws)]
    condition = [_condition(branch, series, model, truth) for series in drawn]
    best = int(np.argmin(condition))
    if not np.isfinite(condition[best]):
        message = "D220 every series that was drawn needs more torque than the motors have"
        remedy = "lower `range_share` or `harmonics`, or raise `duration_s`"
        raise DataError(message, where="study.branch", remedy=remedy)
    time_s = np.arange(round(case.duration_s / period)) * period
    return np.asarray(drawn[best].at(time_s)[0] @ branch.robot.motor_per_arm.T)


def _draw(branch: Branch, generator: np.random.Generator) -> _Series:
    """A random series that begins at rest and uses the allowed share of the range of each joint."""
    case, robot, middle = branch.case, branch.robot, branch.middle_rad
    shape, order = (case.harmonics, len(middle)), np.arange(1.0, case.harmonics + 1)
    sine, cosine = generator.standard_normal(shape), generator.standard_normal(shape)
    sine -= np.outer(order, order @ sine) / (order @ order)
    plain = _Series(np.zeros_like(middle), sine, cosine, case.duration_s)
    reach = np.abs(plain.at(np.linspace(0, case.duration_s, _COARSE))[0]).max(axis=0)
    room = case.range_share * np.minimum(robot.upper - middle, middle - robot.lower)
    return _Series(middle, sine * room / reach, cosine * room / reach, case.duration_s)


def _condition(branch: Branch, series: _Series, model: RigidModel, truth: FloatArray) -> float:
    """Condition number of the columns, each of norm 1, along a series; infinite beyond the torque limits."""
    motor = branch.robot.motor_per_arm.T
    motion = [each @ motor for each in series.at(np.linspace(0, series.period_s, _COARSE))]
    limit = np.array([joint.motor.max_torque_nm for joint in branch.robot.joints])
    if np.any(np.abs(model.torques(truth, *motion)) > branch.case.torque_share * limit):
        return float("inf")
    columns = model.columns(*motion).reshape(-1, len(truth))
    return float(np.linalg.cond(columns / np.linalg.norm(columns, axis=0)))


BRANCH = Part("branch", _conclude_branch, _branch_tasks, _identify_branch)
