"""Rewriting settings files of an older version."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from robid.arrays import Meaning
from robid.artifacts.atomic import replacing
from robid.commands.output import Answer, print_json
from robid.settings.numbering import NEWEST
from robid.settings.upgrade import upgraded
from robid.settings.yaml import read_text


@dataclass(frozen=True)
class UpgradeAnswer(Answer, type="upgrade"):
    """What became of settings files."""

    schema_version: Annotated[int, Meaning("Version that they have now.")]
    changed: Annotated[dict[str, bool], Meaning("Whether each was rewritten, by file.")]


def upgrade_files(paths: Sequence[Path], *, as_json: bool) -> int:
    """Rewrites experiment and robot files in the newest version; returns the exit code.

    Raises:
        SettingsError: If one of them is no settings file; none is rewritten then.
    """
    texts = {path: upgraded(path, read_text(path)) for path in paths}
    for path, text in texts.items():
        if text is not None:
            with replacing(path) as unfinished:
                unfinished.write_text(text, encoding="utf-8")
    changed = {str(path): text is not None for path, text in texts.items()}
    if as_json:
        print_json(UpgradeAnswer(NEWEST, changed))
        return 0
    for name, is_new in changed.items():
        typer.echo(f"{name}  {f'rewritten as schema_version {NEWEST}' if is_new else 'is of the newest version'}")
    return 0
