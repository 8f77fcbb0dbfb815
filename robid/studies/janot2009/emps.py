"""A real axis on a ball screw against the published values of the EMPS benchmark."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from robid.artifacts.artifact import Artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.models.rigid.files import solution_from_artifact
from robid.models.rigid.fit.solution import RigidSolution
from robid.pipeline import Run
from robid.report.numbers import significant
from robid.report.section import Section, Table
from robid.settings.yaml import load_yaml
from robid.studies.elsewhere import missing_log, run_of
from robid.studies.janot2009.section import study_of
from robid.studies.part import Asked, PartFound

_FITS = ("axis", "asymmetric")
_KINDS = {"inertia": "M", "mass": "M", "viscous": "Fv", "coulomb": "Fc", "torque_offset": "offset"}
_DIGITS = 6  # as they are published
_NEAR, _NEAR_OFFSET, _NEAR_ERROR = 0.01, 0.02, 0.1


def further_emps(run: Run) -> tuple[tuple[Run, tuple[str, ...]], ...]:
    """Returns the axis' experiment with its fits, where its log is there."""
    own = _run_of(run)
    return () if own is None or missing_log(own) else ((own, tuple(f"fits/{name}/model.h5" for name in _FITS)),)


def conclude_emps(run: Run, _results: Sequence[Artifact]) -> PartFound | None:
    """Turns the axis' fits into figures and what is asked of them."""
    case, own = study_of(run.loaded).emps, _run_of(run)
    if case is None or own is None:
        return None
    lacking = missing_log(own)
    if lacking:
        return PartFound({}, warnings=(f"The EMPS axis is left out: there is no {lacking}; set ROBID_DATA.",))
    published = load_yaml(run.loaded.path.parent / case.published).data
    plain, asymmetric = (
        solution_from_artifact(read_artifact(own.path(f"fits/{name}/model.h5"), MODEL)) for name in _FITS
    )
    figures = _figures(plain, asymmetric)
    return PartFound(figures, asked_of(published), (_section(figures, published, plain),))


def _run_of(run: Run) -> Run | None:
    case = study_of(run.loaded).emps
    return None if case is None else run_of(run, case.experiment, "emps")


def _figures(plain: RigidSolution, asymmetric: RigidSolution) -> dict[str, float]:
    estimate = plain.estimate
    named = {
        _KINDS[kind]: value
        for kind, value in zip(estimate.kinds, estimate.value.tolist(), strict=True)
        if kind in _KINDS
    }
    return {
        **{f"emps.{name}": value for name, value in named.items()},
        "emps.condition": plain.base.unscaled_condition,
        "emps.relative_error_percent": 100 * plain.residuals.total_error,
        "emps.asymmetric_relative_error_percent": 100 * asymmetric.residuals.total_error,
    }


def _published(values: Mapping[str, Any]) -> dict[str, float]:
    keys = ("condition", "relative_error_percent", "asymmetric_relative_error_percent")
    return {**values["ordinary"], **{key: values[key] for key in keys}}


def asked_of(values: Mapping[str, Any]) -> dict[str, Asked]:
    """Returns how near to the published values the figures must lie."""
    asked = {}
    for name, value in _published(values).items():
        reach = _NEAR_ERROR if name.endswith("percent") else abs(value) * (_NEAR_OFFSET if name == "offset" else _NEAR)
        asked[f"emps.{name}"] = Asked(value - reach, value + reach)
    return asked


def _section(figures: Mapping[str, float], values: Mapping[str, Any], plain: RigidSolution) -> Section:
    rows = tuple(
        (name, significant(value, _DIGITS), significant(figures[f"emps.{name}"], _DIGITS))
        for name, value in _published(values).items()
        if f"emps.{name}" in figures
    )
    caption = (
        "M [kg], Fv [N s/m], Fc and offset [N]; condition number of the unscaled decimated rows; norm of the residual"
        " over that of the force. Nothing is dropped near zero speed."
    )
    table = Table(("Figure", "Published", "Ours"), rows, caption=caption, fit="compact")
    lead = f"A carriage on a ball screw, measured: ordinary least squares. {plain.checks.sentence}"
    return Section("Real data: the EMPS axis", lead, (table,))
