"""The model at rest beside the paper's: figures, Tables I to IV and Figs 3 to 8."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.results import MODEL, VALIDATION
from robid.artifacts.store import read_artifact
from robid.models.lpv.files import solution_from_artifact, validation_from_artifact
from robid.models.lpv.settings import lpv_fit
from robid.pipeline import Run
from robid.studies.paper import paper_figures
from robid.studies.part import Asked, PartFound
from robid.studies.turk2018.local.figures import rest_figures
from robid.studies.turk2018.local.pictures import bode_section, left_out_section
from robid.studies.turk2018.local.tables import block_section, nearness_section
from robid.studies.turk2018.section import study_of

_ASKED = {
    "local.share_within_2std": Asked(lower=0.88),
    "left_out.share_within_2std": Asked(lower=0.80),
    "left_out.excess_percent": Asked(upper=5.0),
    "blocks_dropped": Asked(lower=7),
}
_DEVIATION_DB = Asked(20.0, 35.0)
"""What the data have to be like, by the paper's Figs 7 and 8."""


def further_local(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns what is read of the study's own experiment: the fit with its validation, and the responses left out."""
    case = study_of(run.loaded).local
    if case is None:
        return ()
    model, validation = (f"fits/{case.fit}/{name}.h5" for name in ("model", "validation"))
    return ((run, (model, validation, f"{lpv_fit(run.loaded.experiment, case.fit).validate_on}/frf.h5")),)


def conclude_local(run: Run, _results: Sequence[Artifact]) -> PartFound | None:
    """Turns the fit and its validation into figures, tables and pictures, and what is asked of them."""
    study = study_of(run.loaded)
    case = study.local
    if case is None:
        return None
    settings, paper = lpv_fit(run.loaded.experiment, case.fit), paper_figures(study.paper, run.loaded)
    solution = solution_from_artifact(read_artifact(run.path(f"fits/{case.fit}/model.h5"), MODEL))
    validation = validation_from_artifact(read_artifact(run.path(f"fits/{case.fit}/validation.h5"), VALIDATION))
    measured = frf_from_artifact(read_artifact(run.path(f"{settings.validate_on}/frf.h5"), FRF))
    left_out, window = validation.held, settings.weight_window
    figures = rest_figures(solution, left_out, window)
    sections = (
        nearness_section(solution, left_out, window),
        block_section(solution, paper),
        bode_section(solution),
        left_out_section(solution, left_out, measured),
    )
    return PartFound(figures, asked_of(figures), sections)


def asked_of(figures: Mapping[str, float]) -> dict[str, Asked]:
    """Returns what is asked of the figures."""
    levels = {name: _DEVIATION_DB for name in figures if ".median_deviation_db." in name}
    return {**_ASKED, **levels}
