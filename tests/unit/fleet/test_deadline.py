"""A row that does not end is stopped, in any thread and in any process, and the rest goes on."""

import signal
import threading
import time
from contextlib import contextmanager, suppress
from functools import partial

import pytest

from robid.backends.map import make_map
from robid.errors import WorkerError
from robid.fleet import deadline
from robid.fleet import run as fleet_run
from robid.fleet.deadline import LateError, within
from robid.fleet.row import RowTask, run_row
from robid.settings.placeholders import Row

LONG_S = 20.0


def forever():
    until = time.monotonic() + LONG_S
    while time.monotonic() < until:
        try:
            sum(range(1000))
        except Exception:  # noqa: BLE001  nothing here may take the end for an error
            raise AssertionError from None


def stopped_after(run, seconds):
    begun = time.monotonic()
    with pytest.raises(LateError):
        within(seconds, run)
    return time.monotonic() - begun


def in_a_thread(call):
    found = []
    thread = threading.Thread(target=lambda: found.append(call()))
    thread.start()
    thread.join()
    return found[0]


@pytest.mark.parametrize("where", [lambda call: call(), in_a_thread], ids=["main thread", "other thread"])
def test_what_does_not_end_is_stopped(where):
    before = signal.getsignal(signal.SIGALRM)
    assert where(lambda: stopped_after(forever, 0.3)) < LONG_S / 2
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_waiting_for_the_system_is_stopped_too():
    assert stopped_after(lambda: time.sleep(LONG_S), 0.3) < LONG_S / 2


def test_an_error_by_being_stopped_is_the_limit_and_one_before_it_is_its_own():
    def swallow():
        try:
            forever()
        except BaseException:  # noqa: BLE001  as compiled code does
            raise OSError from None

    stopped_after(swallow, 0.3)
    with pytest.raises(ZeroDivisionError):
        within(LONG_S, lambda: 1 / 0)
    assert (within(None, lambda: 3), within(LONG_S, lambda: 4)) == (3, 4)


@pytest.mark.parametrize("where", [lambda call: call(), in_a_thread], ids=["main thread", "other thread"])
def test_nothing_is_stopped_after_its_end(where):
    def soon():
        for _ in range(200):
            with suppress(LateError):
                within(1e-3, lambda: time.sleep(0.9e-3))
        time.sleep(0.02)
        return True

    assert where(soon)


def test_a_row_that_does_not_end_has_failed_with_the_reason(tmp_path, monkeypatch):
    (tmp_path / "rows").mkdir()
    monkeypatch.setattr("robid.fleet.row.load_task", lambda _: forever())
    task = RowTask(Row("r1", "", tmp_path, {}), tmp_path / "a.yaml", "", tmp_path / "rows", False, timeout_s=0.3)
    ledger = run_row(task)
    assert (ledger.status, ledger.error.kind) == ("failed", "time")
    assert "0.3 s" in ledger.error.message
    assert (tmp_path / "rows/r1/row.json").exists()


def hold_the_interpreter(_):
    """Is at work in compiled code that does not let Python run, as a library that loops."""
    deadline.GRACE_S = 0.5
    within(0.5, lambda: sum(range(10**11)))


def test_compiled_code_that_does_not_return_ends_with_its_worker():
    begun = time.monotonic()
    with pytest.raises(WorkerError), make_map("processes", 1) as mapped:
        mapped(hold_the_interpreter, [0])
    assert time.monotonic() - begun < LONG_S


def test_a_row_that_ends_its_worker_at_the_limit_is_told_as_late(tmp_path, monkeypatch):
    told = []
    monkeypatch.setattr(fleet_run, "fail_row", lambda _, *, late: told.append(late))
    for limit, spent in ((0.1, 0.2), (0.1, 0.0), (None, 0.2)):
        task = RowTask(Row("r1", "", tmp_path, {}), tmp_path / "a.yaml", "", tmp_path, False, timeout_s=limit)
        fleet_run._run_alone(task, partial(dying_map, spent), lambda _: None)
    assert told == [True, False, False]


@contextmanager
def dying_map(seconds, *, one):
    assert one

    def mapped(*_):
        time.sleep(seconds)
        raise WorkerError("B010 it died")

    yield mapped
