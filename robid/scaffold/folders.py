"""A new folder with the files of an experiment, or nothing at all."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from robid.artifacts.atomic import replacing
from robid.errors import SettingsError
from robid.settings.base import NAME_PATTERN


def check_folder(folder: Path) -> None:
    """Refuses a folder that holds something, and one whose name no experiment can have.

    Raises:
        SettingsError: If it cannot be used.
    """
    if not re.match(NAME_PATTERN, folder.name):
        what = f"S551 `{folder.name}` names no experiment: letters, digits, _ and -, 64 at most, the first no sign"
        raise SettingsError(what, where=str(folder), remedy="choose another name")
    above = next(one for one in folder.absolute().parents if one.exists())
    blocked = folder if folder.exists() and not folder.is_dir() else above if not above.is_dir() else None
    if blocked is not None:
        what = "S552 is a file, where a folder is to be made"
        raise SettingsError(what, where=str(blocked), remedy="choose another name")
    if folder.is_dir() and any(folder.iterdir()):
        what = "S553 the folder is not empty; nothing was written"
        raise SettingsError(what, where=str(folder), remedy="choose another name, or move what is in it away")


def write_folder(folder: Path, files: Mapping[str, str | bytes]) -> None:
    """Writes files into a folder that is new or empty, by their paths in it.

    Raises:
        SettingsError: If the folder cannot be used, or not be written.
    """
    check_folder(folder)
    try:
        for name, content in files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            with replacing(path) as partial:
                partial.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        what = f"S554 cannot be written: {error.strerror or error}"
        raise SettingsError(what, where=str(folder), remedy="choose a folder that you may write to") from error
