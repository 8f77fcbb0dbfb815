"""What runs in the process that reads binary logs: questions come in by lines, variables go out as bytes."""

from __future__ import annotations

import json
import os
import shutil
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import IO, Any

import numpy as np

from robid.logs.formats.known import is_packed, open_bytes
from robid.logs.formats.variables import Found, Wanted


def serve() -> None:
    """Answers questions until there are no more; what libraries print goes nowhere."""
    warnings.simplefilter("ignore")
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    for line in sys.stdin.buffer:
        question = json.loads(line)
        _limit_memory(question["memory"])
        try:
            found = read_apart(Path(question["file"]), question["module"], Wanted(question["names"]))
        except MemoryError:
            what = f"it asks for more than {question['memory'] / (1 << 30):.0f} GB of memory"
            _send(answers, {"error": what})
        except Exception as e:  # noqa: BLE001 readers of damaged files raise whatever they like
            what = " ".join(str(e).replace(question["file"], Path(question["file"]).name).split()) or type(e).__name__
            _send(answers, {"error": what[:300], "remedy": getattr(e, "remedy", ""), "trace": traceback.format_exc()})
        else:
            _send_found(answers, found)


def read_apart(file: Path, module: str, wanted: Wanted) -> Found:
    """Reads a log by a module, unpacked into a folder of its own where it is packed."""
    read: Callable[[Path, Wanted], Found] = import_module(module).read
    if file.is_dir() or not is_packed(file):
        return read(file, wanted)
    with tempfile.TemporaryDirectory() as folder:
        unpacked = Path(folder) / file.stem
        with open_bytes(file) as packed, unpacked.open("wb") as stream:
            shutil.copyfileobj(packed, stream, 1 << 20)
        return read(unpacked, wanted)


def _send_found(answers: IO[bytes], found: Found) -> None:
    """Sends variables, in this machine's byte order."""
    arrays = {
        name: np.ascontiguousarray(x.astype(x.dtype.newbyteorder("="), copy=False)) for name, x in found.arrays.items()
    }
    _send(
        answers,
        {
            "arrays": [(name, x.dtype.str, x.shape) for name, x in arrays.items()],
            "sizes": found.sizes,
            "units": found.units,
            "texts": found.texts,
            "unreadable": {name: (reason.what, reason.remedy) for name, reason in found.unreadable.items()},
            "damage": None if found.damage is None else (found.damage.what, found.damage.remedy),
        },
    )
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
