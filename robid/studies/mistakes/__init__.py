"""The study of mistakes. Read `check`, `study`, `mistaken`, `responses`, `cases`, `grades`, `report`."""

from __future__ import annotations

from robid.studies.mistakes.check import check_mistakes
from robid.studies.study import Procedure, Step, Study


def _procedure() -> Procedure:
    from robid.studies.mistakes import cases, report, responses, study

    return Procedure(
        study.needs,
        (
            Step("responses", responses.response_tasks, responses.measure),
            Step("models", cases.model_tasks, cases.fit_case),
            Step("cases", cases.case_tasks, cases.judge_case),
        ),
        report.conclude,
        study.further,
    )


MISTAKES = Study(check_mistakes, _procedure)
