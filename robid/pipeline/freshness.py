"""Whether an output is what its settings and inputs would give, and why not; and what may be replaced by it."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from robid.artifacts.artifact import Provenance, canonical_hash, read_provenance
from robid.artifacts.store import kind_of, read_header
from robid.artifacts.truth import is_truth
from robid.errors import ArtifactError
from robid.files import open_regular, read_regular_text
from robid.models.encode import PARAMETER_COLUMNS
from robid.pipeline.stage import Plan, Stage
from robid.settings.other_files import opened

if TYPE_CHECKING:
    from robid.settings.load import LoadedExperiment
    from robid.settings.yaml import FieldPath

_STAMP = re.compile(r'<script type="application/json" id="provenance">(.*?)</script>', re.DOTALL)


def stamped(page: str, provenance: Provenance) -> str:
    """Returns a page that says how it came about, see `read_stamp`."""
    stamp = json.dumps(asdict(provenance), sort_keys=True).replace("<", "\\u003c")
    mark = f'<script type="application/json" id="provenance">{stamp}</script>\n'
    return page.replace("</body>", f"{mark}</body>", 1)


def read_stamp(path: Path) -> Provenance:
    """Reads how a report came about.

    Raises:
        ArtifactError: If the page does not say it, or cannot be read.
    """
    remedy = "move it away; `robid report EXPERIMENT.yaml` makes it again"
    try:
        found = _STAMP.findall(read_regular_text(path))
        if found:
            return read_provenance(found[-1])
    except (OSError, ValueError) as error:
        raise ArtifactError(f"A032 The page is damaged: {error}.", where=str(path), remedy=remedy) from error
    raise ArtifactError("A033 The page does not say what it was made from.", where=str(path), remedy=remedy)


@dataclass(frozen=True)
class State:
    """Whether a node's output is there and up to date, and why not."""

    status: Literal["fresh", "stale", "missing"]  # `fresh`, `stale` or `missing`
    why: str = ""  # what has changed; empty when fresh
    problem: str = ""  # what went wrong numerically in a fresh output
    blocked: bool = False  # whether a numerical problem further up keeps it from being made
    unreadable: ArtifactError | None = None  # why the output cannot be read, if so
    # Whether it is stale for no other reason than that it, or what it was made from, was made from inputs that the
    # command line named: single stages go on from it, a run makes it again
    named: bool = False


def state_of_output(stage: Stage, plan: Plan, folder: Path, above: Mapping[str, State]) -> State:
    """Compares an output with what its stage would make now; `above` has the state of each input by its path."""
    output = folder / plan.outputs[0]
    if not output.exists():
        return State("missing", "not made yet")
    try:
        kind = plan.kind or stage.kind
        made = read_stamp(output) if kind is None else read_header(output, kind).provenance
    except ArtifactError as error:
        return _unreadable(error)
    missing = [path for path in plan.outputs if not (folder / path).exists()]
    if missing:
        return State("missing", f"{missing[0]} is not there")
    reasons, told = _why_stale(made, plan, folder, above)
    if reasons:
        return State("stale", "; ".join(reasons))
    if told:
        return State("stale", "; ".join(told), problem=stage.problem(output), named=True)
    try:
        unsaid = stage.vouched([folder / path for path in plan.outputs])
    except ArtifactError as error:
        return _unreadable(error)
    if unsaid:
        return State("stale", unsaid)
    return State("fresh", problem=stage.problem(output))


def _why_stale(made: Provenance, plan: Plan, folder: Path, above: Mapping[str, State]) -> tuple[list[str], list[str]]:
    """Why an output is not what its stage would make now, and what it owes to inputs that the command line named."""
    reasons = []
    if made.settings_hash != canonical_hash(plan.settings):
        reasons.append(f"settings changed: {', '.join(changed(made.settings, plan.settings)) or 'unknown'}")
    inputs = {name: path for name, path in plan.inputs.items() if path in above}
    settled = {name for name, path in inputs.items() if above[path].status == "fresh" or above[path].named}
    there = {name for name in made.named if name in inputs and above[inputs[name]].unreadable is None}
    differing = _differing(made, plan, {name: folder / inputs[name] for name in inputs if name in settled | there})
    # What was named stands for the run folder's own input, in whatever state that is, unless it is the same.
    named = {name for name in differing if name in made.named}
    waiting = [path for name, path in inputs.items() if name not in settled | named]
    if waiting:
        reasons.append(f"input {waiting[0]} will be made again")
    else:
        reasons += [f"input {plan.inputs.get(name, name)} changed" for name in differing if name not in named]
    told = [f"made from another {plan.inputs.get(name, name)}, which was named" for name in differing if name in named]
    told += [f"input {path} was made from what was named" for path in inputs.values() if above[path].named]
    return reasons, list(dict.fromkeys(told))


