"""export: a fitted model for other programs, as MJCF, tables of parameters, MAT or state space."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from robid.artifacts.atomic import replacing
from robid.artifacts.model import MODEL, model_from_artifact
from robid.artifacts.store import read_artifact
from robid.errors import ArtifactError, SettingsError
from robid.settings.load import LoadedExperiment
from robid.stages.export_content import COLUMNS, FittedExport, arrays, mjcf, parameter_records, state_spaces
from robid.stages.export_files import Content, encode_csv, encode_json, encode_mat, encode_npz
from robid.stages.fit import frf_inputs, read_frf
from robid.stages.replacing import check_replaceable
from robid.stages.stage import Plan

Format: TypeAlias = Literal["mjcf", "json", "csv", "mat", "statespace"]

_DEFAULT_NAMES: dict[Format, str] = {
    "mjcf": "model.xml",
    "json": "parameters.json",
    "csv": "parameters.csv",
    "mat": "model.mat",
    "statespace": "statespace.mat",
}
_SUFFIXES: dict[Format, tuple[str, ...]] = {
    "mjcf": (".xml",),
    "json": (".json",),
    "csv": (".csv",),
    "mat": (".mat",),
    "statespace": (".mat", ".json", ".npz"),
}
_ENCODERS: dict[str, Callable[[Content], bytes]] = {".mat": encode_mat, ".json": encode_json, ".npz": encode_npz}


@dataclass(frozen=True)
class ExportOptions:
    """What to export.

    Attributes:
        format: The format.
        configuration: Index of one configuration of the campaign; None for all of the fit.
        friction: MJCF only: whether friction and ripple are in; None where nothing was said.
        output: Where to; None for the fit's folder.
    """

    format: Format
    configuration: int | None = None
    friction: bool | None = None
    output: Path | None = None

    def target(self, folder: Path, fit: str) -> Path:
        """Returns where the file goes."""
        return self.output or folder / "fits" / fit / "export" / _DEFAULT_NAMES[self.format]


def export_plan(loaded: LoadedExperiment, fit: str) -> Plan:
    """Returns what an export reads; what it writes depends on its options."""
    return Plan((), {}, {"model": f"fits/{fit}/model.h5", **frf_inputs(loaded.experiment.fits[fit])})


def check_options(options: ExportOptions, loaded: LoadedExperiment, fit: str) -> None:
    """Refuses options that do not belong together, all at once, before anything is read.

    Raises:
        SettingsError: With every problem.
    """
    problems = []
    suffixes = _SUFFIXES[options.format]
    if options.output is not None and options.output.suffix not in suffixes:
        problems.append(f"`--output {options.output}` must end with {' or '.join(suffixes)} for `{options.format}`")
    if options.friction is not None and options.format != "mjcf":
        problems.append(f"`--friction` and `--no-friction` are for `mjcf`, not for `{options.format}`")
    if options.configuration is not None and options.format in ("json", "csv"):
        problems.append(f"`{options.format}` holds parameters, which have no `--configuration`")
    listed = loaded.experiment.fits[fit].configurations
    if options.configuration is not None and listed is not None and options.configuration not in listed:
        problems.append(f"fit `{fit}` has no configuration {options.configuration} (it has {_shown(listed)})")
    if problems:
        raise SettingsError("; ".join(problems), where="export", remedy="`robid export --help` says what goes together")


def export(options: ExportOptions, loaded: LoadedExperiment, fit: str, inputs: Mapping[str, Path]) -> bytes:
    """Makes the content of the exported file.

    Args:
        options: What to export; checked.
        loaded: The experiment.
        fit: Name of the fit.
        inputs: Its `model` and the `frf` that it was fitted to.

    Raises:
        SettingsError: If the configuration does not exist.
        DataError: If the fitted values make no mechanical model.
    """
    model = read_artifact(inputs["model"], MODEL)
    settings = loaded.experiment.fits[fit]
    listed, frf = settings.configurations, read_frf(settings, inputs)
    chosen = tuple(listed) if listed is not None else tuple(range(len(frf.configurations)))
    found = FittedExport(loaded, fit, model.provenance.finished_utc, model_from_artifact(model), frf, chosen)
    rows = _rows(found, options.configuration)
    if options.format == "mjcf":
        return mjcf(found, rows, friction=options.friction is not False).encode()
    if options.format == "json":
        return encode_json(
            {**found.origin, "confidence": found.solution.confidence, "parameters": parameter_records(found)}
        )
    if options.format == "csv":
        return encode_csv(COLUMNS, [list(record.values()) for record in parameter_records(found)])
    if options.format == "mat":
        return encode_mat(arrays(found, rows))
    suffix = options.target(Path(), fit).suffix
    return _ENCODERS[suffix](state_spaces(found, rows))


def write_export(path: Path, content: bytes, read: Mapping[str, Path], *, force: bool) -> Literal["made", "fresh"]:
    """Writes an exported file; one that differs may have been edited by hand, and is replaced only by force.

    Args:
        path: Where to.
        content: What to write.
        read: Files that are never replaced, by what they are; nor is anything that was not exported.
        force: Whether to replace one that differs.

    Raises:
        ArtifactError: If it differs and `force` is not set, is something else, or cannot be written.
    """
    check_replaceable(path, "export", read)
    if path.exists() and not force:
        if path.read_bytes() == content:
            return "fresh"
        raise ArtifactError(
            "The file is there, but differs from what would be written.",
            where=str(path),
            remedy="`--force` replaces it, `--output` writes elsewhere",
        )
    with replacing(path) as partial:
        partial.write_bytes(content)
    return "made"


def _rows(found: FittedExport, configuration: int | None) -> list[int]:
    if configuration is None:
        return list(range(len(found.chosen)))
    if configuration not in found.chosen:
        message = f"fit `{found.name}` has no configuration {configuration} (it has {_shown(found.chosen)})"
        raise SettingsError(message, where="--configuration", remedy="name one of them, or none for all")
    return [found.chosen.index(configuration)]


def _shown(configurations: tuple[int, ...]) -> str:
    return ", ".join(map(str, configurations))
