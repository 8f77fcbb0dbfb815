"""The parts of the study, in the order of its page."""

from __future__ import annotations

from robid.settings.load import LoadedExperiment
from robid.studies.oliveira2019.arm.homes import homes_tasks, map_home
from robid.studies.oliveira2019.arm.page import conclude_arm, further_arm
from robid.studies.oliveira2019.emps import conclude_emps, further_emps
from robid.studies.oliveira2019.plants.coverage import conclude_coverage, cover, coverage_tasks
from robid.studies.oliveira2019.plants.page import conclude_plants
from robid.studies.oliveira2019.plants.runs import identify, plants_tasks
from robid.studies.oliveira2019.section import study_of
from robid.studies.oliveira2019.synthetic import conclude_synthetic, find, synthetic_tasks
from robid.studies.paper import paper_figures
from robid.studies.part import Part

PARTS = (
    Part("plants", conclude_plants, plants_tasks, identify),
    Part("coverage", conclude_coverage, function=cover, following=coverage_tasks),
    Part("synthetic", conclude_synthetic, synthetic_tasks, find),
    Part("arm", conclude_arm, homes_tasks, map_home, further_arm),
    Part("emps", conclude_emps, further=further_emps),
)


def prepare(loaded: LoadedExperiment) -> None:
    """Refuses a file of the paper's figures that cannot be read."""
    paper_figures(study_of(loaded).paper, loaded)
