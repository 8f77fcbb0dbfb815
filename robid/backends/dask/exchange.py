"""The folder that client and workers share: a token that proves it, and large arrays of tasks by reference."""

from __future__ import annotations

import fcntl
import hashlib
import io
import os
import pickle
import re
import secrets
import shutil
import tempfile
from collections import Counter, OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robid.errors import ArtifactError

PREFIX = ".dask-"
TOKEN = "token"

_LARGE_BYTES = 64 * 1024
_REMEMBERED = 16


class Exchange:
    """A folder `.dask-...` within the run folder.

    Args:
        folder: The folder, which is there.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.token = secrets.token_hex(16)
        (folder / TOKEN).write_text(self.token, encoding="utf-8")
        self._uses: Counter[str] = Counter()

    @property
    def scratch(self) -> Path:
        """Where workers of a local cluster may write."""
        return self.folder / "scratch"

    def packer(self) -> Packer:
        """Returns what packs the tasks of one map."""
        return Packer(self)

    def keep(self, array: NDArray[Any]) -> str:
        """Writes an array unless it is there already; returns its name.

        Raises:
            ArtifactError: If it cannot be written.
        """
        data, order = (array.T, "F") if array.flags.fnc else (np.ascontiguousarray(array), "C")
        digest = hashlib.sha256(f"{array.dtype.descr}{array.shape}{order}".encode())
        digest.update(data.reshape(-1).view(np.uint8).data)
        name = f"{digest.hexdigest()}.npy"
        path = self.folder / name
        if not path.exists():
            try:
                np.save(path, array, allow_pickle=False)
            except OSError as error:
                with suppress(OSError):
                    path.unlink()
                raise _not_written(path, error) from error
        return name

    def use(self, names: set[str]) -> None:
        """Notes that one more task needs these arrays."""
        self._uses.update(names)

    def release(self, names: set[str]) -> None:
        """Notes that a task is done; arrays that no task in flight needs are removed."""
        self._uses.subtract(names)
        for name in names:
            if self._uses[name] <= 0:
                del self._uses[name]
                (self.folder / name).unlink(missing_ok=True)

    def last_on(self, address: str) -> int | None:
        """Returns the index of the task that a worker died on, None if it left no mark."""
        try:
            return int(mark_of(str(self.folder), address).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None


class Packer:
    """Packs functions and tasks; an array that several tasks share is hashed once.

    Args:
        exchange: Keeps their large arrays.
    """

    def __init__(self, exchange: Exchange) -> None:
        self._exchange = exchange
        self._known: OrderedDict[int, tuple[NDArray[Any], str]] = OrderedDict()

    def pack(self, function: Callable[..., Any], task: object) -> tuple[bytes, set[str]]:
        """Returns function and task as bytes, and the names of the arrays that they refer to."""
        names: set[str] = set()
        buffer = io.BytesIO()
        _Pickler(buffer, lambda array: self._name(array, names)).dump((function, task))
        self._exchange.use(names)
        return buffer.getvalue(), names

    def _name(self, array: NDArray[Any], names: set[str]) -> str:
        _, name = self._known.get(id(array), (array, ""))
        if not name or not (self._exchange.folder / name).exists():
            name = self._exchange.keep(array)
        # The array is held, so that its id stays its own.
        self._known[id(array)] = (array, name)
        self._known.move_to_end(id(array))
        while len(self._known) > _REMEMBERED:
            self._known.popitem(last=False)
        names.add(name)
        return name


class _Pickler(pickle.Pickler):
    def __init__(self, buffer: io.BytesIO, keep: Callable[[NDArray[Any]], str]) -> None:
        super().__init__(buffer, protocol=pickle.HIGHEST_PROTOCOL)
        self._keep = keep

    def persistent_id(self, obj: object) -> str | None:
        if type(obj) is np.ndarray and obj.nbytes >= _LARGE_BYTES and not obj.dtype.hasobject:
            return self._keep(obj)
        return None


class _Unpickler(pickle.Unpickler):
    def __init__(self, buffer: io.BytesIO, folder: str) -> None:
        super().__init__(buffer)
        self._folder = Path(folder)

    def persistent_load(self, pid: str) -> NDArray[Any]:
        array: NDArray[Any] = np.load(self._folder / pid, allow_pickle=False)
        return array


def unpack(packed: bytes, folder: str) -> tuple[Callable[[Any], Any], Any]:
    """Returns function and task; their large arrays are read from the shared folder."""
    found: tuple[Callable[[Any], Any], Any] = _Unpickler(io.BytesIO(packed), folder).load()
    return found


def mark_of(folder: str, address: str) -> Path:
    """Returns the file in which a worker says what it is at."""
    return Path(folder) / f"at-{re.sub(r'[^0-9A-Za-z]+', '-', address)}"


def remove_left(folder: Path) -> None:
    """Removes what killed clients left in a run folder: the system has freed their locks."""
    for left in folder.glob(f"{PREFIX}*"):
        with suppress(OSError), (left / "lock").open("r+", encoding="utf-8") as held:
            fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(left, ignore_errors=True)


@contextmanager
def shared_folder(folder: Path | None) -> Iterator[Exchange]:
    """Yields a new folder for client and workers within a run folder, and removes it at the end.

    Without a run folder it is a temporary one of this machine.

    Raises:
        ArtifactError: If it cannot be written.
    """
    try:
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)
            remove_left(folder)
        made = (folder or Path(tempfile.gettempdir())).resolve() / f"{PREFIX}{secrets.token_hex(8)}"
        made.mkdir()
        exchange = Exchange(made)
        lock = (made / "lock").open("w", encoding="utf-8")
    except OSError as error:
        raise _not_written(folder or Path(tempfile.gettempdir()), error) from error
    try:
        with lock:
            with suppress(OSError):
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            yield exchange
    finally:
        shutil.rmtree(made, ignore_errors=True)


def _not_written(path: Path, error: OSError) -> ArtifactError:
    what = f"A018 What workers need cannot be written: {error.strerror or error}."
    remedy = "check that the folder may be written to and that the disk has room"
    return ArtifactError(what, where=os.fspath(path), remedy=remedy)
