"""Exporting a fitted model, or the excitation or the responses of a campaign."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from robid.arrays import Meaning
from robid.artifacts.atomic import locked
from robid.commands.output import Answer, print_json
from robid.commands.shared import choose_node, lock_of, make_shell, require_inputs
from robid.pipeline.export import ExportOptions, check_options, export, export_plan, export_target, write_export
from robid.pipeline.export_campaign import (
    ExcitationExport,
    FrfExport,
    check_excitation_export,
    check_frf_export,
    excitation_export_plan,
    export_excitation,
    export_frf,
    frf_export_plan,
)
from robid.pipeline.freshness import settings_files
from robid.pipeline.graph import Run


@dataclass(frozen=True)
class ExportAnswer(Answer, type="export"):
    """What was written for other programs."""

    output: Annotated[str, Meaning("The file or folder that was asked for.")]
    format: Annotated[str, Meaning("Its format.")]
    files: Annotated[Mapping[str, Literal["made", "fresh"]], Meaning("`made`, or `fresh` where it was there, by file.")]
    problem: Annotated[str, Meaning("What went wrong numerically in the fit; empty when all is well.")] = ""


def export_fit(run: Run, fit: str | None, options: ExportOptions, *, force: bool, as_json: bool) -> int:
    """Exports a fit; returns the exit code."""
    node = choose_node(run, "fit", fit)
    check_options(options, run.loaded, node.owner)
    inputs = require_inputs(run, dataclasses.replace(node, plan=export_plan(run.loaded, node.owner)), [])
    content = export(options, run.loaded, node.owner, inputs)
    target = export_target(options, run.loaded, node.owner, run.folder)
    with locked(lock_of(run, target), f"robid export {run.loaded.path}"):
        outcome = write_export(target, content, {**settings_files(run.loaded), **inputs}, force=force)
    shell = make_shell(run, as_json=as_json)
    problem = node.stage.problem(inputs["model"])
    if as_json:
        print_json(ExportAnswer(str(target), options.format, {str(target): outcome}, problem))
    else:
        shell.say(f"{target}  {outcome}")
    if problem:
        shell.warn(problem)
    return 0


def export_campaign(run: Run, options: ExcitationExport, others: Sequence[str], *, force: bool, as_json: bool) -> int:
    """Exports the excitation of a campaign, which takes no options of a fit; returns the exit code."""
    check_excitation_export(options, others)
    node = choose_node(run, "design-excitation", options.campaign)
    plan = excitation_export_plan(node.owner)
    inputs = require_inputs(run, dataclasses.replace(node, plan=plan), [])
    files = export_excitation(options, run.loaded, inputs["excitation"], run.folder)
    read = {**settings_files(run.loaded), **inputs}
    return _write(run, files, options.target(run.folder), options.format, read, force=force, as_json=as_json)


def export_response(
    run: Run, campaign: str | None, options: FrfExport, others: Sequence[str], *, force: bool, as_json: bool
) -> int:
    """Exports the responses of a campaign, the only one where none is named; returns the exit code."""
    check_frf_export(options, others)
    node = choose_node(run, "estimate-frf", campaign)
    chosen = dataclasses.replace(options, campaign=node.owner)
    inputs = require_inputs(run, dataclasses.replace(node, plan=frf_export_plan(node.owner)), [])
    files = export_frf(chosen, run.loaded, inputs["frf"], run.folder)
    read = {**settings_files(run.loaded), **inputs}
    return _write(run, files, chosen.target(run.folder), chosen.format, read, force=force, as_json=as_json)


def _write(
    run: Run,
    files: Mapping[Path, bytes],
    target: Path,
    form: str,
    read: Mapping[str, Path],
    *,
    force: bool,
    as_json: bool,
) -> int:
    with locked(lock_of(run, target), f"robid export {run.loaded.path}"):
        outcomes = {str(path): write_export(path, content, read, force=force) for path, content in files.items()}
    if as_json:
        print_json(ExportAnswer(str(target), form, outcomes))
        return 0
    shell = make_shell(run, as_json=False)
    for path, outcome in outcomes.items():
        shell.say(f"{path}  {outcome}")
    return 0
