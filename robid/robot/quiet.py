"""Keeping MuJoCo's warnings off the screen and out of the log file that it writes beside the user's files."""

from __future__ import annotations

import contextlib
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
