"""Reads the variables of a log, whatever its format."""

from __future__ import annotations

from collections.abc import Collection
from importlib.util import find_spec
from pathlib import Path

from robid.errors import DataError
from robid.logs.formats.apart import READER
from robid.logs.formats.known import FOREIGN, FORMATS, UNPACKING_ERRORS, first_bytes, tell_format
from robid.logs.formats.tables import read_table
from robid.logs.formats.variables import Variables, Wanted
from robid.signals.log_dialect import Dialect

_TOLD = Dialect()


def load_variables(
    file: Path,
    format_: str | None = None,
    names: Collection[str] | None = None,
    dialect: Dialect = _TOLD,
) -> Variables:
    """Reads variables of a log.

    Fields of structures are named as MATLAB does, `meas.Y(2).Data`, elements of cells `name{2}`; variables in folders
    of a file `folder/name`, fields of messages `/topic.field[0]`, columns of a table by their header.

    Args:
        file: The log; a folder where it is a ROS 2 bag.
        format_: A name in `FORMATS`; told from the file where it is None.
        names: Variables to read; all where it is None. Of the others only the names and sizes become known.
        dialect: How a table of text is written.

    Raises:
        DataError: If the file is missing, of another format, or damaged; or its reader is not installed, takes too
            long or crashes. What cannot be read of a log is told when it is asked for (`find_variable`).
    """
    if not file.exists():
        remedy = "Correct `file`, or set ROBID_DATA to the folder that holds the data."
        raise DataError("The log does not exist.", where=str(file), remedy=remedy)
    if file.is_file() and not file.stat().st_size:
        raise DataError("The log is empty.", where=str(file), remedy="Record or copy it again.")
    try:
        name = format_ or tell_format(file)
        if file.is_dir() and name != "rosbag":
            raise DataError("The log is a folder.", where=str(file), remedy="Name the file, not its folder.")
        _check_known(file)
        _check_installed(file, name)
        if name == "csv":
            return Variables(file, read_table(file, Wanted(names), dialect))
    except UNPACKING_ERRORS as e:
        remedy = "Check that it may be read and was copied completely."
        raise DataError(f"The log cannot be opened ({e}).", where=str(file), remedy=remedy) from e
    return Variables(file, READER.read(file, name, names))


def _check_known(file: Path) -> None:
    """Refuses formats that are known, but not read."""
    start = first_bytes(file)
    for magic, title, remedy in FOREIGN:
        if start.startswith(magic):
            raise DataError(f"The log is {title}.", where=str(file), remedy=remedy)


def _check_installed(file: Path, name: str) -> None:
    """Names the command that installs what a format needs."""
    lacking = [module for module in FORMATS[name].needs if find_spec(module) is None]
    if lacking:
        what = f"To read {FORMATS[name].title}, {' and '.join(lacking)} must be installed."
        remedy = f"Install with `pip install 'robid[{FORMATS[name].extra}]'`."
        raise DataError(what, where=str(file), remedy=remedy)
