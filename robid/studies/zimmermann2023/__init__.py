"""The study of configurations of Zimmermann et al. (2023).

Read `check`, `study`, `models`, `steps`, `sets`, `scatter`, `rivals`, `figures`, `report`.
"""

from __future__ import annotations

from robid.studies.study import Procedure, Step, Study
from robid.studies.zimmermann2023.check import check_zimmermann2023


def _procedure() -> Procedure:
    from robid.studies.zimmermann2023 import models, report, sets, steps, study

    return Procedure(
        study.needs,
        (
            Step("responses", study.response_tasks, study.measure),
            Step("models", models.model_tasks, models.fit_model),
            Step("steps", steps.step_tasks, steps.step),
            Step("sets", sets.set_tasks, sets.fit_set),
        ),
        report.conclude,
    )


ZIMMERMANN2023 = Study(check_zimmermann2023, _procedure)
