"""Reads the variables of a log, whatever its format: tables of text here, binary logs in a process of its own.

On a damaged log a library may crash, hang or ask for all memory: questions go to that process by lines, variables come
back as bytes.
"""

from __future__ import annotations

import atexit
import io
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any

import numpy as np

from robid.errors import DataError
from robid.logs.formats.stamps import add_stamp, split_stamps
from robid.logs.formats.unpacking import (
    UNPACKING_ERRORS,
    UnreadableLogError,
    first_bytes,
    is_packed,
    open_bytes,
    room_for,
)
from robid.logs.formats.variables import (
    EVERY,
    FOREIGN,
    Format,
    Found,
    Reason,
    Variables,
    Wanted,
    tell_format,
    tell_response_format,
)
from robid.signals.log_options import Dialect, LogFormat

_TOLD = Dialect()


def load_variables(
    file: Path, format_: LogFormat | None = None, names: Collection[str] | None = None, dialect: Dialect = _TOLD
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
    return _load(file, format_ or (lambda: tell_format(file)), names, dialect)


def load_responses(file: Path, format_: str | None = None, dialect: Dialect = _TOLD) -> Variables:
    """Reads all variables of a file of responses; arguments and errors as for `load_variables`."""
    return _load(file, format_ or (lambda: tell_response_format(file)), None, dialect)


def _load(file: Path, format_: str | Callable[[], str], names: Collection[str] | None, dialect: Dialect) -> Variables:
    if not file.exists():
        remedy = "Correct `file`, or set ROBID_DATA to the folder with the data."
        raise DataError("D053 The log does not exist.", where=str(file), remedy=remedy)
    if not (file.is_file() or file.is_dir()):
        what = "D504 The log is a pipe or a device, which has no content of its own."
        raise DataError(what, where=str(file), remedy="Write it to a file first, and name that one.")
    if file.is_file() and not file.stat().st_size:
        raise DataError("D054 The log is empty.", where=str(file), remedy="Record or copy it again.")
    try:
        name = format_ if isinstance(format_, str) else format_()
        if file.is_dir() and name != "rosbag":
            raise DataError("D055 The log is a folder.", where=str(file), remedy="Name the file, not its folder.")
        if name != "npz":  # which is a zip archive, too
            _check_known(file)
        _check_installed(file, EVERY[name])
        return _with_stamps(file, name, names, dialect)
    except UnreadableLogError as e:
        raise DataError(str(e), where=str(file), remedy=e.remedy) from e
    except UNPACKING_ERRORS as e:
        remedy = "Check that it may be read and was copied completely."
        raise DataError(f"D056 The log cannot be opened ({e}).", where=str(file), remedy=remedy) from e


def _with_stamps(file: Path, name: str, names: Collection[str] | None, dialect: Dialect) -> Variables:
    """Reads a log, and the times that it holds in two variables: where one is wanted, both of its variables."""
    read = _read(file, name, names, dialect)
    stamps = split_stamps(read.sizes)
    wanted = [stamps[one] for one in names or () if one in stamps]
    if names is not None and wanted:
        read = _read(file, name, {*names, *(part for first, second, _ in wanted for part in (first, second))}, dialect)
    for made, parts in stamps.items():
        add_stamp(read.found, made, parts)
    return read


def _read(file: Path, name: str, names: Collection[str] | None, dialect: Dialect) -> Variables:
    if name == "csv":
        from robid.logs.formats.tables import read_table  # the process that reads binary logs does without

        return Variables(file, read_table(file, Wanted(names), dialect))
    with _unpacked(file) as plain:
        return Variables(file, READER.read(plain, name, names, file))


@contextmanager
def _unpacked(file: Path) -> Iterator[Path]:
    """Yields a log, unpacked into a folder of its own where it is packed.

    The folder is made and removed here: the process that reads binary logs may be killed.
    """
    if file.is_dir() or not is_packed(file):
        yield file
        return
    with tempfile.TemporaryDirectory() as folder:
        plain = Path(folder) / file.stem
        with open_bytes(file) as packed, plain.open("xb") as stream:
            shutil.copyfileobj(packed, stream, 1 << 20)
        yield plain


def _check_known(file: Path) -> None:
    """Refuses formats that are known, but not read."""
    start = first_bytes(file)
    for magic, title, remedy in FOREIGN:
        if start.startswith(magic):
            raise DataError(f"D057 The log is {title}.", where=str(file), remedy=remedy)


def _check_installed(file: Path, kind: Format) -> None:
    """Names the command that installs what a format needs."""
    lacking = [module for module in kind.needs if find_spec(module) is None]
    if lacking:
        what = f"D058 To read {kind.title}, {' and '.join(lacking)} must be installed."
        remedy = f"Install with `pip install 'robid[{kind.extra}]'`."
        raise DataError(what, where=str(file), remedy=remedy)


_START = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from robid.logs.formats.load import serve; serve()"
_SPARE = 2  # for numbers that are stored in fewer bytes than they are read in
_COPIED = "Check that it was copied completely, or write it again from its source."


@dataclass(frozen=True)
class Limits:
    """What reading a log may take."""

    seconds: float = 60.0  # Time for any log [s]
    seconds_per_byte: float = 2e-6  # Further time for each byte of it [s]
    memory: int = 3 << 29  # Memory for any log [bytes], half a gigabyte of which the libraries take
    memory_per_byte: int = 30  # Further memory for each byte of it


class Reader:
    """Reads binary logs of a format one after the other in one process, which starts with the first of them.

    Args:
        limits: What reading a log may take.
    """

    def __init__(self, limits: Limits | None = None) -> None:
        self._limits = limits or Limits()
        self._process: subprocess.Popen[bytes] | None = None
        self._name = ""
        self._lock = threading.Lock()

    def read(self, file: Path, name: str, names: Collection[str] | None, called: Path | None = None) -> Found:
        """Reads a log of a format in `FORMATS`: all of its variables, or those that are named.

        Args:
            file: The log, unpacked.
            name: Its format.
            names: Variables to read; all where it is None.
            called: The file that messages name, where it is another one.

        Raises:
            DataError: If it cannot be read.
        """
        parts = file.rglob("*") if file.is_dir() else [file]
        size = sum(one.stat().st_size for one in parts if one.is_file())
        seconds = self._limits.seconds + size * self._limits.seconds_per_byte
        memory = self._limits.memory + size * self._limits.memory_per_byte
        asked = {"file": str(file.absolute()), "reader": EVERY[name].reader, "memory": memory}
        with self._lock:
            return self._ask({**asked, "names": None if names is None else list(names)}, called or file, name, seconds)

    def close(self) -> None:
        """Ends the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()

    def _ask(self, question: dict[str, Any], file: Path, name: str, seconds: float) -> Found:
        # A library keeps the memory that it once had, so that another one's first log would not find room.
        if self._process is None or self._process.poll() is not None or name != self._name:
            self.close()
            self._process, self._name = _start(), name
        process, late = self._process, threading.Event()

        def give_up() -> None:
            late.set()
            process.kill()

        timer = threading.Timer(seconds, give_up)
        timer.start()
        try:
            answer, found = _talk(process, question)
        except (OSError, EOFError, ValueError):
            process.kill()
            what = f"took longer than {seconds:.0f} s" if late.is_set() else _death(process.wait())
            self.close()
            raise DataError(
                f"D059 Reading it as {EVERY[name].title} {what}.", where=str(file), remedy=_COPIED
            ) from None
        except BaseException:
            self.close()  # an interrupted talk leaves half an answer in the pipe
            raise
        finally:
            timer.cancel()
        if "error" in answer:
            raise _refusal(file, name, answer)
        return found


def _start() -> subprocess.Popen[bytes]:
    """Starts the process, which sees the modules that this one sees; numerical libraries need one thread in it."""
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    return subprocess.Popen(
        [sys.executable, "-P", "-c", _START, json.dumps([path or str(Path.cwd()) for path in sys.path])],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env={**os.environ, **threads},
        start_new_session=True,  # an interrupt at the terminal is for this process, which ends the other
    )


def _talk(process: subprocess.Popen[bytes], question: dict[str, Any]) -> tuple[dict[str, Any], Found]:
    """Sends a question and receives the answer: a line of JSON, then the arrays' bytes.

    Raises:
        EOFError: If the process ends on the way.
    """
    told, answers = process.stdin, process.stdout
    if told is None or not isinstance(answers, io.BufferedReader):
        raise EOFError
    told.write(json.dumps(question).encode() + b"\n")
    told.flush()
    line = answers.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    answer: dict[str, Any] = json.loads(line)
    found = Found(**{key: answer.get(key, {}) for key in ("sizes", "units", "texts")})
    found.origins = {name: (since, count) for name, (since, count) in answer.get("origins", {}).items()}
    found.unreadable = {name: Reason(*reason) for name, reason in answer.get("unreadable", {}).items()}
    found.damage = Reason(*answer["damage"]) if answer.get("damage") else None
    for name, dtype, shape in answer.get("arrays", ()):
        raw = np.empty(int(np.prod(shape)) * np.dtype(dtype).itemsize, np.uint8)
        if answers.readinto(raw.data) != raw.nbytes:
            raise EOFError
        found.arrays[name] = raw.view(dtype).reshape(shape)
    return answer, found


def _refusal(file: Path, name: str, answer: dict[str, Any]) -> DataError:
    told = tell_format(file)
    title = EVERY[name].title
    if told != name and told != "csv":
        what = f"D060 The log cannot be read as {title}: it looks like {EVERY[told].title}."
        return DataError(what, where=str(file), remedy=f"Set `format: {told}`, or leave it out.")
    remedy = answer.get("remedy") or f"Check that it is {title} and that it was copied completely."
    if file.suffix == ".h5":
        remedy += " If it is an artifact of a run folder: delete it, `robid run EXPERIMENT.yaml` makes it again."
    error = DataError(f"D061 The log cannot be read as {title} ({answer['error']}).", where=str(file), remedy=remedy)
    error.add_note(answer.get("trace", ""))
    return error


def _death(code: int) -> str:
    if code >= 0:
        return f"ended its reader (exit code {code})"
    name = signal.Signals(-code).name
    return f"crashed its reader ({name})" if name != "SIGKILL" else "was ended from outside, perhaps for lack of memory"


READER = Reader()
"""The process that all logs of a command share; the first log starts it."""
atexit.register(READER.close)


def serve() -> None:
    """Answers questions until there are no more; what libraries print goes nowhere."""
    warnings.simplefilter("ignore")
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    for line in sys.stdin.buffer:
        question = json.loads(line)
        _limit_memory(question["memory"])
        try:
            found = read_apart(Path(question["file"]), question["reader"], Wanted(question["names"]))
            _check_room(Path(question["file"]), found)
        except MemoryError:
            what = f"it asks for more than {question['memory'] / (1 << 30):.3g} GB of memory"
            _send(answers, {"error": what})
        except Exception as e:  # noqa: BLE001 readers of damaged files raise whatever they like
            what = " ".join(str(e).replace(question["file"], Path(question["file"]).name).split()) or type(e).__name__
            _send(answers, {"error": what[:300], "remedy": getattr(e, "remedy", ""), "trace": traceback.format_exc()})
        else:
            _send_found(answers, found)


def read_apart(file: Path, reader: str, wanted: Wanted) -> Found:
    """Reads a log by `module:function`."""
    module, _, function = reader.partition(":")
    read: Callable[[Path, Wanted], Found] = getattr(import_module(module), function)
    return read(file, wanted)


def _check_room(file: Path, found: Found) -> None:
    """Refuses values that no log of its size holds; the other process has to take them as they are."""
    size = sum(values.nbytes for values in found.arrays.values())
    if size > _SPARE * room_for(file):
        what = f"D510 its variables have {size >> 20} MB, more than signals in a file of its size"
        raise UnreadableLogError(what, "Write the log again without them, or with less compression.")


def _send_found(answers: IO[bytes], found: Found) -> None:
    """Sends variables, in this machine's byte order."""
    arrays = {
        name: np.ascontiguousarray(x.astype(x.dtype.newbyteorder("="), copy=False)) for name, x in found.arrays.items()
    }
    answer = {
        "arrays": [(name, x.dtype.str, x.shape) for name, x in arrays.items()],
        **{"sizes": found.sizes, "units": found.units, "texts": found.texts, "origins": found.origins},
        "unreadable": {name: (reason.what, reason.remedy) for name, reason in found.unreadable.items()},
        "damage": None if found.damage is None else (found.damage.what, found.damage.remedy),
    }
    _send(answers, answer)
    for array in arrays.values():
        answers.write(array.ravel().view(np.uint8).data)
    answers.flush()


def _send(answers: IO[bytes], answer: dict[str, Any]) -> None:
    answers.write(json.dumps(answer).encode() + b"\n")
    answers.flush()


def _limit_memory(size: int) -> None:
    """Has the system refuse more memory than this [bytes], where it can."""
    try:
        import resource
    except ImportError:  # Windows
        return
    _, most = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (size if most == resource.RLIM_INFINITY else min(size, most), most))
