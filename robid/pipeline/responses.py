"""Responses that were measured elsewhere: their files checked and recorded, and read as a campaign's responses."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.kinds import FILES, files_from_artifact, files_to_artifact, frf_to_artifact
from robid.artifacts.store import read_artifact, write_artifact
from robid.errors import DataError, SettingsError
from robid.frf.channels import response_kept
from robid.frf.files import ResponseFiles
from robid.frf.frf import Frf
from robid.pipeline.configurations import configurations_of
from robid.pipeline.plans import response_files
from robid.pipeline.response_files import TOLD, notes_of, read_responses
from robid.pipeline.stage import Job, counted
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.settings.sources import ResponseSource
from robid.signals.quantities import DRIVES


def check(job: Job) -> str:
    """Reads a campaign's files of responses once, and records what they are; returns its key figures."""
    configurations = configurations_of(job.loaded, job.campaign, job.inputs)
    frf, covariance = _read(job, configurations)
    refuse_inverse(job, frf)
    paths = response_files(job.loaded, job.campaign, _source(job))
    found = ResponseFiles(
        names=tuple(paths),
        sha256=tuple(job.input_hashes[name] for name in paths),
        size_bytes=np.array([path.stat().st_size for path in paths.values()]),
        configurations=configurations,
        n_line=frf.frequency_hz.size,
        lowest_hz=float(frf.frequency_hz[0]),
        highest_hz=float(frf.frequency_hz[-1]),
        covariance=covariance,
        notes=notes_of(covariance),
    )
    write_artifact(job.output, files_to_artifact(found, job.provenance()))
    return _phrase(found)


def phrase(output: Path) -> str:
    """Says what was recorded, in a phrase."""
    return _phrase(files_from_artifact(read_artifact(output, FILES)))


def estimate(job: Job) -> Frf:
    """Reads a campaign's responses and writes them."""
    found = files_from_artifact(read_artifact(job.inputs["files"], FILES))
    frf, _ = _read(job, found.configurations)
    write_artifact(job.output, frf_to_artifact(frf, job.provenance()))
    return frf


def _source(job: Job) -> ResponseSource:
    source = job.campaign.source
    if source is None or source.response is None:
        message = f"campaign {job.owner} has no responses"
        raise RuntimeError(message)
    return source.response


def _phrase(found: ResponseFiles) -> str:
    size = f"{counted(len(found.names), 'file')} of responses, no record: "
    band = f"{counted(found.n_line, 'line')} from {found.lowest_hz:.4g} to {found.highest_hz:.4g} Hz"
    return f"{size}{counted(len(found.configurations), 'configuration')}, {band}; {TOLD[found.covariance]}"


def _read(job: Job, configurations: FloatArray) -> tuple[Frf, str]:
    source, folder = _source(job), job.loaded.path.parent
    files = [source.paths(folder, index) for index in range(len(configurations) if source.is_numbered else 1)]
    kept, units = response_kept(job.campaign.estimate), job.loaded.robot.joint_units
    return read_responses(files, source, configurations, units, accelerations=kept)


_FAR, _NEAR = 10.0, 2.0  # factors


def refuse_inverse(job: Job, frf: Frf) -> None:
    """Refuses responses that are far from the robot file's, while their inverses are near it.

    Where the robot cannot be built, there is nothing to compare with; the stages that need it say so.

    Raises:
        DataError: If it is so.
    """
    driven = all(one.quantity in DRIVES for one in frf.input_channels)
    own = [name for name in frf.input_names if name in frf.output_names]
    if job.loaded.experiment.robot is None or not driven or not own:
        return
    try:
        robot = job.loaded.robot.to_robot(job.campaign.payload_kg)
        model = build_model(robot)
        linear = linearize(model, solve_statics(model, frf.configurations[:1]))
        nominal = response(linear, nominal_parameters(robot, linear, 0.0), frf.frequency_hz, None).sampled[0]
    except (DataError, SettingsError):
        return
    joints = [joint.name for joint in robot.joints]
    ratios = []
    for name in own:
        if name in joints:
            measured = frf.known_response[0, :, frf.output_names.index(name), frf.input_names.index(name)]
            stated = nominal[:, joints.index(name), joints.index(name)]
            ratios.append(np.abs(np.array([measured / stated, 1 / (measured * stated)])))
    told = np.nanmedian(np.abs(np.log(np.concatenate(ratios, axis=1))), axis=1) if ratios else np.zeros(2)
    if told[0] > np.log(_FAR) and told[1] < np.log(_NEAR):
        what = "D642 the response looks like the inverse of the robot's: motions in, torques out"
        remedy = "export it from torque to motion"
        raise DataError(what, remedy=remedy)
