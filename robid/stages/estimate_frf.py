"""estimate-frf: frequency responses of a campaign from its record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from robid.artifacts.artifact import Provenance
from robid.artifacts.frf import FRF, frf_from_artifact, frf_to_artifact
from robid.artifacts.parts import Parts
from robid.artifacts.record import RECORD, record_from_artifact
from robid.artifacts.store import read_artifact, write_artifact
from robid.frf.estimate import concatenate, estimate_frf
from robid.frf.frf import Frf
from robid.frf.options import EstimateOptions
from robid.robot.description import Motor
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.slices import to_plain
from robid.signals.friction import TorqueLaw
from robid.signals.record import Record
from robid.stages.slices import delay_s, robot_settings
from robid.stages.stage import Job, Plan, Stage, counted, measured_campaigns


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    campaign = loaded.experiment.campaigns[owner]
    settings: dict[str, Any] = {f"campaigns.{owner}.estimate": to_plain(campaign.estimate)}
    if campaign.estimate.compensation == "nominal":
        settings |= {"delay_s": delay_s(loaded, campaign), **robot_settings(loaded, "friction", "friction_std")}
    return Plan((f"{owner}/frf.h5",), settings, {"record": f"{owner}/record.h5"})


@dataclass(frozen=True)
class _Task:
    parts: Parts
    record: Record
    index: int
    options: EstimateOptions
    laws: tuple[TorqueLaw, ...] | None
    delay_s: float


def _estimate_part(task: _Task) -> None:
    frf = estimate_frf(task.record, task.options, task.laws, task.delay_s)
    task.parts.write(task.index, frf_to_artifact(frf, Provenance(stage=STAGE.name)))


def _run(job: Job) -> str:
    record = record_from_artifact(read_artifact(job.inputs["record"], RECORD))
    options = job.campaign.estimate
    laws, delay = stated_laws(job.loaded, job.campaign, options)
    n_conf = len(record.configurations)
    parts = Parts(job.output, FRF, job.key)
    todo = [index for index in range(n_conf) if not parts.has(index)]
    job.progress.expect(n_conf, "configurations", n_conf - len(todo))
    tasks = [_Task(parts, record.select(index), index, options, laws, delay) for index in todo]
    job.map(_estimate_part, tasks, lambda _index, _result: job.progress.advance())
    frf = concatenate([frf_from_artifact(parts.read(index)) for index in range(n_conf)])
    write_artifact(job.output, frf_to_artifact(frf, job.provenance(STAGE.name)))
    parts.finish()
    return figures(frf)


def stated_laws(
    loaded: LoadedExperiment, campaign: Campaign, options: EstimateOptions
) -> tuple[tuple[TorqueLaw, ...] | None, float]:
    """Returns the robot file's torque laws and the delay [s], as far as these options read them."""
    if options.compensation != "nominal":
        return None, 0.0
    return tuple(_law(joint.motor) for joint in loaded.robot.to_robot().joints), delay_s(loaded, campaign)


def _law(motor: Motor) -> TorqueLaw:
    law = motor.friction
    return TorqueLaw(
        coulomb_nm=law.coulomb_nm,
        static_nm=law.static_nm,
        stribeck_rad_s=law.stribeck_rad_s,
        presliding_rad=law.presliding_rad,
        relative_std=law.relative_std,
        ripple_nm=motor.ripple_nm,
        ripple_order=motor.ripple_order,
    )


def figures(frf: Frf) -> str:
    """Says what was estimated, in a phrase."""
    relative = np.sqrt(frf.element_variance()) / np.abs(frf.response)
    diagonal = np.diagonal(relative, axis1=-2, axis2=-1)
    text = f"{frf.response.shape[2]} x {frf.response.shape[3]} response at {counted(len(frf.lines), 'line')}"
    if np.any(diagonal > 0):
        text += f", standard deviation {100 * float(np.median(diagonal)):.2g} % (median, diagonal)"
    removed = float(frf.removed_torque_rms.max(initial=0.0))
    return f"{text}, up to {removed:.2g} {frf.torque_unit} RMS of friction subtracted" if removed > 0 else text


STAGE = Stage(
    "estimate-frf",
    "Estimates frequency responses with their covariance from a record.",
    "campaign",
    FRF,
    measured_campaigns,
    _plan,
    _run,
)
