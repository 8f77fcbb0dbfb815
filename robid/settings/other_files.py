"""Files that are something else than the settings file that is asked for: named as what they are."""

from __future__ import annotations

import difflib
import re
from collections.abc import Collection, Mapping
from io import BufferedReader
from pathlib import Path
from typing import Any

from robid.errors import SettingsError
from robid.files import open_regular

SUFFIXES = (".yaml", ".yml")
_EXPERIMENT = ("campaigns", "designs", "fits", "study", "execution")
_ROBOT = ("joints", "springs", "model", "controller")
_HDF5 = b"\x89HDF\r\n\x1a\n"
_BINARY = {
    _HDF5: "an HDF5 file",
    b"MATLAB 7.3": "a MAT file",
    b"MATLAB 5.0": "a MAT file",
    b"PAR1": "a Parquet file",
    b"PK\x03\x04": "a ZIP archive",
    b"\x89MCAP0": "an MCAP file",
    b"SQLite format 3": "a SQLite database, as ROS bags are",
}
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
_MODELS = {"<mujoco": "an MJCF", "<robot": "a URDF"}
_SEPARATORS = ",;\t"
_SHOWN = 6
_BEGINNING, _HTML = 1 << 20, 20  # bytes of a file that say what it is
_KEY = re.compile(r"^(\w+):", re.MULTILINE)


def unreadable(path: Path, error: OSError, suffixes: Collection[str] = SUFFIXES) -> SettingsError:
    """Returns what to say of a file that cannot be opened: a folder, or one that is not there, with near names."""
    folder = path if path.is_dir() else path.parent
    names = sorted(one.name for one in folder.iterdir() if one.suffix in suffixes) if _is_open(folder) else []
    if path.is_dir():
        what = "S525 is a folder, where a file is asked for"
        return SettingsError(what, where=str(path), remedy=f"name a file in it{_listed(', as', names)}")
    what = f"S333 cannot be read: {error.strerror or error}"
    if path.exists():
        return SettingsError(what, where=str(path), remedy=f"name another file{_listed(', as', names)}")
    if not folder.is_dir():
        return SettingsError(what, where=str(path), remedy=f"there is no folder `{folder}`: check the path")
    stems = {Path(name).stem: name for name in names}
    close = difflib.get_close_matches(path.stem, stems, n=1)
    remedy = f"did you mean `{folder / stems[close[0]]}`?" if close else f"check the path{_listed('; there is', names)}"
    return SettingsError(what, where=str(path), remedy=remedy)


def _is_open(folder: Path) -> bool:
    try:
        next(folder.iterdir(), None)
    except OSError:
        return False
    return True


def _listed(before: str, names: Collection[str]) -> str:
    shown = ", ".join(f"`{name}`" for name in sorted(names)[:_SHOWN])
    return f"{before} {shown}{', ..' if len(names) > _SHOWN else ''}" if names else ""


def refuse_binary(path: Path, content: bytes, wanted: str = "a settings file in YAML") -> None:
    """Refuses what is no text, with what it is.

    Raises:
        SettingsError: If it begins as a binary file does, or is neither UTF-8 nor UTF-16 and has zeros.
    """
    kind = next((told for mark, told in _BINARY.items() if content.startswith(mark)), None)
    if kind is None and (b"\0" not in content or content.startswith(_UTF_16) or _is_utf_8(content)):
        return
    what = f"S548 is {kind or 'a binary file'}, where {wanted} is asked for"
    remedy = f"; `robid inspect {path}` shows what is in this one" if kind else ""
    raise SettingsError(what, where=str(path), remedy=f"name another file{remedy}")


