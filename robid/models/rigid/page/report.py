"""What a rigid fit adds to page, terminal and summary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid.artifacts.results import grade_from_artifact
from robid.models.family import Shown
from robid.models.parameters import parameter_rows, parameter_summary
from robid.models.rigid.files import solution_from_artifact, validation_from_artifact
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.validating import RigidValidation
from robid.models.rigid.page.charts import correlations, course, histogram, torques, trials, weights
from robid.report.numbers import MISSING, percent, significant
from robid.report.page import FitReport, Headline, KeyNumber
from robid.report.parameter_section import parameter_numbers, parameter_section, parameter_table
from robid.report.parameters import Estimates
from robid.report.section import Beside, ColumnStyle, Folded, Notes, Part, Section, Table
from robid.results.grade import Grade

_TITLES = {
    "ordinary": "Least squares",
    "weighted": "Weighted per motor",
    "huber": "Huber",
    "instruments": "Instrumental variables",
}


def sections(
    solution: RigidSolution,
    estimates: Estimates,
    joints: Sequence[str],
    validation: RigidValidation | None,
    sensed: Sequence[str] = (),
    pushed: Sequence[str] = (),
) -> tuple[Section, ...]:
    """Lays out a rigid fit.

    Args:
        solution: What it found.
        estimates: Its parameters as rows.
        joints: Names of the joints.
        validation: Its validation, if any.
        sensed: Names of those that have no motor, whose torque is measured at the joint.
        pushed: Names of those among them that slide, whose force it is.
    """
    units = [estimates.torque_unit if name not in pushed else "N" for name in joints]
    found = [
        *_parameters(solution, estimates, sensed),
        _trust(solution, joints),
        _residuals(solution, joints, units),
    ]
    if validation is not None:
        found.append(_prediction(validation, joints, units))
    return tuple(found)


def _sides(sensed: Sequence[str]) -> str:
    """Says of which side the parameters are."""
    told = "Everything is on the motor side, but for what links and payload have"
    if not sensed:
        return f"{told}."
    return f"{told}, and what belongs to joints without a motor, whose torque is measured there: {', '.join(sensed)}."


def _parameters(solution: RigidSolution, estimates: Estimates, sensed: Sequence[str]) -> tuple[Section, ...]:
    (section,) = parameter_section(estimates, _sides(sensed))
    base = solution.base
    rows = tuple(
        (name, label) for name, label in zip(solution.estimate.names, base.labels, strict=True) if label != name
    )
    more: list[Part] = []
    if rows:
        title = f"What {len(rows)} of the {len(base.labels)} base parameters stand for"
        more.append(Folded(title, (Table(("Parameter", "Combination"), rows, styles=("name", "prose")),)))
    gap = "infinite" if not np.isfinite(base.gap) else f"{base.gap:.2g}"
    told = [
        f"Base parameters are told from the rest by a gap of {gap} in the singular values; the condition number of the"
        f" motion is {significant(base.condition, 4)} (columns of norm 1; {significant(base.unscaled_condition, 4)} as"
        " they are).",
        f"Without any effect on a torque: {', '.join(base.silent)}." if base.silent else "",
    ]
    parts = (*section.parts, *more, Notes(tuple(note for note in told if note)))
    return (Section(section.title, section.lead, parts, section.anchor), *_standard(solution))


def _standard(solution: RigidSolution) -> tuple[Section, ...]:
    found = solution.standard
    if found is None:
        return ()
    rows = tuple(
        (name, f"{nominal:.4g}", f"{value:.4g}", unit)
        for name, nominal, value, unit in zip(
            found.names, found.nominal.tolist(), found.value.tolist(), found.units, strict=True
        )
    )
    words = {
        "estimated": "They have exactly the estimated base parameters.",
        "moved": f"No real bodies have exactly the estimated ones: base parameters moved by up to"
        f" {significant(float(np.abs(found.moved).max(initial=0.0)), 2)} deviations.",
        "failed": "No real bodies were found; these are the robot file's.",
    }
    lead = (
        f"Torques do not determine these: they are the real bodies nearest to the robot file's. {words[found.status]}"
    )
    table = Table(
        ("Parameter", "Robot file", "Handed on", "Unit"), rows, styles=("name", "number", "strong", "text"), fit="tall"
    )
    return (Section("Standard parameters", lead, (Folded(f"{len(rows)} parameters", (table,)),), "standard"),)


def _trust(solution: RigidSolution, joints: Sequence[str]) -> Section:
    parts: list[Part] = [_estimator_table(solution), _test_table(solution, joints)]
    if solution.estimators.bends.size:
        parts.append(Folded("Other bends of Huber's estimator", (_bend_table(solution),)))
    return Section("Is least squares to be trusted?", solution.checks.sentence, tuple(parts), "verdict")


def _estimator_table(solution: RigidSolution) -> Table:
    found, checks, names = solution.estimators, solution.checks, solution.estimate.names
    values = [[f"{value:.4g} ± {std:.2g}" for value, std in zip(*pair, strict=True)] for pair in _pairs(solution)]
    against = checks.instrument_variation
    varied = [percent(value) for value in checks.huber_variation.tolist()]
    other = [MISSING] * len(names) if against is None else [percent(value) for value in against.tolist()]
    heads = ("Parameter", *(_TITLES[name] for name in found.names), "From Huber", "From instruments")
    rows = tuple(zip(names, *values, varied, other, strict=True))
    caption = (
        "± is one standard deviation by each estimator's own formula. The last columns are the relative differences of"
        " least squares from the others (eq. 22 of the paper, over at least three deviations, first moments over their"
        " vector's length)."
    )
    styles: tuple[ColumnStyle, ...] = ("name", *_numbers(len(heads) - 1))
    return Table(heads, rows, title="Estimators beside each other", caption=caption, styles=styles)


def _pairs(solution: RigidSolution) -> list[tuple[list[float], list[float]]]:
    found = solution.estimators
    return [(value.tolist(), std.tolist()) for value, std in zip(found.values, found.std, strict=True)]


def _test_table(solution: RigidSolution, joints: Sequence[str]) -> Table:
    checks, error = solution.checks, solution.residuals.relative_error
    rows = tuple(
        (
            name,
            percent(float(error[joint])),
            f"{checks.skewness[joint]:.2f}",
            f"{checks.excess_kurtosis[joint]:.2f}",
            percent(float(checks.outlier_share[joint])),
            f"{np.abs(checks.correlation[joint]).max():.2f}",
        )
        for joint, name in enumerate(joints)
    )
    heads = ("Motor", "Residual", "Skewness", "Excess kurtosis", "Beyond 3 deviations", "Correlation")
    caption = (
        "Residuals of weighted least squares over the torque's size. Of a Gaussian 0.27 % lie beyond 3 deviations."
    )
    return Table(heads, rows, title="Residuals", caption=caption, styles=("name", *_numbers(5)))


def _bend_table(solution: RigidSolution) -> Table:
    found = solution.estimators
    heads = ("Parameter", *(f"H = {bend:g}" for bend in found.bends.tolist()))
    columns = [[f"{value:.4g}" for value in row] for row in found.bent.tolist()]
    rows = tuple(zip(solution.estimate.names, *columns, strict=True))
    styles: tuple[ColumnStyle, ...] = ("name", *_numbers(len(columns)))
    return Table(heads, rows, styles=styles)


def _residuals(solution: RigidSolution, joints: Sequence[str], units: Sequence[str]) -> Section:
    found, every = solution.residuals, range(len(joints))
    parts: list[Part] = [
        Beside(tuple(histogram(found, joint, joints[joint], units[joint]) for joint in every)),
        Beside(tuple(weights(found, joint, joints[joint], units[joint]) for joint in every)),
        Beside(tuple(course(found, joint, joints[joint], units[joint]) for joint in every)),
        correlations(solution.checks, joints),
    ]
    filtered = solution.filtered
    if filtered.trial_hz.size:
        parts.append(trials(filtered))
    chosen = "chosen from the data" if filtered.trial_hz.size else "as stated"
    lead = (
        f"Positions are low-passed at {significant(filtered.cut_hz, 3)} Hz ({chosen}; the motion ends at"
        f" {significant(float(filtered.excited_hz.max()), 3)} Hz), and every {filtered.decimation}th row is kept. Each"
        " motor's residuals: against a Gaussian, with Huber's weights, and over time with three deviations."
    )
    return Section("Residuals", lead, tuple(parts), "residuals")


def _prediction(validation: RigidValidation, joints: Sequence[str], units: Sequence[str]) -> Section:
    forward = validation.forward_error
    simulated = [MISSING] * len(joints) if forward is None else [percent(each) for each in forward.tolist()]
    figures = validation.relative_error.tolist(), validation.error_ratio.tolist(), simulated
    rows = tuple(
        (name, percent(error), significant(ratio, 3), off)
        for name, error, ratio, off in zip(joints, *figures, strict=True)
    )
    heads = ("Motor", "Error over torque", "Error over the fit's own", "Simulated position off")
    caption = "Positions are simulated in the robot's loop under the recorded commands, where these are known."
    table = Table(heads, rows, caption=caption, styles=("name", *_numbers(3)))
    curves = tuple(torques(validation.prediction, joint, name, units[joint]) for joint, name in enumerate(joints))
    lead = f"The model {validation.outcome.verdict}."
    return Section("Predicted torques", lead, (table, *curves), "prediction")


def _numbers(count: int) -> tuple[ColumnStyle, ...]:
    number: ColumnStyle = "number"
    return (number,) * count


def report(shown: Shown) -> FitReport:
    """Lays out a rigid fit for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    grade = grade_from_artifact(shown.model) if validation is None else validation.outcome.grade
    estimates = _estimates(shown, solution)
    robot = shown.data.loaded.robot
    joints, sensed = tuple(joint.name for joint in robot.joints), robot.without_motor
    pushed = tuple(joint.name for joint in robot.joints if joint.slides and joint.name in sensed)
    return FitReport(
        headline=_headline(shown.data.name, solution, estimates, validation, grade),
        verdict=_verdict(solution, validation, grade, named=shown.data.settings.validate_on is not None),
        grade=grade.value,
        sections=sections(solution, estimates, joints, validation, sensed, pushed),
        parameters=estimates.rows,
        summary=_summary(solution, estimates, validation, grade),
        terminal=(parameter_table(_identified(estimates)),),
    )


