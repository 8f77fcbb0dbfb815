"""What runs on a worker: whether it may take part, as the client checks beforehand, and one task."""

from __future__ import annotations

import hashlib
import os
import pickle
import signal
import time
import traceback
from collections.abc import Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from distributed import get_worker
from threadpoolctl import threadpool_limits

from robid.backends.dask.exchange import TOKEN, mark_of, unpack
from robid.backends.threads import ONE_THREAD, environment
from robid.errors import BackendError
from robid.versions import package_versions

if TYPE_CHECKING:
    from collections.abc import Iterator

    from distributed import Client


VERSIONS, FOLDER, INPUTS, THREADS = "versions", "folder", "inputs", "threads"
DATA = "ROBID_DATA"


@dataclass(frozen=True)
class Terms:
    """What a worker must fulfil to take part."""

    versions: tuple[tuple[str, str], ...]  # Versions of packages by name, and the digest of robid's sources
    directory: str  # Where the command was given: paths of tasks may be relative to it
    exchange: str  # The folder that client and workers share
    token: str  # What its token file holds
    data: str | None = None  # The command's ROBID_DATA, which tasks read their data from; None where it has none
    inputs: tuple[str, ...] = ()  # Further folders that the tasks read from


@dataclass(frozen=True)
class Complaint:
    """Why a worker may not take part; `kind` is `versions`, `folder`, `inputs` or `threads`."""

    kind: str
    text: str


@dataclass(frozen=True)
class Refused:
    """The worker may not take part; the task was not begun."""

    address: str
    complaint: Complaint


@dataclass(frozen=True)
class Failed:
    """The task raised an error."""

    error: Exception
    trace: str


@dataclass(frozen=True)
class Done:
    """The task's result."""

    result: Any


def versions_here() -> tuple[tuple[str, str], ...]:
    """Returns what must be equal on all machines; of Python, major and minor version."""
    found = package_versions()
    found["python"] = ".".join(found["python"].split(".")[:2])
    return (*found.items(), ("sources of robid", _digest_of_sources()))


def examine(terms: Terms, dask_worker: Any) -> Complaint | None:  # noqa: ANN401
    """Says why a worker may not take part, None if it may; `distributed` names the second argument."""
    return _complaint(terms, dask_worker.state.nthreads)


def perform(terms: Terms, index: int, packed: bytes) -> Done | Failed | Refused:
    """Does one task; its error is a result, which no log shows."""
    worker = get_worker()
    complaint = examine(terms, worker)
    if complaint is not None:
        return Refused(worker.address, complaint)
    _limit_threads()
    try:
        with (
            _in_directory(terms.directory),
            environment({DATA: terms.data}),
            _marked(mark_of(terms.exchange, worker.address), index),
        ):
            function, task = unpack(packed, terms.exchange)
            return Done(function(task))
    except Exception as error:  # noqa: BLE001  whatever it is, it is raised where the map was called
        return Failed(_portable(error), traceback.format_exc())


def dask_setup(worker: object) -> None:
    """Leaves interrupts to the client; a worker of a local cluster calls it when it starts."""
    del worker
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@cache
def _complaint(terms: Terms, threads: int) -> Complaint | None:
    if threads != 1:
        return Complaint(THREADS, f"has {threads} threads")
    here = dict(versions_here())
    other = [f"{name} {here[name]} instead of {wanted}" for name, wanted in terms.versions if here[name] != wanted]
    if other:
        return Complaint(VERSIONS, "has " + ", ".join(other))
    if not Path(terms.directory).is_dir():
        return Complaint(FOLDER, f"does not see {terms.directory}")
    try:
        found = (Path(terms.exchange) / TOKEN).read_text(encoding="utf-8")
    except OSError:
        found = ""
    if found != terms.token:
        return Complaint(FOLDER, f"does not see {Path(terms.exchange).parent}")
    unseen = [folder for folder in terms.inputs if not Path(folder).is_dir()]
    return Complaint(INPUTS, f"does not see {', '.join(unseen)}") if unseen else None


@cache
def _limit_threads() -> None:
    """For good: libraries that are loaded later read the environment."""
    os.environ.update(ONE_THREAD)
    threadpool_limits(1)


@contextmanager
def _in_directory(directory: str) -> Iterator[None]:
    before = Path.cwd()
    os.chdir(directory)
    try:
        yield
    finally:
        os.chdir(before)


@contextmanager
def _marked(mark: Path, index: int) -> Iterator[None]:
    """Leaves the task's index behind if the process dies."""
    with suppress(OSError):
        mark.write_text(str(index), encoding="utf-8")
    try:
        yield
    finally:
        with suppress(OSError):
            mark.unlink()


def _portable(error: Exception) -> Exception:
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # noqa: BLE001  some errors cannot be rebuilt from their arguments
        return RuntimeError(f"{type(error).__name__}: {error}")
    return error


@cache
def _digest_of_sources() -> str:
    root, digest = Path(__file__).parents[2], hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


