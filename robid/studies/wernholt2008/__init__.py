"""The study of parameter estimators of Wernholt and Moberg (2008).

Read `check`, `study`, `individuals`, `figures`, `conclusions`, `report`.
"""

from __future__ import annotations

from robid.studies.study import Procedure, Step, Study
from robid.studies.wernholt2008.check import check_wernholt2008


def _procedure() -> Procedure:
    from robid.studies.wernholt2008 import individuals, report, study

    return Procedure(
        study.needs,
        (
            Step("starts", study.tasks, study.fit_chunk),
            Step("individuals", individuals.individual_tasks, individuals.fit_individual),
        ),
        report.conclude,
    )


WERNHOLT2008 = Study(check_wernholt2008, _procedure)
