"""Keeps the scheduler's log messages and warnings from the terminal: what a user must know, robid says."""

from __future__ import annotations

import logging
import warnings
from collections.abc import Iterator
from contextlib import contextmanager

from distributed.versions import VersionMismatchWarning

SILENT = logging.CRITICAL + 1
_ROOTS = ("asyncio", "distributed", "tornado")


@contextmanager
def quiet() -> Iterator[None]:
    """Silences the libraries beneath; levels and filters are as before afterwards."""
    names = [*_ROOTS, *(name for name in logging.root.manager.loggerDict if name.startswith(_ROOTS))]
    levels = {name: logging.getLogger(name).level for name in names}
    for name in names:
        logging.getLogger(name).setLevel(SILENT)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", VersionMismatchWarning)
            warnings.filterwarnings("ignore", module=r"distributed\.")
            yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)
