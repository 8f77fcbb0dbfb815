"""Simulated robots with encoders on both sides of their gears: what is drawn of each, and their records."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from robid.arrays import FloatArray
from robid.design.excitation.options import TrajectoryOptions
from robid.robot.description import Robot, Spring
from robid.signals.record import Record
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, Imperfections, SimulateOptions, Truth
from robid.simulate.truth import TrueRobot, bare, true_robot, with_imperfections
from robid.studies.rough.motions import Rig, random_motions
from robid.studies.settings.encoders import EncodersStudy, Range

Defect = Literal["", "doubled", "loose", "behind"]
_DRAWS = 21  # keeps these draws apart from those of other studies


@dataclass(frozen=True)
class Individual:
    """One robot, as the study draws it."""

    file: Robot  # The robot file's, with its payload
    controller: Controller
    configuration: FloatArray  # (n_joint,) Where its motions begin and end [rad]
    outputs: tuple[str, ...]  # Encoders of arms
    flaws: Imperfections  # Those of the campaign, of which some are drawn
    study: EncodersStudy
    seed: int
    defect: Defect
    hinge: Spring | None  # The compliance behind the link encoder, of such a defect


def drawn_options(one: Individual) -> SimulateOptions:
    """Draws what differs from robot to robot; a gear whose lost motion doubles gets it as backlash."""
    rng, drawn = np.random.default_rng([one.seed, _DRAWS]), one.study.drawn

    def between(ends: Range) -> float:
        return float(np.exp(rng.uniform(*np.log(ends))))

    first = between(drawn.transmission_error_rad)
    flaws = replace(
        one.flaws,
        link_encoder_lag_s=float(rng.uniform(*drawn.lag_s)),
        hysteresis_nm=between(drawn.hysteresis_nm),
        stiffening_1_rad2=between(drawn.stiffening_1_rad2),
        transmission_error_rad=(first, 0.5 * first),
        transmission_error_phase_rad=tuple(rng.uniform(-np.pi, np.pi, 2).tolist()),
        gear_error_rad=between(drawn.gear_error_rad),
        gear_error_phase_rad=float(rng.uniform(-np.pi, np.pi)),
        link_encoder_eccentricity_rad=between(drawn.eccentricity_rad),
        link_encoder_eccentricity_phase_rad=float(rng.uniform(-np.pi, np.pi)),
        backlash_rad=one.study.worn_rad if one.defect == "doubled" else one.flaws.backlash_rad,
        link_encoder_play_rad=one.study.loose_rad if one.defect == "loose" else 0.0,
    )
    names = [joint.name for joint in one.file.joints]
    factors = 1 + drawn.torque_relative * rng.choice([-1.0, 1.0], len(names))
    truth = Truth(
        spring_factor=drawn.spring_factor,
        friction_relative=drawn.friction_relative,
        mass_relative=(drawn.mass_relative, drawn.mass_relative),
        torque_constant_factor=dict(zip(names, factors.tolist(), strict=True)),
        seed=one.seed,
    )
    return SimulateOptions(imperfections=flaws, truth=truth, transient_periods=0, seed=one.seed)


def truth_of(one: Individual, options: SimulateOptions) -> TrueRobot:
    """Returns the true robot with what of its simulation a fit may estimate."""
    further = (one.hinge,) if one.defect == "behind" and one.hinge is not None else ()
    robot = bare(with_imperfections(true_robot(one.file, options.truth, further), options.imperfections))
    return TrueRobot(robot, options.truth, options.imperfections, 0.0, one.seed, None)


def recorded(one: Individual, options: SimulateOptions, count: int) -> Record:
    """Simulates random motions of a robot (as realizations), all at once."""
    further = (one.hinge,) if one.defect == "behind" and one.hinge is not None else ()
    robot = true_robot(one.file, options.truth, further)
    rig = Rig(one.file, one.controller, one.configuration, options.imperfections, np.zeros(len(one.file.joints)))
    trajectory = TrajectoryOptions(period_s=one.study.period_s, harmonics=one.study.harmonics)
    sizes = np.ones((count, len(one.file.joints)))
    speed = random_motions(rig, trajectory, sizes, np.random.default_rng([one.seed, _DRAWS, 1]))
    experiment = SimulatedExperiment(
        robot=robot,
        controller=one.controller,
        options=options,
        reference=speed[:, None],
        inject="speed_reference",
        excited_lines=np.arange(1, one.study.harmonics + 1),
        detection_lines=np.zeros(0, int),
        periods=1,
        outputs=one.outputs,
    )
    record = simulate(experiment, one.configuration, one.seed)
    return replace(record, excited_lines=np.zeros(0, int))
