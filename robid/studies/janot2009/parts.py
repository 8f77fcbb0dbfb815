"""The parts of the study, in the order of its page."""

from __future__ import annotations

from robid.settings.load import LoadedExperiment
from robid.studies.janot2009.branch.page import conclude_branch
from robid.studies.janot2009.branch.runs import branch_tasks, identify_branch
from robid.studies.janot2009.emps import conclude_emps, further_emps
from robid.studies.janot2009.haptic.page import conclude_haptic
from robid.studies.janot2009.haptic.runs import haptic_tasks, identify_haptic
from robid.studies.janot2009.kr300.page import conclude_kr300
from robid.studies.janot2009.kr300.runs import further_kr300, identify_robots, kr300_tasks
from robid.studies.janot2009.section import study_of
from robid.studies.janot2009.tx40.page import conclude_tx40, further_tx40
from robid.studies.paper import paper_figures
from robid.studies.part import Part

PARTS = (
    Part("haptic", conclude_haptic, haptic_tasks, identify_haptic),
    Part("branch", conclude_branch, branch_tasks, identify_branch),
    Part("emps", conclude_emps, further=further_emps),
    Part("tx40", conclude_tx40, further=further_tx40),
    Part("kr300", conclude_kr300, kr300_tasks, identify_robots, further_kr300),
)


def prepare(loaded: LoadedExperiment) -> None:
    """Refuses a file of the paper's figures that cannot be read."""
    paper_figures(study_of(loaded).paper, loaded)
