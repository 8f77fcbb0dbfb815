"""Rewriting settings files of an older version."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import typer

from robid.artifacts.atomic import replacing
from robid.commands.output import print_json
from robid.settings.numbering import NEWEST
from robid.settings.upgrade import upgraded
from robid.settings.yaml import read_text


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
        print_json({"schema_version": NEWEST, "changed": changed})
        return 0
    for name, is_new in changed.items():
        typer.echo(f"{name}  {f'rewritten as schema_version {NEWEST}' if is_new else 'is of the newest version'}")
    return 0
