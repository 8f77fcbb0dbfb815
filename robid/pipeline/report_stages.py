"""How the artifacts of a run came about, for its report."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from datetime import datetime
from pathlib import Path

from robid.artifacts.store import read_header
from robid.pipeline.stage import Stage
from robid.report.experiment import StageRow
from robid.settings.load import LoadedExperiment

_SHORT = 8


def stage_rows(
    loaded: LoadedExperiment, folder: Path, present: Collection[str], chain: Sequence[Stage]
) -> tuple[StageRow, ...]:
    """Returns how each artifact that is there came about."""
    makers = {
        stage.plan(loaded, name).outputs[0]: (stage, name)
        for stage in chain
        for name in stage.owners(loaded.experiment)
    }
    rows = []
    for path in present:
        if path.endswith(".h5"):
            stage, name = makers[path]
            rows.append(_stage(path, folder / path, stage.phrase(loaded, name, folder / path)))
    return tuple(rows)


def _stage(path: str, file: Path, phrase: str) -> StageRow:
    header = read_header(file)
    made = header.provenance
    seconds = None
    if made.started_utc and made.finished_utc:
        begun, ended = datetime.fromisoformat(made.started_utc), datetime.fromisoformat(made.finished_utc)
        seconds = (ended - begun).total_seconds()
    hashes = made.settings_hash[:_SHORT], header.content_sha256[:_SHORT]
    return StageRow(made.stage, path, *hashes, seconds, phrase)
