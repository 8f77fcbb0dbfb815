"""The truth of a simulated campaign, a JSON file beside the record whose attribute `truth_sha256` vouches for it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robid.artifacts.atomic import json_text, read_json, replacing
from robid.artifacts.record import RECORD
from robid.artifacts.store import read_outline
from robid.errors import ArtifactError

_MAKER = "robid simulate-or-acquire EXPERIMENT.yaml"


def truth_sha256(content: Mapping[str, Any]) -> str:
    """Returns the SHA-256 of the file that `write_truth` writes."""
    return hashlib.sha256(json_text(content).encode()).hexdigest()


def write_truth(path: Path, content: Mapping[str, Any]) -> None:
    """Writes a truth at once."""
    with replacing(path) as partial:
        partial.write_bytes(json_text(content).encode())


def read_truth(path: Path, record: Path) -> dict[str, Any]:
    """Reads a truth that a record vouches for.

    Raises:
        ArtifactError: If it is missing, damaged, or not the one that the record was simulated with.
    """
    if not check_truth(path, record):
        raise ArtifactError(
            "The record does not say which truth it was simulated with.",
            where=str(record),
            remedy=f"`{_MAKER} --force` makes it again",
        )
    found: dict[str, Any] = read_json(path, made_by=_MAKER)
    return found


def check_truth(path: Path, record: Path) -> bool:
    """Refuses a truth that a record does not vouch for; tells whether the record says anything of its truth.

    Raises:
        ArtifactError: If it is missing, a folder, or not the one that the record was simulated with.
    """
    try:
        found = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ArtifactError(
            f"The truth cannot be read: {error.strerror or error}.", where=str(path), remedy=f"`{_MAKER}` makes it"
        ) from error
    stated = read_outline(record, RECORD).attributes.get("truth_sha256", "")
    if not stated:
        return False
    if found != stated:
        raise ArtifactError(
            f"The truth is not the one that {record} was simulated with: it was edited, or belongs to another record.",
            where=str(path),
            remedy=f"delete it, then `robid run EXPERIMENT.yaml` (or `{_MAKER} --force`) makes it again",
        )
    return True


def is_truth(path: Path) -> bool:
    """Tells whether a file is the truth of some record."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return isinstance(found, dict) and {"values", "truth", "imperfections", "seed"} <= found.keys()