def _is_utf_8(content: bytes) -> bool:
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def refuse_other_text(path: Path, text: str) -> None:
    """Refuses a rigid model and a table.

    Raises:
        SettingsError: If it is one of them.
    """
    if re.match(r"[\ufeff\s]*<(?!<)", text):
        kind = next((told for mark, told in _MODELS.items() if mark in text), "an XML file")
        what = f"S526 is {kind}, where a settings file in YAML is asked for"
        remedy = f"`robid init NAME --model {path}` writes an experiment and a robot file that has it as `model:`"
        raise SettingsError(what, where=str(path), remedy=remedy)
    if path.suffix.lower() == ".csv" or _is_table(text):
        what = "S527 is a table, where a settings file in YAML is asked for"
        remedy = f"a manifest stands before its experiment file, `robid reprocess {path} EXPERIMENT.yaml`; for a log,"
        remedy += f" `robid inspect {path} --propose EXPERIMENT.yaml` writes the experiment"
        raise SettingsError(what, where=str(path), remedy=remedy)


def opened(path: Path) -> BufferedReader:
    """Opens a file that settings or the command line name, other than a settings file.

    Raises:
        SettingsError: If it cannot be read, or is a pipe, a socket or a device.
    """
    try:
        return open_regular(path)
    except OSError as error:
        what = f"S593 cannot be read: {error.strerror or error}"
        raise SettingsError(what, where=str(path), remedy="name a file that this user may read") from error


def refuse_no_log(path: Path) -> None:
    """Refuses a file of robid, or a rigid model, where an artifact or a log is asked for; says which command reads it.

    Raises:
        SettingsError: If it is an experiment file, a robot file, a URDF, an MJCF or a page, or cannot be read.
    """
    if path.is_dir() or not path.exists():
        return
    with opened(path) as file:
        text = file.read(_BEGINNING).decode("utf-8", errors="replace").lstrip("\ufeff \t\r\n")
    keys = set(_KEY.findall(text)) if path.suffix.lower() in SUFFIXES else set()
    kind = next((told for mark, told in _MODELS.items() if text.startswith("<") and mark in text), "")
    if kind:
        remedy = f"`robid init NAME --model {path}` writes an experiment and a robot file that has it as `model:`"
    elif keys & {*_EXPERIMENT}:
        kind, remedy = "an experiment file", f"`robid status {path}` checks it, `robid run {path}` runs it"
    elif keys & {*_ROBOT}:
        kind = "a robot file"
        remedy = f"`robid status EXPERIMENT.yaml` checks it with an experiment that says `robot: {path.name}`"
    elif text[:_HTML].lower().startswith(("<!doctype html", "<html")):
        kind, remedy = "a page", "open it in a browser"
    else:
        return
    what = f"S580 is {kind}, where an artifact or a log is asked for"
    raise SettingsError(what, where=str(path), remedy=remedy)


def _is_table(text: str) -> bool:
    """Whether every line has as many separators, and none a colon as keys have."""
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) < 2 or any(": " in line or line.endswith(":") for line in lines):
        return False
    return any({line.count(mark) for line in lines} == {lines[0].count(mark)} != {0} for mark in _SEPARATORS)


def refuse_other_settings(path: Path, data: Mapping[str, Any], wanted: str) -> None:
    """Refuses a robot file where an experiment is `wanted`, and the other way round, and what is neither.

    Raises:
        SettingsError: If it is another one by its keys.
    """
    found = {"experiment": any(key in data for key in _EXPERIMENT), "robot": any(key in data for key in _ROBOT)}
    if found[wanted]:
        return
    if wanted == "experiment" and found["robot"]:
        what = "S549 is a robot file, where an experiment file is asked for"
        remedy = f"name an experiment file that says `robot: {path.name}`; `robid init NAME --example drive` writes"
        remedy += " one to begin with"
    elif wanted == "robot" and found["experiment"]:
        what = "S528 is an experiment file, where a robot file is asked for"
        remedy = "name the file that has the robot's `joints`"
    elif (wanted == "experiment" and "robot" in data) or {"name", "schema_version"} <= data.keys():
        return  # a file at its beginning
    else:
        what = "S529 is no settings file: it has neither `campaigns`, as an experiment, nor `joints`, as a robot"
        remedy = "name another file; `robid init NAME --example drive` writes both to begin with"
    raise SettingsError(what, where=str(path), remedy=remedy)
