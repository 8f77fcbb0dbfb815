"""The position-dependent family's fit and validation: settings and artifacts in, artifacts out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.results import grade_from_artifact
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.quality import saturated_signals
from robid.models.family import Data, Work
from robid.models.lpv.files import model_of, solution_from_artifact, validation_from_artifact, validation_of
from robid.models.lpv.fit.channels import channel_indices, local_responses
from robid.models.lpv.fit.fitting import fit_lpv
from robid.models.lpv.fit.model import is_outside
from robid.models.lpv.fit.responses import LocalResponses
from robid.models.lpv.fit.solution import Ports
from robid.models.lpv.fit.state_space import block_names
from robid.models.lpv.judge import assess_lpv, validate_lpv
from robid.models.lpv.settings import LpvFit, lpv_fit
from robid.results.finding import Finding, saturation_findings
from robid.settings.load import LoadedExperiment
from robid.signals.quantities import Channel
from robid.simulate.truth import TrueRobot

_SAME = 1e-3  # rad, or m
_STILL = 0.1  # of the range, up to which an output that schedules may move in one position


def fit(data: Data, work: Work) -> Artifact:
    """Fits a model and grades it by itself."""
    settings = lpv_fit(data.loaded.experiment, data.name)
    work.progress.expect(1, "fits")
    frf, held_back = data.response, _held_back(data, settings)
    if held_back.all():
        message = "D175 `choose_on` leaves no configuration to fit"
        raise DataError(message, where=f"fits.{data.name}", remedy="leave it fewer of them")
    own, choosing = (frf.select(np.flatnonzero(rows).tolist()) for rows in (~held_back, held_back))
    ports = ports_of(own, data.loaded, settings)
    fitted, judging = (responses_of(one, data.loaded, settings) for one in (own, choosing))
    ends = fitted.points.min(axis=0), fitted.points.max(axis=0)
    _refuse_outside(judging.points, *ends, ports, "leave the ends of the range to the fit, and choose in between")
    try:
        solution = fit_lpv(
            fitted,
            judging,
            ports,
            settings.basis,
            settings.options(),
            degrees_of_freedom=frf.degrees_of_freedom,
            confidence=settings.confidence,
            identifiable_relative_std=settings.identifiable_relative_std,
        )
    except DataError as error:
        # A position goes by its scheduling parameters in place of its number.
        word, _, number = error.where.partition(" ")
        if word != "position":
            raise
        place = ports.place(fitted.points[int(number)])
        raise DataError(error.what, where=place, remedy=error.remedy) from error
    work.progress.advance()
    told = [*findings_of_scheduling(frf, data.loaded, settings), *findings_of_signals(frf, settings)]
    return model_of(solution, assess_lpv(solution, told))


def _refuse_outside(points: FloatArray, lower: FloatArray, upper: FloatArray, ports: Ports, remedy: str) -> None:
    """Refuses positions beyond those of the fit, where its functions may do anything."""
    outside = is_outside(points, lower, upper)
    if outside.any():
        told = f"The model is valid from {ports.place(lower)} to {ports.place(upper)}"
        raise DataError(
            f"D176 {told}, which leaves a position out.", where=ports.place(points[outside][0]), remedy=remedy
        )


def validate(data: Data, model: Artifact, _true: TrueRobot | None = None) -> Artifact:
    """Holds a model against responses that it never saw; no robot file states poles."""
    settings = lpv_fit(data.loaded.experiment, data.name)
    frf, solution = data.response, solution_from_artifact(model)
    ports, responses = ports_of(frf, data.loaded, settings), responses_of(frf, data.loaded, settings)
    remedy = "validate at positions within the range, or fit positions further out"
    _refuse_outside(responses.points, solution.basis.lower, solution.basis.upper, ports, remedy)
    findings = grade_from_artifact(model).findings
    return validation_of(validate_lpv(solution, ports, responses, frf.degrees_of_freedom, findings))


def misfits(model: Artifact, validation: Artifact | None) -> dict[str, float]:
    """Error over response, in the median over positions and elements."""
    held = {"relative error": solution_from_artifact(model).own}
    if validation is not None:
        held["relative error of the validation"] = validation_from_artifact(validation).held
    return {name: float(np.nanmedian(each.agreement.relative_error)) for name, each in held.items()}


def phrase_of_model(model: Artifact) -> str:
    """Says how the fit ended, in a phrase, from its artifact."""
    solution = solution_from_artifact(model)
    kept = solution.blocks.kept
    dropped = ", ".join(block_names(~kept)) or "none"
    return (
        f"{solution.estimate.status}, {solution.core.n_state} states, {int(kept.sum())} of {kept.size} blocks "
        f"(dropped: {dropped}), largest pole {solution.largest_pole:.4f}"
    )


def responses_of(frf: Frf, loaded: LoadedExperiment, settings: LpvFit) -> LocalResponses:
    """Returns the responses of a fit's channels at the values of its scheduling parameters.

    Raises:
        DataError: If a channel or a scheduling parameter is not there.
    """
    outputs, inputs = _channels(frf, settings)
    return local_responses(frf, _points(frf, loaded, settings), outputs, inputs)


def ports_of(frf: Frf, loaded: LoadedExperiment, settings: LpvFit) -> Ports:
    """Returns channels and scheduling parameters of a fit."""
    outputs, inputs = _channels(frf, settings)
    used = [frf.input_channels[index] for index in inputs], [frf.output_channels[index] for index in outputs]
    joints, measured = _joints(frf, loaded), frf.measured_channels or frf.output_channels
    known = {name: channel.unit for name, channel in zip(frf.output_names, measured, strict=False)}
    known |= dict(zip(joints, frf.joint_units or ("rad",) * len(joints), strict=False))
    units = [known[name] for name in settings.scheduling]
    return Ports(*_names(used[0]), *_names(used[1]), settings.scheduling, tuple(units), frf.sampling_period_s)


def _names(channels: Sequence[Channel]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return tuple(one.name for one in channels), tuple(one.unit for one in channels)


def _held_back(data: Data, settings: LpvFit) -> BoolArray:
    """Which configurations (n_conf,) only choose the structure."""
    if isinstance(settings.choose_on, str):
        rows = np.array([origin == settings.choose_on for origin in data.origins], bool)
    else:
        rows = np.isin(np.array(data.configurations), settings.choose_on)
    if not rows.any():
        message = "D177 `choose_on` names no configuration that the fit reads"
        raise DataError(message, where=f"fits.{data.name}", remedy="name some of them, or a campaign of `from`")
    return np.asarray(rows)


def _channels(frf: Frf, settings: LpvFit) -> tuple[IntArray, IntArray]:
    return channel_indices(frf, settings.outputs, settings.inputs, "fits")


def _points(frf: Frf, loaded: LoadedExperiment, settings: LpvFit) -> FloatArray:
    """Values (n_conf, n_scheduling) of the scheduling parameters."""
    columns = []
    for name in settings.scheduling:
        joints = _joints(frf, loaded)
        if name in joints:
            columns.append(frf.configurations[:, joints.index(name)])
        elif name in frf.output_names and frf.mean_output is not None:
            columns.append(frf.mean_output[:, frf.output_names.index(name)])
        else:
            message = f"D179 the responses do not say where `{name}` was"
            remedy = "schedule by a joint whose positions the campaign names, or by an output with its mean"
            raise DataError(message, where="fits.scheduling", remedy=remedy)
    return np.column_stack(columns)


def _joints(frf: Frf, loaded: LoadedExperiment) -> tuple[str, ...]:
    names = tuple(joint.name for joint in loaded.robot.joints)
    return names if frf.configurations.shape[1:] == (len(names),) else ()


def findings_of_scheduling(frf: Frf, loaded: LoadedExperiment, settings: LpvFit) -> Iterator[Finding]:
    """Yields findings about where the responses were measured: joints that moved, outputs about their mean."""
    joints = _joints(frf, loaded)
    spread = np.ptp(frf.configurations, axis=0) if joints else np.zeros(0)
    pairs = zip(joints, spread.tolist(), strict=True)
    stood = [name for name, width in pairs if width > _SAME and name not in settings.scheduling]
    if stood:
        told = f"{', '.join(stood)} stood elsewhere in other configurations, of which the model knows nothing"
        yield Finding("model", told, decisive=False, strength=1.5)
    if frf.mean_output is None or frf.motion_rms is None:
        return
    for name in (one for one in settings.scheduling if one not in joints):
        column = frf.output_names.index(name)
        width = max(float(np.ptp(frf.mean_output[:, column])), np.finfo(float).tiny)
        moved = float(np.nanmax(frf.motion_rms[:, column], initial=0.0))
        if moved > _STILL * width:
            told = f"{name} moved by {moved / width:.0%} (rms) of its range while it was measured, limit {_STILL:.0%}"
            yield Finding("unsteady", told, decisive=moved > width, strength=moved / (_STILL * width))


def findings_of_signals(frf: Frf, settings: LpvFit) -> tuple[Finding, ...]:
    """Returns findings about the signals of a fit's own inputs and outputs."""
    outputs, inputs = (at.tolist() for at in _channels(frf, settings))
    return saturation_findings(saturated_signals(frf, inputs, outputs))
