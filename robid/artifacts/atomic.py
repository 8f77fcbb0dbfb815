"""Files that are either the old one or the new one, never half of it; JSON files."""

from __future__ import annotations

import json
import math
import os
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from robid.errors import ArtifactError


@contextmanager
def replacing(path: Path, *, alone: bool = True) -> Iterator[Path]:
    """Yields `<name>.partial` to write to, which takes the place of `path` at the end.

    Args:
        path: The file.
        alone: Whether nobody else writes it now; otherwise the name is `<name>.<8 hexadecimal digits>.partial`.

    Raises:
        ArtifactError: If the file cannot be written; `path` is as it was.
    """
    writer = "" if alone else f".{secrets.token_hex(4)}"
    partial = path.with_name(f"{path.name}{writer}.partial")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # One that a killed process left, or a link to something else, is not written through.
        partial.unlink(missing_ok=True)
        yield partial
        _sync(partial)
        partial.replace(path)
        _sync(path.parent)
    except OSError as error:
        raise ArtifactError(
            f"The file cannot be written: {error.strerror or error}.",
            where=str(path),
            remedy="check that the folder may be written to and that the disk has room",
        ) from error
    finally:
        with suppress(OSError):
            partial.unlink()


def write_json(path: Path, content: object) -> None:
    """Writes a JSON file at once; numpy values become plain ones, numbers that are not finite become null."""
    with replacing(path) as partial:
        partial.write_bytes(json_text(content).encode())


def json_text(content: object) -> str:
    """Returns the text of a JSON file."""
    return json.dumps(plain(content), indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def read_json(path: Path, *, made_by: str = "robid run") -> Any:  # noqa: ANN401
    """Reads a JSON file.

    Raises:
        ArtifactError: If it is missing or not JSON.
    """
    remedy = f"`{made_by}` makes it again"
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError as error:
        raise ArtifactError("The file is missing.", where=str(path), remedy=remedy) from error
    except (OSError, ValueError) as error:
        raise ArtifactError(f"The file is damaged: {error}.", where=str(path), remedy=f"delete it; {remedy}") from error


def plain(value: object) -> object:
    """Turns numpy values into plain ones, and numbers that are not finite into None."""
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
