"""Keeping MuJoCo's warnings off the screen and out of the log file that it writes beside the user's files."""

from __future__ import annotations

import contextlib
import warnings
from collections.abc import Iterator

import mujoco


@contextlib.contextmanager
def quiet_warnings() -> Iterator[list[str]]:
    """Collects MuJoCo's warnings instead of having them printed and written to `MUJOCO_LOG.TXT`."""
    before, told = mujoco.get_mju_user_warning(), []
    mujoco.set_mju_user_warning(lambda message: told.append(str(message)))
    try:
        yield told
    finally:
        mujoco.set_mju_user_warning(before)


@contextlib.contextmanager
def quiet_reading() -> Iterator[list[str]]:
    """Collects what MuJoCo warns of while it reads and compiles a file, which it says through Python, too."""
    with quiet_warnings() as told, warnings.catch_warnings(record=True) as raised:
        warnings.simplefilter("always", UserWarning)
        try:
            yield told
        finally:
            told += [str(each.message) for each in raised]
