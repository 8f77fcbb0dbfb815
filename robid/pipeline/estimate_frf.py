"""estimate-frf: frequency responses of a campaign from its record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Provenance
from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, frf_to_artifact, record_from_artifact
from robid.artifacts.parts import Parts
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact, read_outline
from robid.errors import DataError, SettingsError
from robid.frf.checks import is_finding
from robid.frf.compensation import shows_friction
from robid.frf.estimate import estimate_frf
from robid.frf.frf import LEVELS, Frf, Level
from robid.frf.laws import LawEstimate, combine_laws, with_levels
from robid.frf.options import IDENTIFYING, EstimateOptions
from robid.frf.quality import dropped_lines, saturation_text
from robid.frf.reading import READS_REFERENCE
from robid.frf.silent import identify_laws, start_laws
from robid.models.handed_on import friction_from_artifact
from robid.pipeline import responses
from robid.pipeline.stage import Job, counted
from robid.results.plausible.evidence import Evidence, gather_evidence, join_evidence
from robid.results.plausible.findings import evidence_findings
from robid.robot.friction import TorqueLaw
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s

_STAGE = "estimate-frf"


@dataclass(frozen=True)
class _Task:
    parts: Parts
    record: Path
    index: int
    options: EstimateOptions
    laws: tuple[TorqueLaw, ...] | None
    delay_s: float
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Brief:
    """What the phrase about a campaign needs of some of its configurations."""

    size: str
    relative_std: FloatArray
    levels: dict[Level, FloatArray]
    removed_rms: float
    torque_unit: str
    findings: tuple[str, ...]
    saturation: str
    evidence: Evidence


@dataclass(frozen=True)
class _Silent:
    """Identification of torque laws in one configuration."""

    record: Path
    index: int
    stated: tuple[TorqueLaw, ...]
    start: tuple[TorqueLaw, ...]
    delay_s: float


def _identify(task: _Silent) -> LawEstimate:
    record = record_from_artifact(read_artifact(task.record, RECORD, row=task.index))
    return identify_laws(record, task.start or task.stated, task.delay_s)


def _identified(
    job: Job, path: Path, n_conf: int, stated: tuple[TorqueLaw, ...], delay: float
) -> tuple[tuple[TorqueLaw, ...], tuple[str, ...]]:
    """Laws that some configurations, evenly spread, show at their silent lines, and what to say about them."""
    count = min(n_conf, job.campaign.estimate.silent_configurations)
    chosen = np.unique(np.linspace(0, n_conf - 1, count).round().astype(int)).tolist()
    start = start_laws(record_from_artifact(read_artifact(path, RECORD, row=chosen[0])), stated, delay)
    tasks = [_Silent(path, index, stated, start, delay) for index in chosen]
    estimates = job.map(_identify, tasks, lambda _index, _result: None)
    names = tuple(joint.name for joint in job.loaded.robot.joints)
    laws, notes = combine_laws(estimates, start, stated, names)
    share = 100 * float(np.median([estimate.explained for estimate in estimates], axis=0).min())
    told = f"Friction and ripple were identified at the silent lines of {counted(len(chosen), 'configuration')}"
    return laws, (f"{told}: they explain at least {share:.3g} % of each motor's torque there.", *notes)


def _chosen(
    job: Job, path: Path, n_conf: int, stated: tuple[TorqueLaw, ...], delay: float
) -> tuple[tuple[TorqueLaw, ...], tuple[str, ...]]:
    """Laws from the silent lines; where these refuse, under `auto`, the robot file's, and why."""
    try:
        return _identified(job, path, n_conf, stated, delay)
    except np.linalg.LinAlgError:
        remedy = "use `compensation: nominal` or `none`"
        refusal = DataError("D195 the silent lines determine no law", where="compensation: silent_lines", remedy=remedy)
    except DataError as error:
        refusal = error
    if job.campaign.estimate.compensation != "auto":
        raise refusal
    known = any(law.coulomb_nm > 0 for law in stated)
    instead = "the robot file's was subtracted (`nominal`)" if known else "the robot file has none to subtract"
    note = f"Friction could not be identified at the silent lines, {instead}: {refusal.what}."
    job.progress.warn(note)
    return stated, (note,)


