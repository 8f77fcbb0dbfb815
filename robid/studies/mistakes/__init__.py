"""The study of mistakes. Read `check`, `study`, `mistaken`, `responses`, `cases`, `grades`, `units`, `report`."""

from __future__ import annotations

from robid.studies.mistakes.check import check_mistakes
from robid.studies.study import Procedure, Step, Study


def _procedure() -> Procedure:
    from robid.studies.mistakes import cases, report, responses, study
    from robid.studies.mistakes.units.cases import read_individual, unit_tasks
    from robid.studies.mistakes.units.robots import needed_by_units

    return Procedure(
        study.needs,
        (
            Step("responses", responses.response_tasks, responses.measure),
            Step("models", cases.model_tasks, cases.fit_case),
            Step("cases", cases.case_tasks, cases.judge_case),
            Step("units", unit_tasks, read_individual),
        ),
        report.conclude,
        lambda run: (*study.further(run), *needed_by_units(run)),
    )


MISTAKES = Study(check_mistakes, _procedure)
