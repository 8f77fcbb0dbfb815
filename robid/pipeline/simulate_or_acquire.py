"""simulate-or-acquire: the record of a campaign, simulated in closed loop or imported from a log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Provenance, canonical_hash
from robid.artifacts.kinds import EXCITATION, RECORD, excitation_from_artifact, record_from_artifact, record_to_artifact
from robid.artifacts.parts import Parts
from robid.artifacts.store import inspect_artifact, read_artifact, write_artifact
from robid.artifacts.truth import truth_sha256, write_truth
from robid.design.excitation.excitation import CampaignExcitation
from robid.logs.mapping import is_still_note
from robid.logs.period import is_found_note
from robid.pipeline.acquire import acquire_configuration, acquire_shots, is_radians_note, radians_note, with_lines
from robid.pipeline.responses import check as check_responses
from robid.pipeline.responses import phrase as phrase_of_responses
from robid.pipeline.stage import Job, counted
from robid.settings.experiment import Campaign
from robid.settings.fits import part
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.settings.robot_parts import delay_s, require_controller, require_pose_interface, tool_arm
from robid.settings.sources import Acquire, true_robot_of
from robid.signals.quantities import channel_names
from robid.simulate.experiment import SimulatedExperiment, simulate, with_settled_steps
from robid.simulate.options import SimulateOptions, Truth
from robid.simulate.pose_loop import PoseExperiment, simulate_poses, with_settled_pose_steps
from robid.simulate.truth import TrueRobot, bare, with_imperfections

_STAGE = "simulate-or-acquire"


def run(job: Job) -> str:
    """Simulates or imports a campaign; returns its key figures."""
    if job.campaign.is_response:
        return check_responses(job)
    if job.campaign.is_one_shot:
        return _acquire_shots(job)
    content = excitation_from_artifact(read_artifact(job.inputs["excitation"], EXCITATION))
    source = job.campaign.source
    if source is None:
        message = f"campaign {job.owner} has no source, and so no record"
        raise RuntimeError(message)
    if source.acquire is not None:
        return _acquire(job, source.acquire, content)
    return _simulate(job, source.simulate or SimulateOptions(), content)


def phrase(loaded: LoadedExperiment, owner: str, output: Path) -> str:
    """Says what a record holds, in a phrase."""
    if loaded.experiment.campaigns[owner].is_response:
        return phrase_of_responses(output)
    found = inspect_artifact(output)
    shape = found.datasets["inputs"].shape
    period_s = shape[4] * found.attributes["sampling_period_s"]
    notes = found.datasets["notes"].values or ()
    if found.datasets["excited_lines"].shape == (0,):
        return _shots(shape[1], period_s, notes)
    segments = found.attributes.get("segments", 0)
    if segments:
        text = f"{counted(shape[0] * shape[1] * shape[2], 'arbitrary signal')} of {period_s:.3g} s"
        pieces = f"{counted(segments, 'segment')} of {period_s / segments:.3g} s"
        return f"{counted(shape[0], 'configuration')}, {text}, {pieces}"
    told = (note for note in notes if is_found_note(note) or is_radians_note(note))
    return "; ".join((record_phrase(shape, period_s), *told))


def record_phrase(shape: Sequence[int], period_s: float) -> str:
    """Says what was recorded, in a phrase, from the shape of the torque."""
    n_conf, n_real, n_exp, n_period = shape[:4]
    duration_s = n_conf * n_real * n_exp * n_period * period_s
    return (
        f"{counted(n_conf, 'configuration')}, {counted(n_real, 'realization')} of {counted(n_exp, 'experiment')},"
        f" {counted(n_period, 'period')} of {period_s:g} s, {duration_s:.0f} s in all"
    )


def _shots(count: int, period_s: float, notes: Sequence[str]) -> str:
    """Says what was imported, with the channels that never change."""
    return "; ".join((f"{counted(count, 'shot')} of {period_s:.3g} s", *filter(is_still_note, notes)))


@dataclass(frozen=True)
class _Task:
    parts: Parts
    experiment: SimulatedExperiment | PoseExperiment
    configuration: FloatArray
    index: int
    threads: int
    truth_sha256: str


def _simulate_part(task: _Task) -> None:
    if isinstance(task.experiment, PoseExperiment):
        record = simulate_poses(task.experiment, task.configuration, task.index, task.threads)
    else:
        record = simulate(task.experiment, task.configuration, task.index, task.threads)
    record = replace(record, truth_sha256=task.truth_sha256)
    task.parts.write(task.index, record_to_artifact(record, Provenance(stage=_STAGE)))


@dataclass(frozen=True)
class _LogTask:
    parts: Parts
    campaign: Campaign
    acquire: Acquire
    content: CampaignExcitation
    index: int
    folder: Path
    robot: RobotFile


def _acquire_part(task: _LogTask) -> None:
    units = task.robot.joint_units
    record = acquire_configuration(task.campaign, task.acquire, task.content, task.index, task.folder, units)
    record = replace(record, notes=(*record.notes, *radians_note(record, task.robot)))
    task.parts.write(task.index, record_to_artifact(record, Provenance(stage=_STAGE)))


def _acquire(job: Job, acquire: Acquire, content: CampaignExcitation) -> str:
    campaign, n_conf = job.campaign, len(content.configurations)
    parts = Parts(job.output, RECORD, job.key)
    todo = [index for index in range(n_conf) if not parts.has(index)]
    job.progress.expect(n_conf, "configurations", n_conf - len(todo))
    folder = job.loaded.path.parent
    tasks = [_LogTask(parts, campaign, acquire, content, index, folder, job.loaded.robot) for index in todo]
    job.map(_acquire_part, tasks, lambda _index, _result: job.progress.advance())
    if n_conf > 1 and (campaign.is_arbitrary or campaign.finds_lines):
        _make_alike(parts, n_conf)
    parts.merge(n_conf, job.provenance())
    return phrase(job.loaded, job.owner, job.output)


def _make_alike(parts: Parts, n_conf: int) -> None:
    """Gives the records of all configurations the same lines and, of arbitrary signals, the same length."""
    found = []
    for index in range(n_conf):
        record = record_from_artifact(parts.read(index))
        found.append((record.segments, record.excited_lines))
    segments = min(each for each, _ in found)
    lines = np.unique(np.concatenate([each for _, each in found]))
    for index, (length, own) in enumerate(found):
        if length != segments or (not segments and len(own) != len(lines)):
            record = with_lines(record_from_artifact(parts.read(index)), segments, lines)
            parts.write(index, record_to_artifact(record, Provenance(stage=_STAGE)))


def _acquire_shots(job: Job) -> str:
    campaign = job.campaign
    if campaign.source is None or campaign.source.acquire is None:
        message = f"campaign {job.owner} has no logs"
        raise RuntimeError(message)
    record = acquire_shots(campaign, campaign.source.acquire, job.loaded.path.parent)
    write_artifact(job.output, record_to_artifact(record, job.provenance()))
    return _shots(campaign.realizations, record.period_s, record.notes)


def _simulate(job: Job, options: SimulateOptions, content: CampaignExcitation) -> str:
    experiment: SimulatedExperiment | PoseExperiment
    if job.campaign.moves_poses:
        poses = simulated_poses(job.loaded, job.campaign, options, content)
        experiment, steps = with_settled_pose_steps(poses, content.configurations)
        late_s = experiment.interface.delay_samples * experiment.interface.sampling_period_s
    else:
        moved = simulated_experiment(job.loaded, job.campaign, options, content)
        experiment, steps = with_settled_steps(moved, content.configurations)
        late_s = delay_s(job.loaded, job.campaign)
    n_conf = len(content.configurations)
    truth = simulated_truth(experiment, late_s)
    digest = truth_sha256(truth)
    parts = Parts(job.output, RECORD, canonical_hash([job.key, digest, steps.count]))
    todo = [index for index in range(n_conf) if not parts.has(index)]
    job.progress.expect(n_conf, "configurations", n_conf - len(todo))
    tasks = [_Task(parts, experiment, content.configurations[i], i, job.threads, digest) for i in todo]
    job.map(_simulate_part, tasks, lambda _index, _result: job.progress.advance())
    write_truth(job.output.with_name("truth.json"), truth)
    parts.merge(n_conf, job.provenance(options.seed))
    n_real, n_exp, n_sample, _ = experiment.reference.shape
    period_s = n_sample * content.excitation.sampling_period_s
    said = f"{counted(steps.count, 'RK4 step')} per sample ({steps.reason})"
    return f"{record_phrase((n_conf, n_real, n_exp, experiment.periods), period_s)}, {said}"


def simulated_poses(
    loaded: LoadedExperiment, campaign: Campaign, options: SimulateOptions, content: CampaignExcitation
) -> PoseExperiment:
    """Returns what is simulated in each configuration of a campaign of pose commands, on its true robot."""
    nominal = loaded.robot.to_robot(campaign.payload_kg)
    return PoseExperiment(
        robot=true_robot_of(loaded.robot, campaign.payload_kg, options.truth),
        arm=tool_arm(loaded.robot, nominal),
        controller=require_controller(loaded),
        interface=require_pose_interface(loaded.robot),
        options=options,
        channels=channel_names(content.excitation.channels),
        reference=content.excitation.reference,
        excited_lines=content.excitation.excited_lines,
        periods=campaign.periods,
    )


def simulated_experiment(
    loaded: LoadedExperiment, campaign: Campaign, options: SimulateOptions, content: CampaignExcitation
) -> SimulatedExperiment:
    """Returns what is simulated in each configuration of a campaign, on its true robot."""
    return SimulatedExperiment(
        robot=true_robot_of(loaded.robot, campaign.payload_kg, options.truth),
        controller=require_controller(loaded),
        options=options,
        reference=content.excitation.reference,
        inject=content.excitation.kind,
        excited_lines=content.excitation.excited_lines,
        detection_lines=content.excitation.detection_lines,
        periods=campaign.periods,
        outputs=campaign.outputs[1:],
        travel=content.excitation.travel,
    )


def simulated_truth(experiment: SimulatedExperiment | PoseExperiment, delay_s: float) -> TrueRobot:
    """Returns the true robot of a simulated campaign; the delay is from recorded to applied torque, or of poses [s]."""
    options = experiment.options
    return TrueRobot(
        robot=bare(with_imperfections(experiment.robot, options.imperfections)),
        truth=part(options.truth, Truth),
        imperfections=options.imperfections,
        delay_s=delay_s,
        seed=options.seed,
        steps_per_sample=options.steps_per_sample,
    )
