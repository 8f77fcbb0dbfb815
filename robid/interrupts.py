"""Interrupts that compiled code swallows: whoever asked to stop is heard all the same."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

_heard: list[int] = []


@contextmanager
def hearing() -> Iterator[None]:
    """Notes interrupts beside raising them: from within a compiled call they may come as another error, or never."""
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, _hear)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        _heard.clear()


def was_interrupted() -> bool:
    """Returns whether an interrupt came within `hearing`."""
    return bool(_heard)


def stop_if_interrupted() -> None:
    """Raises an interrupt that was swallowed.

    Raises:
        KeyboardInterrupt: If one came within `hearing`.
    """
    if _heard:
        raise KeyboardInterrupt


def _hear(number: int, _frame: FrameType | None) -> None:
    _heard.append(number)
    raise KeyboardInterrupt
