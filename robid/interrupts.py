"""Interrupts that compiled code swallows: whoever asked to stop is heard all the same.

SIGTERM ends a command in the same way as SIGINT does: workers and locks go with it.
"""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_AGAIN_S = 0.02  # after which an interrupt is raised again that Python could not raise where it came
_heard: list[int] = []


def leave_at_once() -> None:
    """Has interrupts end this process without a traceback, as long as it only imports and there is nothing to keep."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)


def _leave(number: int, _frame: FrameType | None) -> None:
    os._exit(128 + number)


@contextmanager
def hearing() -> Iterator[None]:
    """Notes interrupts beside raising them: from within a compiled call they may come as another error, or never."""
    usual = {signal.SIGINT: (signal.default_int_handler, _leave), signal.SIGTERM: (signal.SIG_DFL,)}
    before = {number: signal.getsignal(number) for number in usual}
    if threading.current_thread() is not threading.main_thread():
        before = {}
    before = {number: handler for number, handler in before.items() if handler in usual[number]}
    hook = sys.unraisablehook
    if before:
        sys.unraisablehook = _raise_again
    for number in before:
        signal.signal(number, _hear)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if before:
            sys.unraisablehook = hook
            _heard.clear()


def was_interrupted() -> bool:
    """Returns whether an interrupt came within `hearing`."""
    return bool(_heard)


def code_of_interrupt() -> int:
    """Returns the exit code of the first signal that came within `hearing`; that of an interrupt where none did."""
    return 128 + (_heard[0] if _heard else signal.SIGINT)


def stop_if_interrupted() -> None:
    """Raises an interrupt that was swallowed.

    Raises:
        KeyboardInterrupt: If one came within `hearing`.
    """
    if _heard:
        raise KeyboardInterrupt


def forget_interrupts() -> None:
    """Has this process end with its own code: Python ends it by SIGINT after an interrupt within `exec` of a text.

    Modules with dataclasses and named tuples do that while they are imported; the next text that is executed clears
    what Python notes there (`unhandled_keyboard_interrupt` in CPython's `pythonrun.c`).
    """
    exec("")


@contextmanager
def deaf_children() -> Iterator[None]:
    """Processes that are started meanwhile leave interrupts to this one, from before their first line on."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    # The tracker of `multiprocessing` lets interrupts through again in the thread that starts it: it starts before.
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _hear(number: int, _frame: FrameType | None) -> None:
    _heard.append(number)
    raise KeyboardInterrupt


def _raise_again(found: "sys.UnraisableHookArgs") -> None:
    """Raises an interrupt a moment later that came within a callback, where Python only prints errors."""
    if not issubclass(found.exc_type, KeyboardInterrupt):
        sys.__unraisablehook__(found)
        return

    def again() -> None:
        if _heard:
            # A real signal, which ends a system call that waits.
            os.kill(os.getpid(), signal.SIGINT)

    timer = threading.Timer(_AGAIN_S, again)
    timer.daemon = True
    timer.start()
