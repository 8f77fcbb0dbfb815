"""Whether an output is what its settings and inputs would give, and why not."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from robid.artifacts.artifact import Provenance, canonical_hash
from robid.artifacts.store import read_header
from robid.errors import ArtifactError
from robid.pipeline.stage import Plan, Stage

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
        found = _STAMP.findall(path.read_text(encoding="utf-8"))
        if found:
            return Provenance(**json.loads(found[-1]))
    except (OSError, ValueError, TypeError) as error:
        raise ArtifactError(f"A032 The page is damaged: {error}.", where=str(path), remedy=remedy) from error
    raise ArtifactError("A033 The page does not say what it was made from.", where=str(path), remedy=remedy)


@dataclass(frozen=True)
class State:
    """Whether a node's output is there and up to date, and why not.

    Attributes:
        status: `fresh`, `stale` or `missing`.
        why: What has changed; empty when fresh.
        problem: What went wrong numerically in a fresh output.
        blocked: Whether a numerical problem further up keeps it from being made.
        unreadable: Why the output cannot be read, if so.
    """

    status: Literal["fresh", "stale", "missing"]
    why: str = ""
    problem: str = ""
    blocked: bool = False
    unreadable: ArtifactError | None = None


def state_of_output(stage: Stage, plan: Plan, folder: Path, above: Mapping[str, State]) -> State:
    """Compares an output with what its stage would make now.

    Args:
        stage: The stage.
        plan: What it reads and writes.
        folder: Folder of the plan's paths.
        above: State of each input that is to be there, by its path.
    """
    output = folder / plan.outputs[0]
    if not output.exists():
        return State("missing", "not made yet")
    try:
        made = _provenance(stage, output)
    except ArtifactError as error:
        return _unreadable(error)
    missing = [path for path in plan.outputs if not (folder / path).exists()]
    if missing:
        return State("missing", f"{missing[0]} is not there")
    reasons = []
    if made.settings_hash != canonical_hash(plan.settings):
        reasons.append(f"settings changed: {', '.join(changed(made.settings, plan.settings)) or 'unknown'}")
    waiting = [path for path, state in above.items() if state.status != "fresh"]
    if waiting:
        reasons.append(f"input {waiting[0]} will be made again")
    else:
        used = {name: folder / path for name, path in plan.inputs.items() if path in above}
        reasons += [f"input {plan.inputs.get(name, name)} changed" for name in _differing(made, plan, used)]
    if reasons:
        return State("stale", "; ".join(reasons))
    try:
        unsaid = stage.vouched([folder / path for path in plan.outputs])
    except ArtifactError as error:
        return _unreadable(error)
    if unsaid:
        return State("stale", unsaid)
    return State("fresh", problem=stage.problem(output))


def _unreadable(error: ArtifactError) -> State:
    return State("stale", error.what.rstrip("."), unreadable=error)


def input_hashes(plan: Plan, inputs: Mapping[str, Path]) -> dict[str, str]:
    """Returns the content hash of each input and outside file that is there."""
    made = {name: _content(path) for name, path in inputs.items() if path.exists()}
    outside = {path: file_sha256(path) for path in dict.fromkeys(plan.files.values()) if path.exists()}
    return made | {name: outside[path] for name, path in plan.files.items() if path in outside}


def changed(before: Any, now: Any, name: str = "") -> list[str]:  # noqa: ANN401
    """Names the settings that differ, as dotted paths."""
    if isinstance(before, dict) and isinstance(now, dict):
        keys = dict.fromkeys([*before, *now])
        return [path for key in keys for path in changed(before.get(key), now.get(key), f"{name}.{key}".lstrip("."))]
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        pairs = enumerate(zip(before, now, strict=True))
        return [path for index, (old, new) in pairs for path in changed(old, new, f"{name}[{index}]")]
    return [] if canonical_hash(before) == canonical_hash(now) else [name]


def _differing(made: Provenance, plan: Plan, inputs: Mapping[str, Path]) -> list[str]:
    """Names of inputs that are not those of the output; a log that is not here cannot be compared."""
    hashes = input_hashes(plan, inputs)
    names = [name for name in dict.fromkeys([*hashes, *made.inputs]) if name in hashes or name not in plan.files]
    return [name for name in names if hashes.get(name) != made.inputs.get(name)]


def _provenance(stage: Stage, output: Path) -> Provenance:
    return read_stamp(output) if stage.kind is None else read_header(output, stage.kind).provenance


def _content(path: Path) -> str:
    if path.suffix == ".h5":
        return read_header(path).content_sha256
    return file_sha256(path)


def file_sha256(path: Path) -> str:
    """Returns the hash of the bytes of a file of somebody else, or of all files of a folder and their names.

    What a system or a reader leaves beside a bag, hidden files and SQLite's shared memory, does not count.
    """
    if path.is_dir():
        left = (one for one in sorted(path.iterdir()) if not one.name.startswith(".") and not one.name.endswith("-shm"))
        inside = [(one.name, file_sha256(one)) for one in left]
        return hashlib.sha256(repr(inside).encode()).hexdigest()
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
