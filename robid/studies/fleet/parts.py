"""The parts of the study, in the order of its page."""

from __future__ import annotations

from robid.errors import require_module
from robid.fleet.table import require_table
from robid.settings.load import LoadedExperiment
from robid.studies.fleet.logs import LOGS
from robid.studies.fleet.robots import study_of
from robid.studies.fleet.scheduler import SCHEDULER
from robid.studies.fleet.speed import SPEED
from robid.studies.fleet.whole import WHOLE
from robid.studies.part import Part

PARTS: tuple[Part, ...] = (LOGS, WHOLE, SPEED, SCHEDULER)


def prepare(loaded: LoadedExperiment) -> None:
    """Refuses to start without the packages that tables and Dask need."""
    require_table()
    if study_of(loaded).speed is not None or study_of(loaded).scheduled:
        require_module("distributed", "dask", "What the study measures of Dask")