def _fitted(job: Job, fit: str, stated: tuple[TorqueLaw, ...]) -> tuple[tuple[TorqueLaw, ...], tuple[str, ...]]:
    """Laws whose levels a fit of rigid dynamics found, and what to say about them."""
    acquire = None if job.campaign.source is None else job.campaign.source.acquire
    currents = acquire is not None and any(channel.normalised for channel in acquire.inputs)
    joints = [joint.name for joint in job.loaded.robot.joints]
    model = read_artifact(job.inputs["friction"], MODEL)
    found = friction_from_artifact(model, fit, joints, "A" if currents else "N m")
    laws = with_levels(stated, found.coulomb_nm, found.coulomb_std, found.uneven_nms_rad)
    return laws, (f"Coulomb friction is that of fit {fit}; breakaway and bristles have the robot file's shape.",)


def _estimate_part(task: _Task) -> _Brief:
    unread = () if task.options.estimator in READS_REFERENCE else ("reference",)
    record = record_from_artifact(read_artifact(task.record, RECORD, row=task.index, leave_out=unread))
    frf = estimate_frf(record, task.options, task.laws, task.delay_s)
    frf = replace(frf, notes=(*frf.notes, *task.notes))
    task.parts.write(task.index, frf_to_artifact(frf, Provenance(stage=_STAGE)))
    return _brief(frf)


def run(job: Job) -> str:
    """Estimates a campaign's frequency responses; returns its key figures."""
    if job.campaign.is_response:
        return _given(job, responses.estimate(job))
    path = job.inputs["record"]
    options = job.campaign.estimate
    n_conf = read_outline(path, RECORD).n_rows
    notes: tuple[str, ...] = ()
    laws, delay = stated_laws(job.loaded, job.campaign, options)
    if options.friction_fit is not None and laws is not None:
        laws, notes = _fitted(job, options.friction_fit, laws)
    elif job.campaign.is_arbitrary and options.compensation == "auto" and laws is not None:
        notes = ("An arbitrary signal leaves no line silent: friction was subtracted as the robot file has it.",)
    elif options.compensation in IDENTIFYING and laws is not None:
        laws, notes = _chosen(job, path, n_conf, laws, delay)
    elif laws is None and options.compensation == "auto":
        notes = ("No friction was subtracted: the log does not have the torques and then the angles of all motors.",)
    parts = Parts(job.output, FRF, job.key)
    todo = [index for index in range(n_conf) if not parts.has(index)]
    job.progress.expect(n_conf, "configurations", n_conf - len(todo))
    tasks = [_Task(parts, path, index, options, laws, delay, notes) for index in todo]
    briefs = [_brief(frf_from_artifact(parts.read(index))) for index in range(n_conf) if index not in todo]
    briefs += job.map(_estimate_part, tasks, lambda _index, _result: job.progress.advance())
    parts.merge(n_conf, job.provenance())
    return _told(job, briefs)


def _given(job: Job, frf: Frf) -> str:
    """What is to be said of responses that were measured elsewhere."""
    return _told(job, [_brief(frf.select([index])) for index in range(len(frf.configurations))])


def _told(job: Job, briefs: Sequence[_Brief]) -> str:
    """Warns of what is doubtful about the responses; returns their key figures."""
    for finding in dict.fromkeys(finding for brief in briefs for finding in brief.findings):
        job.progress.warn(finding)
    for told in contradictions(job.loaded, job.owner, join_evidence([brief.evidence for brief in briefs])):
        job.progress.warn(told)
    return _phrase(briefs)


