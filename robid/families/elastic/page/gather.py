"""The rows of an elastic fit, from its artifacts."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.model import grade_from_artifact, model_from_artifact, resonances_from_artifact
from robid.artifacts.validation import validation_from_artifact
from robid.families.elastic.page.content import ElementErrors, FitContent, GradeRow, ResonanceRow
from robid.families.elastic.settings import elastic_fit
from robid.families.family import Shown
from robid.families.units import with_torque_unit
from robid.fit.model_error import ModelError
from robid.fit.solution import Solution
from robid.report.costs import CostRow, StartRow
from robid.report.parameters import Estimates, ParameterRow
from robid.robot.parameters import PARAMETER_KINDS, owner_of
from robid.validation.resonances import ResonanceTable


def fit_content(shown: Shown) -> FitContent:
    """Turns a fit, its data and its validation into rows."""
    loaded, frf = shown.data.loaded, shown.data.response
    settings = elastic_fit(loaded.experiment, shown.data.name)
    robot = loaded.robot.to_robot(loaded.experiment.campaigns[settings.campaign].payload_kg)
    solution, resonances = model_from_artifact(shown.model), resonances_from_artifact(shown.model)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    grade = grade_from_artifact(shown.model) if validation is None else validation.grade
    costs = solution.configuration_cost, solution.expected_cost
    content = FitContent(
        name=shown.data.name,
        campaign=" + ".join(settings.campaigns),
        frf=replace(frf, response=solution.measured),
        model_response=solution.modelled,
        estimates=Estimates(
            rows=_parameters(solution, frf.input_unit, shown.true, robot.assumed),
            level=solution.confidence,
            torque_unit=frf.input_unit,
            misfit=solution.misfit,
            undetermined=solution.undetermined,
            identifiable_relative_std=settings.identifiable_relative_std,
            interval_rule=solution.interval_rule,
        ),
        resonances=None if resonances is None else _resonances(resonances),
        estimation_costs=_costs(" + ".join(settings.campaigns), shown.data.configurations, *costs),
        starts=_starts(solution),
        status=solution.status.replace("_", " "),
        advice=solution.advice,
        element_errors=None if solution.model_error is None else _element_errors(solution.model_error),
        grade=None if grade is None else GradeRow(grade.value, grade.sentence, tuple(d.sentence for d in grade.doubts)),
    )
    if validation is None or settings.validate_on is None or shown.new is None:
        return content
    every = range(len(validation.cost))
    return replace(
        content,
        validation_costs=_costs(settings.validate_on, every, validation.cost, validation.expected_cost),
        validation_campaign=settings.validate_on,
        validation_frf=replace(shown.new.response, response=validation.measured),
        validation_model=validation.modelled,
    )


def _element_errors(error: ModelError) -> ElementErrors:
    above = error.level[error.level > 0]
    level = float(np.median(above)) if above.size else 0.0
    return ElementErrors(error.share_above, error.share_correlated, level)


def _resonances(table: ResonanceTable) -> tuple[ResonanceRow, ...]:
    return tuple(
        ResonanceRow(
            configuration=int(table.configuration[row]),
            channel=channel,
            kind="resonance" if table.kind[row] == "resonance" else "antiresonance",
            measured_hz=float(table.measured_hz[row]),
            model_hz=_finite(table.model_hz[row]),
            interval_hz=_interval(table.lower_hz[row], table.upper_hz[row]),
            mode_hz=_finite(table.mode_hz[row]),
            mode_interval_hz=_interval(table.mode_lower_hz[row], table.mode_upper_hz[row]),
            damping=_finite(table.damping[row]),
        )
        for row, channel in enumerate(table.channel)
    )


def _starts(solution: Solution) -> tuple[StartRow, ...]:
    counted = solution.start_evaluations.tolist() or [None] * len(solution.start_cost)
    ends = zip(
        solution.start_cost.tolist(),
        solution.start_iterations.tolist(),
        solution.start_status,
        solution.start_minimum.tolist(),
        counted,
        strict=True,
    )
    return tuple(StartRow(index, *end) for index, end in enumerate(ends))


def _parameters(
    solution: Solution, torque_unit: str, truth: Mapping[str, float], assumed: tuple[str, ...]
) -> tuple[ParameterRow, ...]:
    rows = []
    for index, name in enumerate(solution.names):
        kind = solution.kinds[index]
        owner = owner_of(name, kind)
        true, lower, upper = truth.get(name), float(solution.lower[index]), float(solution.upper[index])
        shared = [tied for tied, leader in zip(solution.tied_names, solution.tied_to, strict=True) if leader == name]
        rows.append(
            ParameterRow(
                name=owner,
                kind=kind,
                unit=_unit(solution.units[index], torque_unit),
                nominal=float(solution.nominal[index]),
                estimate=float(solution.estimate[index]),
                lower=lower,
                upper=upper,
                relative_std=float(solution.relative_std[index]),
                truth=true,
                identifiable=bool(solution.identifiable[index]),
                identified=bool(solution.identified[index]),
                predicted_relative_std=float(solution.predicted_relative_std[index]),
                known_relative_std=_known(solution.prior_relative_std, index),
                covered=None if true is None else lower <= true <= upper,
                bootstrap=_pair(solution.bootstrap_lower, solution.bootstrap_upper, index),
                realization_relative_std=_at(solution.realization_relative_std, index),
                assumed=any(f"{owner}.{field}" in assumed for field in PARAMETER_KINDS[kind].fields),
                note=f"shared by {', '.join(owner_of(tied, kind) for tied in shared)}" if shared else "",
            )
        )
    return tuple(rows)


def _known(values: FloatArray, index: int) -> float | None:
    return float(values[index]) if values.size and np.isfinite(values[index]) else None


def _at(values: FloatArray | None, index: int) -> float | None:
    return None if values is None else float(values[index])


def _pair(lower: FloatArray | None, upper: FloatArray | None, index: int) -> tuple[float, float] | None:
    return None if lower is None or upper is None else (float(lower[index]), float(upper[index]))


def _unit(unit: str, torque_unit: str) -> str:
    """Writes a unit for the page, none as such."""
    return "" if unit == "1" else with_torque_unit(unit, torque_unit)


def _costs(campaign: str, indices: Sequence[int], cost: FloatArray, expected: FloatArray) -> tuple[CostRow, ...]:
    return tuple(
        CostRow(campaign, index, value, wanted if wanted > 0 else None, value - wanted if wanted > 0 else None)
        for index, value, wanted in zip(indices, cost.tolist(), expected.tolist(), strict=True)
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _interval(lower: float, upper: float) -> tuple[float, float] | None:
    return (float(lower), float(upper)) if np.isfinite([lower, upper]).all() else None
