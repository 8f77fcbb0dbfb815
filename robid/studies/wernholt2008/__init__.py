"""The study of parameter estimators of Wernholt and Moberg (2008).

Read `check`, `study`, `figures`, `conclusions`, `report`.
"""

from __future__ import annotations

from robid.studies.study import Procedure, Study, one_step
from robid.studies.wernholt2008.check import check_wernholt2008


def _procedure() -> Procedure:
    from robid.studies.wernholt2008 import report, study

    return one_step(study.needs, study.tasks, study.fit_chunk, report.conclude)


WERNHOLT2008 = Study(check_wernholt2008, _procedure)
