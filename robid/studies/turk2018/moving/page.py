"""The model while the slide moves, beside the paper's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.artifacts.truth import read_truth
from robid.models.lpv.files import solution_from_artifact
from robid.models.lpv.fit.solution import LpvSolution
from robid.pipeline import Run
from robid.report.numbers import MISSING, significant
from robid.report.section import Beside, Curve, Figure, Notes, Section, Table
from robid.studies.paper import paper_figures
from robid.studies.part import Asked, PartFound
from robid.studies.turk2018.moving.figures import (
    Travelled,
    total_over_noise,
    travel,
    travel_figures,
    uncompensated_figures,
)
from robid.studies.turk2018.moving.prediction import split_errors
from robid.studies.turk2018.section import study_of

_MOST_PERCENT = 15.0
_DIGITS = 3
_POOLED = 8
_ROWS = {  # the paper's key where it prints the figure
    "error_over_stochastic": ("Error of the fitted model over its stochastic part", "error_over_stochastic"),
    "true_error_over_stochastic": ("The same of the true drive, linearised wherever it is", ""),
    "total_over_noise": ("At one position: total deviation over that of the noise (eq. 20)", "total_over_noise"),
    "error_percent": ("Error of the fitted model over the output [%]", ""),
    "true_error_percent": ("The same of the true drive [%]", ""),
    "ratio_mismatch_percent": ("Excess of the fitted model's error over the true drive's [%]", ""),
    "acceleration_mismatch_percent": ("The same of accelerations [%]", ""),
    "uncompensated_mismatch_percent": ("Excess of a model fitted to responses with friction in them [%]", ""),
    "unmoved_mismatch_percent": ("Excess where the model is told that the slide stands still [%]", ""),
}
_NOTES = (
    "The two ratios need not agree. At one position friction reverses all the time and differs from realization to"
    " realization; in a sweep it reverses with the sweep, and repeats. And they are counted differently: of P periods"
    " with noise alone, the error is sqrt(P / (P - 1)) of its stochastic part, 1.08 for seven, while eq. 20 gives"
    " 1 / sqrt(P), 0.38.",
    "Friction and cogging are none of either model, and the torque that they take is fed to both: their share of the"
    " error repeats from period to period. So the fitted model is judged by how much more it misses than the true"
    " drive does, linearised at every position and run along the same torque and positions.",
    "At rest a drive sticks and friction is a part of its responses, in a sweep it slides: so the model is fitted to"
    " responses with friction taken out. One that has it in, good as it is at rest, misses more.",
    "Errors of positions weigh low lines, those of accelerations the resonance.",
)


def further_travel(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns what is read of the study's own experiment: the fit, the travel, and the responses at one position."""
    case = study_of(run.loaded).travel
    if case is None:
        return ()
    models = tuple(f"fits/{name}/model.h5" for name in dict.fromkeys((case.fit, case.uncompensated)) if name)
    return ((run, (*models, f"{case.campaign}/record.h5", f"{case.fixed}/frf.h5")),)


def conclude_travel(run: Run, _results: Sequence[Artifact]) -> PartFound | None:
    """Turns the travel into figures and what is asked of them."""
    study = study_of(run.loaded)
    case = study.travel
    if case is None:
        return None
    path = run.path(f"{case.campaign}/record.h5")
    record = record_from_artifact(read_artifact(path, RECORD))
    frf = frf_from_artifact(read_artifact(run.path(f"{case.fixed}/frf.h5"), FRF))
    periods = run.loaded.experiment.campaigns[case.fixed].periods
    truth = read_truth(path.with_name("truth.json"), path)
    travelled = travel(_solution(run, case.fit), record, truth)
    figures = travel_figures(travelled, total_over_noise(frf, travelled.outputs, periods))
    if case.uncompensated is not None:
        figures |= uncompensated_figures(travel(_solution(run, case.uncompensated), record, truth))
    paper = paper_figures(study.paper, run.loaded).get("global", {})
    unstable = "The fitted model is unstable: its error while the slide moves is not a number."
    return PartFound(
        figures,
        {"global.ratio_mismatch_percent": Asked(upper=_MOST_PERCENT)},
        (travel_section(travelled, figures, paper),),
        () if np.isfinite(travelled.fitted).all() else (unstable,),
    )


def _solution(run: Run, fit: str) -> LpvSolution:
    return solution_from_artifact(read_artifact(run.path(f"fits/{fit}/model.h5"), MODEL))


def travel_section(travelled: Travelled, figures: Mapping[str, float], paper: Mapping[str, Any]) -> Section:
    """Shows the figures beside the paper's, and over which lines the errors lie."""
    outputs = travelled.outputs
    rows = []
    for key, (title, printed) in _ROWS.items():
        if f"global.{key}.{outputs[0]}" not in figures:
            continue
        published = dict(zip(outputs, paper.get(printed, ()), strict=False))
        cells = [title]
        for name in outputs:
            cells.append(f"{published[name]:.2f}" if name in published else MISSING)
            cells.append(significant(figures[f"global.{key}.{name}"], _DIGITS))
        rows.append(tuple(cells))
    heads = [head for name in outputs for head in (f"{name}, paper", "Ours")]
    lead = (
        f"{len(travelled.measured)} periods of a slide that travels while it is excited, compared at the excited lines"
        " once drift is removed. What repeats of an error is its systematic part, the rest its stochastic one."
    )
    figure = Beside(tuple(_spectrum(travelled, column) for column in range(len(outputs))), columns=2)
    return Section("While the slide travels", lead, (Table(("Figure", *heads), tuple(rows)), Notes(_NOTES), figure))


def _spectrum(travelled: Travelled, column: int) -> Figure:
    fitted, true = travelled.error(travelled.fitted), travelled.error(travelled.true)
    curves = tuple(
        Curve(name, _pooled(travelled.frequency_hz), tuple(2 * value for value in _pooled(amplitude[:, column])))
        for name, amplitude in (
            ("measured", split_errors(travelled.measured).total),
            ("error of the fitted model", fitted.total),
            ("error of the true drive", true.total),
            ("stochastic part", fitted.stochastic),
        )
    )
    name, unit = travelled.outputs[column], travelled.units[column]
    caption = f"Root mean square of {_POOLED} neighbouring lines."
    return Figure(f"Output {name}", "Frequency [Hz]", f"Amplitude [{unit}]", curves, caption=caption)


def _pooled(values: FloatArray) -> tuple[float, ...]:
    """Root mean squares of neighbouring lines, which calms what alternates from line to line."""
    groups = np.array_split(values, max(1, len(values) // _POOLED))
    return tuple(float(np.sqrt(np.mean(group**2))) for group in groups)
