"""What may be replaced: files of the kind that is written, and never one that is read."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from robid.artifacts.store import kind_of
from robid.artifacts.truth import is_truth
from robid.errors import ArtifactError
from robid.models.encode import PARAMETER_COLUMNS
from robid.pipeline.freshness import read_stamp
from robid.pipeline.stage import Plan, Stage

if TYPE_CHECKING:
    from robid.settings.load import LoadedExperiment

_HEAD_BYTES = 4096
_COMPARISON = "compare"
_RIGID = b"rigid model identified by robid "
_TABLE = ",".join(PARAMETER_COLUMNS[: PARAMETER_COLUMNS.index("estimate") + 1]).encode() + b","
_MARKS = {
    ".xml": (b"elastic model identified by robid ", _RIGID),
    **dict.fromkeys((".urdf", ".yaml", ".yml"), (_RIGID,)),
    ".mat": (b"MATLAB 5.0 MAT-file, written by robid",),
    ".csv": (_TABLE, b"# Excitation of campaign ", b"# Frequency response of campaign "),
    **dict.fromkeys((".uff", ".unv"), (b"Frequency response of campaign ",)),
}


def check_replaceable(path: Path, kind: str, read: Mapping[str, Path]) -> None:
    """Refuses to replace what is not of the kind that is to be written, or is read by anything here.

    Args:
        path: Where it is to be written; a new file is always allowed.
        kind: Kind of artifact, `report`, `comparison`, `summary`, `truth` or `export`.
        read: Files that are read, by what they are; links and other spellings of their paths count.

    Raises:
        ArtifactError: If something else is there; it is left as it is.
    """
    if not path.exists():
        return
    for what, other in read.items():
        if other.exists() and path.samefile(other):
            raise _refusal(path, f"The output would take the place of {what}")
    if path.is_dir():
        raise _refusal(path, "There is a folder in the place of the output")
    is_own = _RECOGNISED[kind](path) if kind in _RECOGNISED else kind_of(path) == kind
    if not is_own:
        found = kind_of(path)
        what = f"an artifact of kind `{found}`" if found else f"a file that is no {kind} of robid, or a damaged one"
        raise _refusal(path, f"The output would take the place of {what}")


def check_outputs(loaded: LoadedExperiment, stage: Stage, plan: Plan, inputs: Mapping[str, Path], output: Path) -> None:
    """Refuses outputs that would take the place of a settings file, an input or another kind of artifact.

    Args:
        loaded: The experiment.
        stage: The stage.
        plan: What it reads and writes.
        inputs: The artifacts that it reads, by name.
        output: The main file to write; the others go beside it.

    Raises:
        ArtifactError: If one would.
    """
    kinds = [stage.kind.name if stage.kind else "report", *(Path(path).stem for path in plan.outputs[1:])]
    read = settings_files(loaded) | {f"the input `{name}`": path for name, path in {**inputs, **plan.files}.items()}
    for path, kind in zip(outputs_at(plan, output), kinds, strict=True):
        check_replaceable(path, kind, read)


def outputs_at(plan: Plan, output: Path) -> tuple[Path, ...]:
    """Returns where all outputs go when the main one goes there."""
    return (output, *(output.with_name(Path(path).name) for path in plan.outputs[1:]))


def settings_files(loaded: LoadedExperiment) -> dict[str, Path]:
    """Returns the files with the settings, by what they are."""
    found, robot = {"the experiment file": loaded.path}, loaded.robot_path
    if robot is None:
        return found
    found["the robot file"], model = robot, loaded.robot.model_path(robot.parent)
    return found if model is None else {**found, "the robot's model": model}


def _refusal(path: Path, what: str) -> ArtifactError:
    return ArtifactError(
        f"A034 {what}: nothing was written.",
        where=str(path),
        remedy="name another file with --output, or move this one away; --force replaces outputs of the same kind only",
    )


def _is_report(path: Path) -> bool:
    return _stage_of(path) not in {None, _COMPARISON}


def _is_comparison(path: Path) -> bool:
    return _stage_of(path) == _COMPARISON


def _stage_of(path: Path) -> str | None:
    """Stage that made a page; None of one that says nothing."""
    try:
        return read_stamp(path).stage
    except ArtifactError:
        return None


def _is_summary(path: Path) -> bool:
    found = _read_json(path)
    return isinstance(found, dict) and all(value is None or isinstance(value, int | float) for value in found.values())


def _is_export(path: Path) -> bool:
    """Tells whether a file says that it was exported; one edited by hand still does."""
    if path.suffix == ".json":
        found = _read_json(path)
        return isinstance(found, dict) and "robid_version" in found
    if path.suffix == ".npz":
        import zipfile

        return zipfile.is_zipfile(path) and "robid_version.npy" in zipfile.ZipFile(path).namelist()
    with path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    return any(mark in head for mark in _MARKS.get(path.suffix, ()))


def _read_json(path: Path) -> object:
    try:
        found: object = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found


_RECOGNISED: dict[str, Callable[[Path], bool]] = {
    "report": _is_report,
    "comparison": _is_comparison,
    "summary": _is_summary,
    "truth": is_truth,
    "export": _is_export,
}