def _estimates(shown: Shown, solution: RigidSolution) -> Estimates:
    estimate = solution.estimate
    assumed = shown.data.loaded.robot.to_robot(0.0).assumed
    return Estimates(
        rows=parameter_rows(estimate, shown.true, assumed, solution.torque_unit),
        level=estimate.confidence,
        torque_unit=solution.torque_unit,
        undetermined=estimate.undetermined,
        identifiable_relative_std=estimate.identifiable_relative_std,
        interval_rule=estimate.interval_rule,
    )


def _identified(estimates: Estimates) -> Estimates:
    """Those that a terminal shows: what is not identified is told in one sentence."""
    return replace(estimates, rows=tuple(row for row in estimates.rows if row.identified))


def _headline(
    name: str, solution: RigidSolution, estimates: Estimates, validation: RigidValidation | None, grade: Grade
) -> Headline:
    own = KeyNumber("Torques explained to", percent(solution.residuals.total_error), "of their size, own motion")
    new = () if validation is None else (
        KeyNumber("Torques predicted to", percent(validation.total_error), "of their size, another motion"),
    )  # fmt: skip
    condition = KeyNumber("Condition number", significant(solution.base.condition, 3), "of the scaled columns")
    return Headline(
        name=name,
        numbers=(*parameter_numbers(estimates, usable=grade.value > 0), own, *new, condition),
        doubts=tuple(doubt.sentence for doubt in grade.doubts),
        status=solution.estimate.status.replace("_", " "),
        advice=solution.estimate.advice,
    )


