"""What is checked before a cluster is given anything to do."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from robid.backends.dask.worker import FOLDER, INPUTS, THREADS, VERSIONS, Complaint, Terms, examine, versions_here
from robid.errors import BackendError

if TYPE_CHECKING:
    from distributed import Client

WAIT_FOR_WORKERS_S = 60.0
_ANSWER_S = 60.0
_SHOWN = 5

GUIDE = "docs/clusters.md says how"
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
        raise BackendError(f"The scheduler has {other}.", where=address, remedy=_REMEDIES[VERSIONS])
    found = {worker: _language(versions["client"], seen) for worker, seen in versions["workers"].items()}
    _refuse({worker: Complaint(VERSIONS, f"has {text}") for worker, text in found.items() if text}, len(found), address)
    _check_scheduler(client, address)
    answers = client.sync(client._run, examine, terms, on_error="return", callback_timeout=_ANSWER_S)
    _refuse({worker: _complaint(each) for worker, each in answers.items() if each is not None}, len(answers), address)


def refusal(worker: str, complaint: Complaint) -> BackendError:
    """Returns the error for a worker that joined later and may not take part."""
    return _error(
        {worker: complaint}, "A worker that joined later cannot be used", remedy_after="; the same command goes on"
    )


def _wait_for_workers(client: Client, address: str) -> None:
    deadline = time.monotonic() + WAIT_FOR_WORKERS_S
    while not client.nthreads():
        if time.monotonic() > deadline:
            raise BackendError(
                f"The scheduler has had no workers for {WAIT_FOR_WORKERS_S:.0f} s.",
                where=address,
                remedy=f"start some, as in `dask worker {address} --nthreads 1`; {GUIDE}",
            )
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
        raise BackendError(f"{what}: {error}.", where=address, remedy=_REMEDIES[VERSIONS]) from error


def _complaint(answer: Complaint | Exception) -> Complaint:
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
        f"{what}: {'; '.join(named[:_SHOWN])}{more}.", where=where, remedy=f"{remedy}; {GUIDE}{remedy_after}"
    )
