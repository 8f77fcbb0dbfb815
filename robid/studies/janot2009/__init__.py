"""The study of robust regression of Janot et al. (2009).

Read `check`, `part`, `seeded`; then its parts `haptic`, `branch` and `emps`; then `parts`, `report`.
"""

from __future__ import annotations

from robid.studies.janot2009.check import check_janot2009
from robid.studies.study import Procedure, Study


def _procedure() -> Procedure:
    from robid.studies.janot2009 import report
    from robid.studies.janot2009.parts import PARTS

    return Procedure(report.needs, tuple(part.step for part in PARTS), report.conclude, report.further)


JANOT2009 = Study(check_janot2009, _procedure)
