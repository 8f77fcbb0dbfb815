"""The model at rest beside the paper's: figures, Tables I to IV and Figs 3 to 8."""

from __future__ import annotations

from collections.abc import Sequence

from robid.artifacts.artifact import Artifact
from robid.artifacts.model import MODEL
from robid.artifacts.store import read_artifact
from robid.artifacts.validation import VALIDATION
from robid.families.lpv.files import solution_from_artifact, validation_from_artifact
from robid.families.lpv.settings import lpv_fit
from robid.fit.lpv.solution import LpvSolution
from robid.pipeline import Run
from robid.studies.part import Asked, PartFound
from robid.studies.turk2018.local.figures import held_figures
from robid.studies.turk2018.section import study_of
from robid.validation.lpv.validating import LpvValidation

_LEAST_LOCAL, _LEAST_LEFT_OUT, _LEAST_DROPPED = 0.88, 0.80, 7


def further_local(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns what is read of the study's own experiment: the fit with its validation, and the responses left out."""
    case = study_of(run.loaded).local
    if case is None:
        return ()
    model, validation = (f"fits/{case.fit}/{name}.h5" for name in ("model", "validation"))
    return ((run, (model, validation, f"{lpv_fit(run.loaded.experiment, case.fit).validate_on}/frf.h5")),)


def conclude_local(run: Run, _results: Sequence[Artifact]) -> PartFound | None:
    """Turns the fit and its validation into figures, and what is asked of them."""
    case = study_of(run.loaded).local
    if case is None:
        return None
    solution = solution_from_artifact(read_artifact(run.path(f"fits/{case.fit}/model.h5"), MODEL))
    validation = validation_from_artifact(read_artifact(run.path(f"fits/{case.fit}/validation.h5"), VALIDATION))
    figures = local_figures(solution, validation)
    asked = {
        "local.share_within_2std": Asked(lower=_LEAST_LOCAL),
        "left_out.share_within_2std": Asked(lower=_LEAST_LEFT_OUT),
        "blocks_dropped": Asked(lower=_LEAST_DROPPED),
    }
    return PartFound(figures, asked)


def local_figures(solution: LpvSolution, validation: LpvValidation) -> dict[str, float]:
    """Returns what the study says of the model at rest."""
    kept, outputs = solution.blocks.kept, solution.ports.outputs
    return {
        **held_figures("local", solution.own, outputs),
        **held_figures("left_out", validation.held, outputs),
        "blocks": float(kept.size),
        "blocks_dropped": float(kept.size - kept.sum()),
        "largest_pole": solution.largest_pole,
    }
