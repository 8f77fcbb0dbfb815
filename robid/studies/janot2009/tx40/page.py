"""A real arm of six axes against the values that its authors published."""

from __future__ import annotations

from collections.abc import Sequence

from robid.artifacts.artifact import Artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.models.rigid.files import solution_from_artifact
from robid.pipeline import Run
from robid.report.numbers import significant
from robid.report.section import Section, Table
from robid.studies.elsewhere import missing_log, run_of
from robid.studies.janot2009.section import study_of
from robid.studies.janot2009.tx40.published import published_rows, tx40_figures
from robid.studies.part import Asked, PartFound

_ASKED = {
    "tx40.max_inertia_error_percent": Asked(upper=15.0),
    "tx40.max_viscous_error_percent": Asked(upper=20.0),
}


def further_tx40(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns the arm's experiment with its fit, where its logs are there."""
    case = study_of(run.loaded).tx40
    if case is None:
        return ()
    own = run_of(run, case.experiment, "tx40")
    return () if missing_log(own) else ((own, (f"fits/{case.fit}/model.h5",)),)


def conclude_tx40(run: Run, _results: Sequence[Artifact]) -> PartFound | None:
    """Turns the arm's fit into figures and what is asked of them."""
    case = study_of(run.loaded).tx40
    if case is None:
        return None
    own = run_of(run, case.experiment, "tx40")
    lacking = missing_log(own)
    if lacking:
        return PartFound({}, warnings=(f"The TX40 is left out: there is no {lacking}; set ROBID_DATA.",))
    solution = solution_from_artifact(read_artifact(own.path(f"fits/{case.fit}/model.h5"), MODEL))
    robot = own.loaded.robot.to_robot()
    rows = tuple(
        (row.name, row.unit, significant(row.published), significant(row.found), f"{row.error_percent:+.1f} %")
        for row in published_rows(solution, robot)
    )
    caption = "Arm side, as published; the wrist's sixth motor turns with axes 5 and 6."
    table = Table(("Parameter", "Unit", "Published", "Ours", "Off"), rows, caption=caption, fit="compact")
    section = Section("Real data: the TX40", solution.checks.sentence, (table,))
    return PartFound(tx40_figures(solution, robot), _ASKED, (section,))
