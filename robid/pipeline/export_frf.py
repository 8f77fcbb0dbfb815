"""export --campaign --what frf: the responses of a campaign for other programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.errors import SettingsError, require_module
from robid.pipeline.frf_formats import Response, response_json, response_mat, response_tables, response_uff
from robid.pipeline.stage import Plan
from robid.settings.load import LoadedExperiment

_WHERE = "export"


@dataclass(frozen=True)
class _Format:
    """A format: the file's name, suffixes that it may have, and what writes it; a folder of tables without a writer."""

    file: str
    suffixes: tuple[str, ...]
    write: Callable[[Response], bytes] | None = None


_FORMATS = {
    "csv": _Format("", ()),
    "mat": _Format("frf.mat", (".mat",), response_mat),
    "json": _Format("frf.json", (".json",), response_json),
    "uff": _Format("frf.uff", (".uff", ".unv"), response_uff),
}


@dataclass(frozen=True)
class FrfExport:
    """What to export.

    Attributes:
        campaign: The campaign.
        format: `csv`, one table for each configuration, or `mat`, `json`, `uff`, all in one file.
        configuration: Index of one configuration; None for all.
        output: Folder of the tables, or the file; None for the campaign's folder.
    """

    campaign: str
    format: str
    configuration: int | None = None
    output: Path | None = None

    def target(self, folder: Path) -> Path:
        """Returns the folder of the tables, or the file."""
        return self.output or folder / self.campaign / "export" / _FORMATS[self.format].file


def check_frf_export(options: FrfExport, others: Sequence[str]) -> None:
    """Refuses options that do not belong to a response, and a format whose package is missing.

    Args:
        options: What to export.
        others: Further options that were given.

    Raises:
        SettingsError: With every problem.
    """
    problems = [f"S103 `{option}` is for a fit, not for the responses of a campaign" for option in others]
    if options.format in {"h5", "hdf5"}:
        problems.append(
            f"S104 `{options.campaign}/frf.h5` in the run folder is HDF5 already (`robid inspect` describes it)"
        )
    elif options.format not in _FORMATS:
        known = ", ".join(f"`{name}`" for name in _FORMATS)
        problems.append(f"S105 responses are exported as one of {known}, not as `{options.format}`")
    elif options.output is not None:
        problems += _output_problems(options.output, _FORMATS[options.format].suffixes)
    if problems:
        raise SettingsError("; ".join(problems), where=_WHERE, remedy="`robid export --help` says what goes together")
    if options.format == "uff":
        require_module("pyuff", "uff", "Writing UFF58")


def _output_problems(output: Path, suffixes: tuple[str, ...]) -> list[str]:
    if suffixes and output.suffix not in suffixes:
        return [f"S106 `--output {output}` must end with {' or '.join(suffixes)}"]
    if not suffixes and output.suffix:
        return [f"S107 `--output {output}` must be a folder for one table per configuration"]
    return []


def frf_export_plan(campaign: str) -> Plan:
    """Returns what the export of responses reads."""
    return Plan((), {}, {"frf": f"{campaign}/frf.h5"})


def export_frf(options: FrfExport, loaded: LoadedExperiment, source: Path, folder: Path) -> dict[Path, bytes]:
    """Makes the content of every exported file, by its path.

    Args:
        options: What to export; checked.
        loaded: The experiment.
        source: The artifact of the responses.
        folder: The run folder.

    Raises:
        SettingsError: If the configuration does not exist.
    """
    frf = frf_from_artifact(read_artifact(source, FRF))
    numbers = _numbers(options, len(frf.configurations))
    joints = tuple(joint.name for joint in loaded.robot.joints)
    response = Response(
        experiment=loaded.experiment.name,
        campaign=options.campaign,
        joints=joints,
        numbers=tuple(numbers),
        frf=frf.select(numbers),
    )
    target, write = options.target(folder), _FORMATS[options.format].write
    if write is not None:
        return {target: write(response)}
    tables = response_tables(response)
    return {target / f"frf_c{number + 1}.csv": table for number, table in zip(numbers, tables, strict=True)}


def _numbers(options: FrfExport, count: int) -> list[int]:
    if options.configuration is None:
        return list(range(count))
    if options.configuration >= count:
        what = (
            f"S108 campaign `{options.campaign}` has no configuration {options.configuration} (it has 0 to {count - 1})"
        )
        raise SettingsError(what, where="--configuration", remedy="name one of them, or none for all")
    return [options.configuration]