def _verdict(solution: RigidSolution, validation: RigidValidation | None, grade: Grade, *, named: bool) -> str:
    known = int(solution.estimate.identified.sum())
    found = [grade.sentence, f"{known} of {len(solution.estimate.names)} base parameters are identified."]
    if validation is None:
        found.append("Not validated: no campaign was named to hold it against." if not named else "Not validated.")
    elif validation.outcome.ok:
        found.append(f"The model {validation.outcome.verdict}.")
    return " ".join(found)


def _summary(
    solution: RigidSolution, estimates: Estimates, validation: RigidValidation | None, grade: Grade
) -> dict[str, float]:
    checks, estimate = solution.checks, solution.estimate
    found = {
        "grade": float(grade.value),
        "converged": float(estimate.status == "converged"),
        "trust": float(checks.trust),
        "condition": solution.base.condition,
        "unscaled_condition": solution.base.unscaled_condition,
        "relative_error": solution.residuals.total_error,
        "largest_variation_from_huber": float(checks.huber_variation.max()),
        "cut_hz": solution.filtered.cut_hz,
        "identifiable": float(estimate.identifiable.sum()),
        **parameter_summary(estimates.rows),
    }
    if checks.instrument_variation is not None:
        found["largest_variation_from_instruments"] = float(checks.instrument_variation.max())
    covered = [row.covered for row in estimates.rows if row.covered is not None]
    if covered:
        found["coverage"] = float(np.mean(covered))
    if validation is not None:
        found |= {
            "validation.ok": float(validation.outcome.ok),
            "validation.relative_error": validation.total_error,
            "validation.worst_error_ratio": float(validation.error_ratio.max()),
        }
    if validation is not None and validation.forward_error is not None:
        found["validation.worst_forward_error"] = float(validation.forward_error.max())
    return found