def stated_laws(
    loaded: LoadedExperiment, campaign: Campaign, options: EstimateOptions
) -> tuple[tuple[TorqueLaw, ...] | None, float]:
    """Returns the robot file's torque laws and the delay [s], where these options compensate."""
    if options.compensation == "none" or loaded.experiment.robot is None:
        return None, 0.0
    laws = tuple(joint.motor.torque_law for joint in loaded.robot.to_robot().joints)
    acquire = None if campaign.source is None else campaign.source.acquire
    if acquire is not None and options.compensation == "auto":
        logged = ([one.channel for one in side] for side in (acquire.inputs, acquire.outputs))
        if not shows_friction(*logged):
            return None, 0.0
    if acquire is not None and any(channel.normalised for channel in acquire.inputs):
        # Levels in N m say nothing about a current with an unknown torque constant.
        laws = tuple(law.silenced() for law in laws)
    return laws, delay_s(loaded, campaign)


def phrase(_loaded: LoadedExperiment, _owner: str, output: Path) -> str:
    """Says what was estimated, in a phrase."""
    n_conf = read_outline(output, FRF).n_rows
    return _phrase([_brief(frf_from_artifact(read_artifact(output, FRF, row=row))) for row in range(n_conf)])


def _brief(frf: Frf) -> _Brief:
    levels = {kind: frf.response_level(kind) for kind in LEVELS}
    return _Brief(
        size=f"{frf.response.shape[2]} x {frf.response.shape[3]} response at {counted(len(frf.lines), 'line')}",
        relative_std=_relative(np.sqrt(frf.element_variance()), frf),
        levels={kind: _relative(level, frf) for kind, level in levels.items() if level is not None},
        removed_rms=float(frf.removed_torque_rms.max(initial=0.0)),
        torque_unit=frf.input_unit,
        findings=tuple(note for note in frf.notes if is_finding(note)),
        saturation=saturation_text(frf),
        evidence=gather_evidence(frf),
    )


def _phrase(briefs: Sequence[_Brief]) -> str:
    text, unit = briefs[0].size, briefs[0].torque_unit
    diagonal = np.concatenate([brief.relative_std for brief in briefs])
    if np.any(diagonal > 0):
        text += f", standard deviation {100 * float(np.median(diagonal)):.2g} % (median, diagonal)"
    levels = {kind: np.median(np.concatenate([brief.levels[kind] for brief in briefs])) for kind in briefs[0].levels}
    if levels:
        text += f", at silent lines {', '.join(f'{kind} {100 * float(level):.2g} %' for kind, level in levels.items())}"
    removed = max(brief.removed_rms for brief in briefs)
    text += f", up to {removed:.2g} {unit} RMS of friction subtracted" if removed > 0 else ""
    clipped = next((brief.saturation for brief in briefs if brief.saturation), "")
    return f"{text}; do not trust it: {clipped}" if clipped else text


def _relative(level: FloatArray, frf: Frf) -> FloatArray:
    """A level over the size of the motors' own responses, of those that the lines tell of."""
    told = ~np.diagonal(np.broadcast_to(dropped_lines(frf)[:, :, None], level.shape), axis1=-2, axis2=-1)
    own, size = (np.diagonal(each, axis1=-2, axis2=-1)[told] for each in (level, np.abs(frf.response)))
    return np.asarray(own / size)


def contradictions(loaded: LoadedExperiment, campaign: str, evidence: Evidence) -> tuple[str, ...]:
    """Says what of a campaign's data contradicts the robot file, and what its data cannot tell.

    The robot file is read anew each time and nothing of this is stored: a corrected file makes no response stale.
    Where the robot cannot be built, there is nothing to compare with; the stages that need it say so.
    """
    if loaded.experiment.robot is None:
        return ()
    settings = loaded.experiment.campaigns[campaign]
    try:
        robot, declared_s = loaded.robot.to_robot(settings.payload_kg), delay_s(loaded, settings)
        findings, notes = evidence_findings(robot, evidence, declared_s)
    except (DataError, SettingsError):
        return ()
    return tuple(f"Campaign {campaign}: {told}." for told in (*(finding.sentence for finding in findings), *notes))
