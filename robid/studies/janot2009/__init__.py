"""The study of robust regression of Janot et al. (2009).

Read `check`, `part`; of the simulated machines `identification`, `chunks`, `haptic`, `branch`, `seeded`; then `emps`, `report`.
"""

from __future__ import annotations

from robid.studies.janot2009.check import check_janot2009
from robid.studies.study import Procedure, Step, Study


def _procedure() -> Procedure:
    from robid.studies.janot2009 import report
    from robid.studies.janot2009.parts import PARTS

    steps = tuple(Step(part.name, lambda run, _, part=part: part.tasks(run), part.function) for part in PARTS)
    return Procedure(report.needs, steps, report.conclude, report.further)


JANOT2009 = Study(check_janot2009, _procedure)