WAIT_FOR_WORKERS_S = 60.0
_ANSWER_S = 60.0
_SHOWN = 5

GUIDE = "docs/how-to/clusters.md says how"
_REMEDIES = {
    VERSIONS: f"give scheduler and workers the environment of this command; {GUIDE}",
    FOLDER: f"name a folder with --run-dir that this machine and all workers share, and work in one; {GUIDE}",
    INPUTS: f"let all workers see manifest, experiment file and data under the same paths as this machine; {GUIDE}",
    THREADS: f"start workers with `--nthreads 1` and more of them; {GUIDE}",
}
# In these a mismatch keeps scheduler, workers and client from understanding each other.
_LANGUAGE = ("python", "dask", "distributed", "cloudpickle")


def check_cluster(client: Client, address: str, terms: Terms) -> None:
    """Checks scheduler and workers.

    Raises:
        BackendError: If there are no workers for a minute, or scheduler or workers differ in their versions, lack
            robid, do not see the folders that they share, or have several threads.
    """
    _wait_for_workers(client, address)
    # Asked for without any function of ours, which other versions may not be able to read.
    versions = client.get_versions()
    other = _language(versions["client"], versions["scheduler"])
    if other:
        raise BackendError(f"B006 The scheduler has {other}.", where=address, remedy=_REMEDIES[VERSIONS])
    found = {worker: _language(versions["client"], seen) for worker, seen in versions["workers"].items()}
    _refuse({worker: Complaint(VERSIONS, f"has {text}") for worker, text in found.items() if text}, len(found), address)
    _check_scheduler(client, address)
    answers = client.sync(client._run, examine, terms, on_error="return", callback_timeout=_ANSWER_S)
    _refuse(
        {worker: _complaint_of(each) for worker, each in answers.items() if each is not None}, len(answers), address
    )


def refusal(worker: str, complaint: Complaint) -> BackendError:
    """Returns the error for a worker that joined later and may not take part."""
    return _error(
        {worker: complaint}, "A worker that joined later cannot be used", remedy_after="; the same command goes on"
    )


def _wait_for_workers(client: Client, address: str) -> None:
    deadline = time.monotonic() + WAIT_FOR_WORKERS_S
    while not client.nthreads():
        if time.monotonic() > deadline:
            what = f"B007 The scheduler has had no workers for {WAIT_FOR_WORKERS_S:.0f} s."
            remedy = f"start some, as in `dask worker {address} --nthreads 1`; {GUIDE}"
            raise BackendError(what, where=address, remedy=remedy)
        time.sleep(0.2)


def _language(ours: Mapping[str, Any], theirs: Mapping[str, Any] | None) -> str:
    """Says which versions differ so much that no call of ours can be understood."""
    here, there = ours["packages"], (theirs or {}).get("packages") or {}
    other = []
    for name in _LANGUAGE:
        wanted, found = _short(name, here.get(name)), _short(name, there.get(name))
        if wanted != found:
            other.append(f"{name} {found} instead of {wanted}")
    return ", ".join(other)


def _short(name: str, version: object) -> str:
    text = str(version or "(missing)")
    return ".".join(text.split(".")[:2]) if name == "python" else text


def _check_scheduler(client: Client, address: str) -> None:
    """The scheduler reads the names of the functions that it hands on."""
    try:
        client.run_on_scheduler(versions_here)
    except Exception as error:
        what = "The scheduler cannot import robid" if _lacks_robid(error) else "The scheduler refuses to run robid"
        raise BackendError(f"B008 {what}: {error}.", where=address, remedy=_REMEDIES[VERSIONS]) from error


def _complaint_of(answer: Complaint | Exception) -> Complaint:
    if isinstance(answer, Complaint):
        return answer
    return Complaint(VERSIONS, f"{'cannot import robid' if _lacks_robid(answer) else 'does not answer'} ({answer})")


def _lacks_robid(error: Exception) -> bool:
    """An error that arises while a message is read arrives as its text."""
    return isinstance(error, ImportError) or "ModuleNotFoundError" in str(error) or "ImportError" in str(error)


def _refuse(complaints: Mapping[str, Complaint], count: int, address: str) -> None:
    if complaints:
        raise _error(complaints, f"{len(complaints)} of {count} workers cannot be used", where=address)


def _error(complaints: Mapping[str, Complaint], what: str, *, where: str = "", remedy_after: str = "") -> BackendError:
    named = [f"{worker} {complaint.text}" for worker, complaint in complaints.items()]
    more = f"; and {len(named) - _SHOWN} more" if len(named) > _SHOWN else ""
    kinds = dict.fromkeys(complaint.kind for complaint in complaints.values())
    remedy = "; ".join(_REMEDIES[kind].removesuffix(f"; {GUIDE}") for kind in kinds)
    return BackendError(
        f"B009 {what}: {'; '.join(named[:_SHOWN])}{more}.", where=where, remedy=f"{remedy}; {GUIDE}{remedy_after}"
    )
