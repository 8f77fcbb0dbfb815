"""What a user should know of an experiment before anything runs, said once a run folder."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from robid.settings.checks.configurations import other_units
from robid.settings.numbering import NEWEST
from robid.writing import open_own

if TYPE_CHECKING:
    from robid.pipeline.graph import Run
    from robid.pipeline.terminal import Shell

_SAID = ".notices"  # beside the lock of the run folder


@contextmanager
def notices(run: Run, shell: Shell) -> Iterator[None]:
    """Tells notes on the robot's model and the schema's version, and what looks like another unit, unless it was told.

    What is quiet tells no notes, and what is refused afterwards leaves nothing: both do not count as having told them.
    """
    loaded = run.loaded
    notes = [(loaded.robot.name, text) for text in loaded.robot.model_notes]
    if loaded.experiment.schema_version < NEWEST:
        told = f"schema_version 1 counts configurations from 0; `robid upgrade {loaded.path}` has them count from 1"
        notes.append((str(loaded.path), told))
    before = _said(run)
    for subject, text in notes:
        if text not in before:
            shell.note(subject, text)
    units = other_units(loaded.experiment, loaded.robot)
    for text in units:
        if text not in before:
            shell.warn(text)
    said = [*units, *(text for _, text in notes if not shell.quiet)]
    fresh = [text for text in said if text not in before]
    yield
    if fresh and run.folder.is_dir():
        with suppress(OSError), os.fdopen(open_own(run.path(_SAID)), "a", encoding="utf-8") as file:
            file.writelines(f"{text}\n" for text in fresh)


def _said(run: Run) -> frozenset[str]:
    """What was told before of what goes to this run folder."""
    with suppress(OSError, ValueError):
        if run.path(_SAID).is_file():
            return frozenset(run.path(_SAID).read_text(encoding="utf-8").splitlines())
    return frozenset()
