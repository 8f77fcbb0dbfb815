"""The parts of the study, in the order of its page."""

from __future__ import annotations

from robid.studies.janot2009.branch.page import conclude_branch
from robid.studies.janot2009.branch.runs import branch_tasks, identify_branch
from robid.studies.janot2009.emps import conclude_emps, further_emps
from robid.studies.janot2009.haptic.page import conclude_haptic
from robid.studies.janot2009.haptic.runs import haptic_tasks, identify_haptic
from robid.studies.janot2009.part import Part

PARTS = (
    Part("haptic", conclude_haptic, haptic_tasks, identify_haptic),
    Part("branch", conclude_branch, branch_tasks, identify_branch),
    Part("emps", conclude_emps, further=further_emps),
)
