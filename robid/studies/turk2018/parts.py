"""The parts of the study, in the order of its page."""

from __future__ import annotations

from robid.settings.load import LoadedExperiment
from robid.studies.paper import paper_figures
from robid.studies.part import Part
from robid.studies.turk2018.local.page import conclude_local, further_local
from robid.studies.turk2018.moving.page import conclude_travel, further_travel
from robid.studies.turk2018.section import study_of
from robid.studies.turk2018.synthetic import conclude_synthetic, find, synthetic_tasks

PARTS = (
    Part("synthetic", conclude_synthetic, synthetic_tasks, find),
    Part("local", conclude_local, further=further_local),
    Part("global", conclude_travel, further=further_travel),
)


def prepare(loaded: LoadedExperiment) -> None:
    """Refuses a file of the paper's figures that cannot be read."""
    paper_figures(study_of(loaded).paper, loaded)
