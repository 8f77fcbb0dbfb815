"""design-excitation: what each motor is told to do, within the limits of every configuration."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Group

from robid.arrays import FloatArray
from robid.artifacts.kinds import EXCITATION, excitation_from_artifact, excitation_to_artifact
from robid.artifacts.store import read_artifact, write_artifact
from robid.design.excitation.excitation import CampaignExcitation, Excitation, design_signal
from robid.design.excitation.lines import period_samples
from robid.design.excitation.loop import nominal_loop
from robid.design.excitation.options import ArbitraryOptions, PoseChirpOptions, TrajectoryOptions
from robid.design.excitation.pose_chirp import PoseRobot, design_pose_chirp
from robid.design.excitation.prediction import predict, with_travel
from robid.design.excitation.trajectory.design import design_trajectory
from robid.design.excitation.trajectory.problem import BaseModel
from robid.pipeline.configurations import campaign_lines, configurations_of, reach_of
from robid.pipeline.plans import played_by_others, transient_periods
from robid.pipeline.stage import Job, counted
from robid.report.experiment import plan_table
from robid.robot.description import Robot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.drives import FrictionForm, RigidOptions
from robid.robot.regressor.model import build_rigid_model
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import (
    commanded_channels,
    input_count,
    require_controller,
    require_pose_interface,
    tool_arm,
)

_LEFT_OUT = {"none": ("viscous", "coulomb"), "viscous": ("coulomb",)}
"""Kinds of parameters that the criterion leaves out, by the friction that is asked for."""


def run(job: Job) -> str:
    """Designs a campaign's excitation; returns its key figures."""
    campaign, robot = job.campaign, job.loaded.robot.to_robot(job.campaign.payload_kg)
    configurations = configurations_of(job.loaded, campaign, job.inputs)
    acquire = played_by_others(campaign)
    if acquire is not None:
        excitation = _declared(job.loaded, campaign, acquire.sampling_period_s)
    else:
        excitation = _designed(job, robot, configurations)
    artifact = excitation_to_artifact(
        CampaignExcitation(configurations, excitation), job.provenance(campaign.excitation.seed)
    )
    write_artifact(job.output, artifact)
    return excitation_phrase(excitation, len(configurations))


def _declared(loaded: LoadedExperiment, campaign: Campaign, sampling_period_s: float) -> Excitation:
    """The lines of a log, which somebody else has played: there are no realizations of ours."""
    options, n_motor = campaign.excitation, input_count(campaign, loaded.robot)
    excited, detection = campaign_lines(loaded, campaign)
    n_sample = period_samples(options, sampling_period_s)
    return Excitation(
        reference=np.zeros((0, 0, n_sample, n_motor)),
        kind=options.inject,
        excited_lines=excited,
        detection_lines=detection,
        sampling_period_s=sampling_period_s,
        spectrum=np.zeros((0, 0, len(excited), n_motor), complex),
        rms=np.zeros(n_motor),
        crest_factor=np.zeros((0, 0, n_motor)),
    )


def _designed(job: Job, robot: Robot, configurations: FloatArray) -> Excitation:
    campaign, options = job.campaign, job.campaign.excitation
    if isinstance(options, PoseChirpOptions):
        return _pose_chirp(job, options, robot, configurations)
    if isinstance(options, ArbitraryOptions):
        message = f"campaign {job.owner} has no signal that could be played"
        raise TypeError(message)
    controller = require_controller(job.loaded)
    period_s = controller.sampling_period_s
    if isinstance(options, TrajectoryOptions):
        return _trajectory(job, options, robot, configurations, period_s)
    lines, _ = campaign_lines(job.loaded, campaign)
    loop = nominal_loop(robot, controller, configurations, lines / options.period_s)
    excitation = design_signal(options, len(robot.joints), campaign.realizations, period_s, loop)
    excitation = excitation.first_experiments(campaign.experiments)
    excitation = with_travel(excitation, options.travel, robot, configurations)
    transient = next(iter(transient_periods(campaign).values()))
    return predict(excitation, loop, options, periods=campaign.periods, transient_periods=transient)


def _pose_chirp(job: Job, options: PoseChirpOptions, robot: Robot, configurations: FloatArray) -> Excitation:
    return design_pose_chirp(
        options,
        commanded_channels(job.campaign, job.loaded.robot) or (),
        PoseRobot(
            tool_arm(job.loaded.robot, robot), require_pose_interface(job.loaded.robot), build_rigid_model(robot)
        ),
        configurations,
        job.campaign.realizations,
        reach_of(job.loaded, robot),
        periods=job.campaign.periods,
        transient_periods=next(iter(transient_periods(job.campaign).values())),
    )


def _trajectory(
    job: Job, options: TrajectoryOptions, robot: Robot, configurations: FloatArray, sampling_period_s: float
) -> Excitation:
    job.progress.expect(job.campaign.realizations * options.starts, "starts")
    return design_trajectory(
        options,
        base_model(robot, options),
        configurations,
        job.campaign.realizations,
        sampling_period_s,
        reach_of(job.loaded, robot),
        periods=job.campaign.periods,
        transient_periods=next(iter(transient_periods(job.campaign).values())),
        parallel_map=lambda function, tasks: job.map(function, tasks, lambda *_: job.progress.advance()),
    )


def base_model(robot: Robot, options: TrajectoryOptions) -> BaseModel:
    """Returns the rigid model of a robot with the columns of its base parameters, and which of them are judged."""
    form: FrictionForm = "asymmetric" if options.friction == "asymmetric" else "coulomb"
    left_out = _LEFT_OUT.get(options.friction, ())
    # Friction of either direction makes an offset, but for a motor that stands still.
    model = build_rigid_model(robot, RigidOptions(friction=form, offsets=form == "coulomb"))
    base = find_base_parameters(model)
    kept = model.only(base.columns.tolist())
    return BaseModel(kept, base.values(model.nominal), np.array([kind not in left_out for kind in kept.kinds]))


def phrase(_loaded: LoadedExperiment, _owner: str, output: Path) -> str:
    """Says what an excitation is, in a phrase."""
    content = excitation_from_artifact(read_artifact(output, EXCITATION))
    return excitation_phrase(content.excitation, len(content.configurations))


def show(output: Path, loaded: LoadedExperiment) -> Group | None:
    """Lays out what an excitation will do."""
    content = excitation_from_artifact(read_artifact(output, EXCITATION))
    names = tuple(joint.name for joint in loaded.robot.joints)
    return plan_table(content.excitation, names, loaded.robot.joint_units)


def excitation_phrase(excitation: Excitation, n_conf: int) -> str:
    """Says what was designed, in a phrase."""
    low, high = excitation.frequency_hz[[0, -1]]
    lines = counted(len(excitation.excited_lines), "line")
    text = f"{counted(n_conf, 'configuration')}, {lines} from {low:.3g} to {high:.3g} Hz"
    if excitation.plan is None:
        return text
    plan = excitation.plan
    margins = {"speed": plan.speed_margin, "torque": plan.torque_margin, "arm excursion": plan.excursion_margin}
    nearest = min(margins, key=lambda name: float(margins[name].min()))
    if plan.condition is not None:
        text += f", condition number {plan.condition.max():.3g} at most"
    return (
        f"{text}, crest factor {excitation.crest_factor.max():.2f} at most,"
        f" {nearest} reaches {100 * (1 - margins[nearest].min()):.1f} % of its limit"
    )
