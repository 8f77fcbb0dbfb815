"""The study of trust.

Read `check`, `individuals`, `study`, `responses`, `models`, `linear`, `grades`, `coverage`, `figures`, `report`.
"""

from __future__ import annotations

from robid.studies.study import Procedure, Step, Study
from robid.studies.trust.check import check_trust


def _procedure() -> Procedure:
    from robid.studies.trust import grades, linear, models, report, responses, study

    return Procedure(
        study.needs,
        (
            Step("responses", responses.response_tasks, responses.measure),
            Step("models", models.model_tasks, models.fit_individual),
            Step("linear", linear.linear_tasks, linear.fit_linear),
            Step("grades", grades.grade_tasks, grades.grade_individual),
        ),
        report.conclude,
        study.further,
    )


TRUST = Study(check_trust, _procedure)