def _unreadable(error: ArtifactError) -> State:
    return State("stale", error.what.rstrip("."), unreadable=error)


def input_hashes(plan: Plan, inputs: Mapping[str, Path]) -> dict[str, str]:
    """Returns the content hash of each input and outside file that is there."""
    made = {
        name: read_header(path).content_sha256 if path.suffix == ".h5" else file_sha256(path)
        for name, path in inputs.items()
        if path.exists()
    }
    outside = {path: file_sha256(path) for path in dict.fromkeys(plan.files.values()) if path.exists()}
    return made | {name: outside[path] for name, path in plan.files.items() if path in outside}


def changed(before: Any, now: Any, field: FieldPath = ()) -> list[str]:  # noqa: ANN401
    """Names the settings that differ, as dotted paths."""
    if isinstance(before, dict) and isinstance(now, dict):
        keys = dict.fromkeys([*before, *now])
        return [path for key in keys for path in changed(before.get(key), now.get(key), (*field, key))]
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        pairs = enumerate(zip(before, now, strict=True))
        return [path for index, (old, new) in pairs for path in changed(old, new, (*field, index))]
    from robid.settings.problems import format_field

    return [] if canonical_hash(before) == canonical_hash(now) else [format_field(field)]


def _differing(made: Provenance, plan: Plan, inputs: Mapping[str, Path]) -> list[str]:
    """Names of inputs that are not those of the output; a log that is not here cannot be compared."""
    hashes = input_hashes(plan, inputs)
    names = [name for name in dict.fromkeys([*hashes, *made.inputs]) if name in hashes or name not in plan.files]
    return [name for name in names if hashes.get(name) != made.inputs.get(name)]


def file_sha256(path: Path) -> str:
    """Returns the hash of the bytes of a file of somebody else, or of all files of a folder and their names.

    What a system or a reader leaves beside a bag, hidden files and SQLite's shared memory, does not count.

    Raises:
        SettingsError: If one cannot be read, or is no file.
    """
    if path.is_dir():
        left = (one for one in sorted(path.iterdir()) if not one.name.startswith(".") and not one.name.endswith("-shm"))
        inside = [(one.name, file_sha256(one)) for one in left]
        return hashlib.sha256(repr(inside).encode()).hexdigest()
    with opened(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


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

    The kind is one of artifacts, or `report`, `comparison`, `summary`, `truth`, `export`; a new file is always allowed.

    Raises:
        ArtifactError: If something else is there; it is left as it is.
    """
    if not path.exists():
        return
    for what, other in read.items():
        if other.exists() and path.samefile(other):
            raise _refusal(path, f"The output would take the place of {what}")
    if not path.is_file():
        raise _refusal(path, f"There is {'a folder' if path.is_dir() else 'no file'} in the place of the output")
    is_own = _RECOGNISED[kind](path) if kind in _RECOGNISED else kind_of(path) == kind
    if not is_own:
        found = kind_of(path)
        what = f"an artifact of kind `{found}`" if found else f"a file that is no {kind} of robid, or a damaged one"
        raise _refusal(path, f"The output would take the place of {what}")


def check_outputs(loaded: LoadedExperiment, stage: Stage, plan: Plan, inputs: Mapping[str, Path], output: Path) -> None:
    """Refuses outputs that would take the place of a settings file, an input or another kind of artifact.

    Raises:
        ArtifactError: If one would.
    """
    own = plan.kind or stage.kind
    kinds = [own.name if own else "report", *(Path(path).stem for path in plan.outputs[1:])]
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
    with open_regular(path) as file:
        head = file.read(_HEAD_BYTES)
    return any(mark in head for mark in _MARKS.get(path.suffix, ()))


def _read_json(path: Path) -> object:
    try:
        found: object = json.loads(read_regular_text(path))
    except (OSError, ValueError):
        return None
    return found


_RECOGNISED: dict[str, Callable[[Path], bool]] = {
    "report": lambda path: _stage_of(path) not in {None, _COMPARISON},
    "comparison": lambda path: _stage_of(path) == _COMPARISON,
    "summary": _is_summary,
    "truth": is_truth,
    "export": _is_export,
}
