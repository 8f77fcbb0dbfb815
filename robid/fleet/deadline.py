"""A time limit for a row: in whatever thread it runs, and, where it can be, for compiled code that never returns."""

from __future__ import annotations

import ctypes
import faulthandler
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

Result = TypeVar("Result")

GRACE_S = 10.0
"""How long compiled code may go on beyond the limit before it ends with its worker process."""


class LateError(Exception):
    """What had a time limit did not end within it."""


class _StopNow(BaseException):
    """Ends a row; nothing takes it for an error of its own."""


def within(seconds: float | None, call: Callable[[], Result]) -> Result:
    """Calls a function and ends it after a while.

    A worker process in which a library does not return to Python dies after `GRACE_S` more; the map that it belongs
    to tells. A row in the process of the command itself, as with the backend `serial`, waits for the library.

    Args:
        seconds: The limit [s]; none where it is None.
        call: What to do.

    Raises:
        LateError: If it did not end; an error that it ran into because it was stopped is none of its own.
    """
    if seconds is None:
        return call()
    clock = (_Alarm if threading.current_thread() is threading.main_thread() else _Stopper)(seconds)
    try:
        clock.start()
        try:
            with _ending_with_process(seconds + GRACE_S):
                return call()
        finally:
            clock.stop()
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        clock.stop()  # where it rang between the end and its being stopped
        if clock.late:
            raise LateError from error
        raise


class _Alarm:
    """Stops the main thread by a signal, which also ends its waiting for the system."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._armed = self.late = False

    def start(self) -> None:
        self._armed = True
        self._before = signal.signal(signal.SIGALRM, self._stop_now)
        # Again and again: compiled code may swallow the first.
        signal.setitimer(signal.ITIMER_REAL, self._seconds, 1.0)

    def stop(self) -> None:
        if self._armed:
            self._armed = False
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, self._before)

    def _stop_now(self, *_: object) -> None:
        if self._armed:
            self.late = True
            raise _StopNow


class _Stopper:
    """Stops another thread, as that in which a Dask worker runs a task, between two steps of Python."""

    def __init__(self, seconds: float) -> None:
        self.late = False
        self._thread = ctypes.c_ulong(threading.get_ident())
        self._lock = threading.Lock()
        self._timer: threading.Timer | None = threading.Timer(seconds, self._stop_now)

    def start(self) -> None:
        if self._timer is not None:
            self._timer.daemon = True
            self._timer.start()

    def stop(self) -> None:
        with self._lock:
            timer, self._timer = self._timer, None
            if timer is not None:
                timer.cancel()
                ctypes.pythonapi.PyThreadState_SetAsyncExc(self._thread, None)  # what it was sent too late

    def _stop_now(self) -> None:
        with self._lock:
            if self._timer is not None:
                self.late = True
                ctypes.pythonapi.PyThreadState_SetAsyncExc(self._thread, ctypes.py_object(_StopNow))


@contextmanager
def _ending_with_process(seconds: float) -> Iterator[None]:
    """Ends a worker process after a while, whatever it is at."""
    if multiprocessing.parent_process() is None:
        yield
        return
    with Path(os.devnull).open("w") as nowhere:
        faulthandler.dump_traceback_later(seconds, exit=True, file=nowhere)
        try:
            yield
        finally:
            faulthandler.cancel_dump_traceback_later()
