"""The study of estimators of responses. Read `check`, `study`, `figures`, `report`."""

from __future__ import annotations

from robid.studies.frf.check import check_frf_study
from robid.studies.study import Procedure, Study, one_step


def _procedure() -> Procedure:
    from robid.studies.frf import report, study

    return one_step(study.needs, study.tasks, study.estimate_chunk, report.conclude)


FRF_STUDY = Study(check_frf_study, _procedure)
