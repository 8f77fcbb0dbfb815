"""A process of its own that reads binary logs: on a damaged one a reader may crash, hang or ask for all memory."""

from __future__ import annotations

import atexit
import io
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robid.errors import DataError
from robid.logs.formats.known import FORMATS, tell_format
from robid.logs.formats.variables import Found, Reason

_START = "import json, sys; sys.path[:] = json.loads(sys.argv[1]); from robid.logs.formats.worker import serve; serve()"
_COPIED = "Check that it was copied completely, or write it again from its source."


@dataclass(frozen=True)
class Limits:
    """What reading a log may take.

    Attributes:
        seconds: Time for any log [s].
        seconds_per_byte: Further time for each byte of it [s].
        memory: Memory for any log [bytes].
        memory_per_byte: Further memory for each byte of it.
    """

    seconds: float = 60.0
    seconds_per_byte: float = 2e-6
    memory: int = 4 << 30
    memory_per_byte: int = 30


class Reader:
    """Reads binary logs one after the other in one process, which starts with the first and ends with this one.

    Args:
        limits: What reading a log may take.
    """

    def __init__(self, limits: Limits | None = None) -> None:
        self._limits = limits or Limits()
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()

    def read(self, file: Path, name: str, names: Collection[str] | None) -> Found:
        """Reads a log.

        Args:
            file: The log.
            name: Its format, a name in `FORMATS`.
            names: Variables to read; all where it is None.

        Raises:
            DataError: If it cannot be read.
        """
        size = _size(file)
        seconds = self._limits.seconds + size * self._limits.seconds_per_byte
        memory = self._limits.memory + size * self._limits.memory_per_byte
        asked = {"file": str(file.absolute()), "module": FORMATS[name].module, "memory": memory}
        with self._lock:
            return self._ask({**asked, "names": None if names is None else list(names)}, file, name, seconds)

    def close(self) -> None:
        """Ends the process."""
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            process.communicate()

    def _ask(self, question: dict[str, Any], file: Path, name: str, seconds: float) -> Found:
        if self._process is None or self._process.poll() is not None:
            self.close()
            self._process = _start()
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
            raise DataError(f"Reading it as {FORMATS[name].title} {what}.", where=str(file), remedy=_COPIED) from None
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
    found.unreadable = {name: Reason(*reason) for name, reason in answer.get("unreadable", {}).items()}
    found.damage = Reason(*answer["damage"]) if answer.get("damage") else None
    for name, dtype, shape in answer.get("arrays", ()):
        raw = np.empty(int(np.prod(shape)) * np.dtype(dtype).itemsize, np.uint8)
        if answers.readinto(raw.data) != raw.nbytes:
            raise EOFError
        found.arrays[name] = raw.view(dtype).reshape(shape)
    return answer, found


def _refusal(file: Path, name: str, answer: dict[str, Any]) -> DataError:
    """What the reader found wrong with a log as a whole."""
    told = tell_format(file)
    title = FORMATS[name].title
    if told != name and told != "csv":
        what = f"The log cannot be read as {title}: it looks like {FORMATS[told].title}."
        return DataError(what, where=str(file), remedy=f"Set `format: {told}`, or leave it out.")
    remedy = answer.get("remedy") or f"Check that it is {title} and that it was copied completely."
    error = DataError(f"The log cannot be read as {title} ({answer['error']}).", where=str(file), remedy=remedy)
    error.add_note(answer.get("trace", ""))
    return error


def _death(code: int) -> str:
    """Says how a process ended."""
    if code >= 0:
        return f"ended its reader (exit code {code})"
    name = signal.Signals(-code).name
    return f"crashed its reader ({name})" if name != "SIGKILL" else "was ended from outside, perhaps for lack of memory"


def _size(file: Path) -> int:
    """Size of a file, or of all files of a folder [bytes]."""
    files = file.rglob("*") if file.is_dir() else [file]
    return sum(one.stat().st_size for one in files if one.is_file())


READER = Reader()
"""The process that all logs of a command share; the first log starts it."""
atexit.register(READER.close)
