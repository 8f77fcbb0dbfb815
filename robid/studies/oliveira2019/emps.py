"""A real axis on a ball screw in its position loop, seen from outside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.artifacts.artifact import Artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.models.external.files import solution_from_artifact
from robid.models.external.fit.solution import ExternalSolution
from robid.pipeline import Run
from robid.report.numbers import significant
from robid.report.section import Section, Table
from robid.studies.elsewhere import missing_log, run_of
from robid.studies.oliveira2019.section import study_of
from robid.studies.part import Asked, PartFound

_PUBLISHED_RAD_S, _NEAR = 126.4, 0.01
_ASKED = {
    "emps.relative_error_percent": Asked(upper=0.005),
    "emps.natural_frequency": Asked((1 - _NEAR) * _PUBLISHED_RAD_S, (1 + _NEAR) * _PUBLISHED_RAD_S),
}
_DIGITS = 5


def further_emps(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns the axis' experiment with its fit, where its log is there."""
    case, own = study_of(run.loaded).emps, _run_of(run)
    if case is None or own is None or missing_log(own):
        return ()
    return ((own, (f"fits/{case.fit}/model.h5",)),)


def conclude_emps(run: Run, _results: Sequence[Artifact]) -> PartFound | None:
    """Turns the axis' fit into figures and what is asked of them."""
    case, own = study_of(run.loaded).emps, _run_of(run)
    if case is None or own is None:
        return None
    lacking = missing_log(own)
    if lacking:
        return PartFound({}, warnings=(f"The EMPS axis is left out: there is no {lacking}; set ROBID_DATA.",))
    solution = solution_from_artifact(read_artifact(own.path(f"fits/{case.fit}/model.h5"), MODEL))
    figures = _figures(solution)
    rows = tuple((name, significant(value, _DIGITS)) for name, value in figures.items())
    lead = (
        "A carriage on a ball screw, measured in its position loop: from commanded to actual position by two poles and"
        " a free gain. The relative error is the residual's norm over that of the position."
    )
    section = Section("Real data: the EMPS axis from outside", lead, (Table(("Figure", "Ours"), rows, fit="compact"),))
    return PartFound(figures, _ASKED, (section,))


def _run_of(run: Run) -> Run | None:
    case = study_of(run.loaded).emps
    return None if case is None else run_of(run, case.experiment, "emps")


def _figures(solution: ExternalSolution) -> dict[str, float]:
    traces, denominator = solution.traces, solution.transfer(0).denominator
    left = np.linalg.norm(traces.measured - traces.simulated)
    natural = float(np.sqrt(denominator[2]))
    return {
        "emps.relative_error_percent": 100 * float(left / np.linalg.norm(traces.measured)),
        "emps.natural_frequency": natural,
        "emps.damping": float(denominator[1]) / (2 * natural),
        "emps.gain": float(solution.transfer(0).static_gain[0, 0]),
    }
