"""The ledger of a row, `row.json`: what it was made from, what became of it, and whether that still holds.

Schema history:
    3: `content_sha256`, by which a damaged ledger is known: its numbers go to the table.
    2: `misfits`.
    1: the first.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from robid.arrays import Meaning
from robid.artifacts.artifact import canonical_hash
from robid.artifacts.atomic import plain, read_json, write_json
from robid.errors import ArtifactError
from robid.pipeline.chain import CHAIN
from robid.pipeline.freshness import file_sha256
from robid.versions import __version__

LEDGER = "row.json"
SCHEMA_VERSION = 3
FORMATS = {"row": str(SCHEMA_VERSION)} | {stage.kind.name: stage.kind.version for stage in CHAIN if stage.kind}
"""Versions of what a row is made of; one that differs makes it stale."""

_DIGEST = "content_sha256"
_SETTLED_NS = 2_000_000_000
Status = Literal["done", "failed"]


@dataclass(frozen=True)
class FileKey:
    """What a file was."""

    sha256: str  # hash of its bytes, empty where there was none
    # Size, and times of its last change [ns]; while they are the same, so is the content. Empty where the file had
    # changed so recently that a further change may not show in its times.
    stat: tuple[int, ...] = ()

    def holds(self, path: Path) -> bool:
        """Whether a file is still what it was."""
        try:
            if self.stat and self.stat == _stat(path):
                return True
        except OSError:
            return not self.sha256
        return file_key(path).sha256 == self.sha256


def file_key(path: Path) -> FileKey:
    """Returns what a file or folder is now; one that cannot be read is none."""
    try:
        before = _stat(path)
        settled = bool(before) and time.time_ns() - max(before[1:]) > _SETTLED_NS
        return FileKey(file_sha256(path), before if settled else ())
    except OSError:
        return FileKey("")


def _stat(path: Path) -> tuple[int, ...]:
    """Size and times of a file; a folder's say nothing of what is in its files."""
    if path.is_dir():
        return ()
    found = path.stat()
    return found.st_size, found.st_mtime_ns, found.st_ctime_ns


@dataclass(frozen=True)
class RowError:
    """Why a row has failed."""

    kind: Annotated[str, Meaning("`settings`, `data`, `fit`, `memory`, `time`, or `defect` for one of robid.")]
    where: Annotated[str, Meaning("File and field, without the folder of the manifest.")]
    message: Annotated[str, Meaning("What is wrong.")]
    remedy: Annotated[str, Meaning("What to do next.")]

    def __str__(self) -> str:
        return f"{self.where}: {self.message}" if self.where else self.message


@dataclass(frozen=True)
class Ledger:
    """What a row was made from and what became of it."""

    id: str  # the row
    settings_hash: str  # hash of all settings that its stages read
    settings: dict[str, Any]  # its settings; in the file alone, for whoever reads it
    inputs: dict[str, FileKey]  # the robot file and the logs, by name
    outputs: dict[str, FileKey]  # the files that it made, by path in its folder
    status: Status  # whether it was done
    error: RowError | None  # why not
    warnings: tuple[str, ...]  # what its stages warned of
    grades: dict[str, tuple[int, str]]  # grade of each fit: 2 to trust, 1, or 0 not to be used; and its sentence
    results: tuple[dict[str, Any], ...]  # its parameters, see `robid.fleet.row`
    # How badly the model of each fit describes data, by fit and name, see `Family.misfits`.
    misfits: dict[str, dict[str, float]]
    kept: bool  # whether records and responses were to stay
    seconds: float  # time that it took [s]
    finished_utc: str  # when it was finished
    formats: dict[str, str] = field(default_factory=lambda: dict(FORMATS))  # versions of what it is made of
    robid_version: str = __version__

    @property
    def outline(self) -> Ledger:
        """What a batch keeps of it in memory: neither parameters nor files."""
        return replace(self, settings={}, inputs={}, outputs={}, warnings=(), results=(), formats={})


def write_ledger(folder: Path, ledger: Ledger) -> None:
    """Writes the ledger of a row into its folder."""
    content: Any = plain(asdict(ledger))
    write_json(folder / LEDGER, {**content, _DIGEST: canonical_hash(content)})


def read_ledger(folder: Path) -> Ledger | None:
    """Reads the ledger of a row; None where there is none that this version reads, or a damaged one.

    Raises:
        ArtifactError: If the folder is there, but no row's.
    """
    if not folder.exists():
        return None
    if not (folder / LEDGER).exists():
        remedy = "move it away, or name another run folder with --run-dir"
        raise ArtifactError(
            "A026 The folder is not one of a row: it has no row.json.", where=str(folder), remedy=remedy
        )
    try:
        found = read_json(folder / LEDGER)
        if found["formats"].get("row") != str(SCHEMA_VERSION):
            return None
        if found.pop(_DIGEST) != canonical_hash(found):
            return None
        keys = {
            files: {name: FileKey(key["sha256"], tuple(key["stat"])) for name, key in found.pop(files).items()}
            for files in ("inputs", "outputs")
        }
        error = found.pop("error")
        made: dict[str, Any] = {name: tuple(found.pop(name)) for name in ("warnings", "results")}
        made["grades"] = {fit: (value, sentence) for fit, (value, sentence) in found["grades"].items()}
        return Ledger(**{**found, **keys, **made, "settings": {}, "error": error and RowError(**error)})
    except (ArtifactError, AttributeError, KeyError, TypeError, ValueError):
        return None


def logs_away(ledger: Ledger, inputs: Mapping[str, Path]) -> tuple[str, ...]:
    """Returns the logs of a row that is done which are not there now, or may not be read: they cannot be compared."""
    made_from = [name for name in inputs if name in ledger.inputs and ledger.inputs[name].sha256]
    return tuple(name for name in made_from if ledger.status == "done" and not os.access(inputs[name], os.R_OK))


def why_stale(
    ledger: Ledger | None, settings_hash: str, inputs: Mapping[str, Path], folder: Path, *, keep: bool, force: bool
) -> str:
    """Says why a row is to be made again; empty where nothing would come out differently.

    A row that is done stays while one of its logs is away: made again it could only fail.
    """
    if ledger is None:
        return "not made yet"
    if ledger.settings_hash != settings_hash:
        return "settings changed"
    if ledger.formats != FORMATS:
        return "made by another version"
    is_away = bool(logs_away(ledger, inputs))
    # Of the robot file, only what the settings' hash covers counts.
    logs = [] if is_away else [name for name in dict.fromkeys([*inputs, *ledger.inputs]) if name != "robot"]
    for name in logs:
        if name not in inputs or name not in ledger.inputs or not ledger.inputs[name].holds(inputs[name]):
            return f"{name} changed"
    for name, key in ledger.outputs.items():
        if not key.holds(folder / name):
            return f"{name} changed"
    if keep and not ledger.kept and not is_away:
        return "records and responses are to be kept"
    if ledger.status == "failed" and (force or ledger.robid_version != __version__):
        return "failed, and is tried again"
    return ""


def causes(ledgers: Iterable[Ledger]) -> list[tuple[str, str, str, list[str]]]:
    """Groups failures by kind and message, the most frequent first: kind, message, remedy and ids."""
    found: dict[tuple[str, str], tuple[str, list[str]]] = {}
    for ledger in ledgers:
        if ledger.error is not None:
            error = ledger.error
            found.setdefault((error.kind, error.message), (error.remedy, []))[1].append(ledger.id)
    groups = [(kind, message, remedy, ids) for (kind, message), (remedy, ids) in found.items()]
    return sorted(groups, key=lambda group: -len(group[3]))
