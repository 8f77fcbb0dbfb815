"""export: a fitted model for other programs, in the formats of its family."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from robid.artifacts.atomic import replacing
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.errors import ArtifactError, SettingsError
from robid.files import read_regular
from robid.models.family import Export, ExportTask, family_of
from robid.pipeline.fit import read_data
from robid.pipeline.freshness import check_replaceable
from robid.pipeline.plans import data_inputs, taken_inputs
from robid.pipeline.stage import Plan
from robid.settings.load import LoadedExperiment


@dataclass(frozen=True)
class ExportOptions:
    """What to export."""

    format: str  # the format, one of the family's
    configuration: int | None = None  # index of one configuration of the campaign; None for all of the fit
    friction: bool | None = None  # whether friction and ripple are in; None where nothing was said
    output: Path | None = None  # where to; None for the fit's folder


def export_plan(loaded: LoadedExperiment, fit: str) -> Plan:
    """Returns what an export reads; what it writes depends on its options."""
    settings = loaded.experiment.fits[fit]
    inputs = {**data_inputs(family_of(loaded, fit).reads, settings.campaigns), **taken_inputs(settings)}
    return Plan((), {}, {"model": f"fits/{fit}/model.h5", **inputs})


def export_target(options: ExportOptions, loaded: LoadedExperiment, fit: str, folder: Path) -> Path:
    """Returns where the file goes."""
    return options.output or folder / "fits" / fit / "export" / _format(options, loaded, fit).file


def _format(options: ExportOptions, loaded: LoadedExperiment, fit: str) -> Export:
    family = family_of(loaded, fit)
    if options.format not in family.exports:
        known = ", ".join(f"`{name}`" for name in family.exports)
        message = f"S095 a fit of family `{family.name}` is not written as `{options.format}`"
        raise SettingsError(message, where="export --format", remedy=f"choose one of {known}")
    return family.exports[options.format]


def check_options(options: ExportOptions, loaded: LoadedExperiment, fit: str) -> None:
    """Refuses options that do not belong together, all at once, before anything is read.

    Raises:
        SettingsError: With every problem.
    """
    problems = []
    chosen = _format(options, loaded, fit)
    if options.output is not None and options.output.suffix not in chosen.suffixes:
        ends = " or ".join(chosen.suffixes)
        problems.append(f"S096 `--output {options.output}` must end with {ends} for `{options.format}`")
    if options.friction is not None and not chosen.takes_friction:
        others = [f"`{name}`" for name, each in family_of(loaded, fit).exports.items() if each.takes_friction]
        problems.append(
            f"S097 `--friction` and `--no-friction` are for {', '.join(others) or 'no format'}, not for "
            f"`{options.format}`"
        )
    if options.configuration is not None and not chosen.takes_configuration:
        problems.append(f"S098 `{options.format}` holds parameters, which have no `--configuration`")
    listed = loaded.experiment.fits[fit].configurations
    if options.configuration is not None and listed is not None and options.configuration not in listed:
        shown = ", ".join(str(one + 1) for one in listed)
        problems.append(f"S099 fit `{fit}` has no configuration {options.configuration + 1} (it has {shown})")
    if problems:
        raise SettingsError("; ".join(problems), where="export", remedy="`robid export --help` says what goes together")


def export(options: ExportOptions, loaded: LoadedExperiment, fit: str, inputs: Mapping[str, Path]) -> bytes:
    """Makes the content of the exported file; options are checked.

    Raises:
        SettingsError: If the configuration does not exist.
        DataError: If the fitted values make no mechanical model.
    """
    chosen = _format(options, loaded, fit)
    suffix = options.output.suffix if options.output is not None else Path(chosen.file).suffix
    data, model = read_data(loaded, fit, inputs), read_artifact(inputs["model"], MODEL)
    return chosen.make(ExportTask(data, model, options.configuration, options.friction, suffix))


def write_export(
    path: Path, content: bytes, read: Mapping[str, Path], *, force: bool, kind: str = "export"
) -> Literal["made", "fresh"]:
    """Writes an exported file over none that is read; one that differs, maybe by hand, is replaced only by force.

    Raises:
        ArtifactError: If it differs and `force` is not set, is something else, or cannot be written.
    """
    check_replaceable(path, kind, read)
    if path.exists() and not force:
        if read_regular(path) == content:
            return "fresh"
        message = "A030 The file is there, but differs from what would be written."
        raise ArtifactError(message, where=str(path), remedy="`--force` replaces it, `--output` writes elsewhere")
    with replacing(path) as partial:
        partial.write_bytes(content)
    return "made"
