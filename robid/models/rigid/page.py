"""What a rigid fit adds to page, terminal and summary; figures after Figs 2 to 5 of Janot et al. (2009)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robid.models.family import Shown
from robid.models.parameters import curve, estimates_of, fit_report
from robid.models.rigid.courses import course, motors_section, new_joins, own_joins, thinned_rows, torques
from robid.models.rigid.files import solution_from_artifact, validation_from_artifact
from robid.models.rigid.fit.gains import describe_gains
from robid.models.rigid.fit.solution import Checks, Filtered, RigidSolution, RowResiduals
from robid.models.rigid.judge.motors import MOTOR_ERROR_LIMIT, Motors, motors_of
from robid.models.rigid.judge.validating import RigidValidation
from robid.models.rigid.settings import rigid_fit
from robid.report.correlation import correlation_section
from robid.report.numbers import MISSING, percent, significant
from robid.report.page import FitReport, KeyNumber
from robid.report.parameter_section import parameter_section
from robid.report.parameters import Estimates
from robid.report.section import Beside, Curve, Figure, Folded, Line, Notes, Part, Section, Table
from robid.signals.record import Record

_BINS = 40


def histogram(found: RowResiduals, joint: int, name: str, unit: str) -> Figure:
    """The distribution of one motor's residuals against the Gaussian of the same deviation."""
    residual = found.residual[:, joint]
    residual = residual[np.isfinite(residual)]
    deviation = float(residual.std())
    edges = np.linspace(-4 * deviation, 4 * deviation, _BINS + 1)
    density, _ = np.histogram(np.clip(residual, edges[0], edges[-1]), edges, density=True)
    middle = 0.5 * (edges[1:] + edges[:-1])
    gaussian = np.exp(-0.5 * (middle / deviation) ** 2) / (np.sqrt(2 * np.pi) * deviation)
    curves = (curve("residual", middle, density), curve("Gaussian", middle, gaussian))
    return Figure(name, f"Residual [{unit}]", "Density", curves, log_x=False, log_y=False, height=260)


def weights(found: RowResiduals, joint: int, name: str, unit: str) -> Figure:
    """Huber's weight of each row over its residual."""
    residual, weight = thinned_rows(found.residual[:, joint], found.weight[:, joint])
    order = np.argsort(residual)
    shown = Curve("weight", tuple(residual[order].tolist()), tuple(weight[order].tolist()), points=True)
    return Figure(
        name, f"Residual [{unit}]", "Weight", (shown,), log_x=False, log_y=False, y_range=(0.0, 1.05), height=260
    )


def correlations(checks: Checks, names: Sequence[str]) -> Figure:
    """Autocorrelation of the residuals, less what the filter gives white noise."""
    lags = np.arange(1, checks.correlation.shape[1] + 1, dtype=float)
    curves = tuple(curve(name, lags, row) for name, row in zip(names, checks.correlation, strict=True))
    return Figure(
        "Correlation in time", "Lag [rows]", "Autocorrelation beyond the filter's", curves, log_x=False, log_y=False
    )


def trials(filtered: Filtered) -> Figure:
    """Error on left-out pieces of the log by each cut-off that was tried, and the smallest with its standard error."""
    best = int(np.argmin(filtered.trial_error))
    beyond = np.sqrt(filtered.trial_error[best] ** 2 + filtered.trial_deviation)
    curves = (
        curve("error on left-out pieces", filtered.trial_hz, filtered.trial_error),
        curve("smallest and one standard error", filtered.trial_hz, beyond),
    )
    label = f"Error over torque, below {significant(filtered.band_hz, 2)} Hz"
    return Figure("Choice of the cut-off", "Cut-off [Hz]", label, curves)


_TITLES = {
    "ordinary": "Least squares",
    "weighted": "Weighted per motor",
    "huber": "Huber",
    "instruments": "Instrumental variables",
}


def sections(
    solution: RigidSolution,
    estimates: Estimates,
    motors: Motors,
    validation: RigidValidation | None,
    sensed: Sequence[str] = (),
    pushed: Sequence[str] = (),
    new: Sequence[Record] = (),
) -> tuple[Section, ...]:
    """Lays out a rigid fit, with the records of its validation.

    What is pushed, of the joints without a motor, slides, and its torque is a force.
    """
    joints = motors.names
    units = [estimates.torque_unit if name not in pushed else "N" for name in joints]
    trust: list[Part] = [_estimator_table(solution), _test_table(solution, joints)]
    if solution.estimators.bends.size:
        heads = ("Parameter", *(f"H = {bend:g}" for bend in solution.estimators.bends.tolist()))
        columns = [[f"{value:.4g}" for value in row] for row in solution.estimators.bent.tolist()]
        bent = Table(heads, tuple(zip(solution.estimate.names, *columns, strict=True)))
        trust.append(Folded("Other bends of Huber's estimator", (bent,)))
    found = [
        motors_section(solution, motors, units, validation),
        *_parameters(solution, estimates, sensed),
        *correlation_section(estimates),
        Section("Is least squares to be trusted?", solution.checks.sentence, tuple(trust), "verdict"),
        _residuals(solution, joints, units),
    ]
    if validation is not None:
        found.append(_prediction(validation, joints, units, new_joins(validation.prediction, new)))
    return tuple(found)


def _parameters(solution: RigidSolution, estimates: Estimates, sensed: Sequence[str]) -> tuple[Section, ...]:
    told = ", and what belongs to joints without a motor, whose torque is measured there: " if sensed else ""
    sides = f"Everything is on the motor side, but for what links and payload have{told}{', '.join(sensed)}."
    (section,) = parameter_section(estimates, sides)
    base = solution.base
    rows = tuple(
        (name, label) for name, label in zip(solution.estimate.names, base.labels, strict=True) if label != name
    )
    more: list[Part] = []
    if rows:
        title = f"What {len(rows)} of the {len(base.labels)} base parameters stand for"
        more.append(Folded(title, (Table(("Parameter", "Combination"), rows, styles=("name", "prose")),)))
    gap = "infinite" if not np.isfinite(base.gap) else f"{base.gap:.2g}"
    notes = [
        f"Base parameters are told from the rest by a gap of {gap} in the singular values; the condition number of the"
        f" motion is {significant(base.condition, 4)} (columns of norm 1; {significant(base.unscaled_condition, 4)} as"
        " they are).",
        *([f"Without any effect on a torque: {', '.join(base.silent)}."] if base.silent else []),
    ]
    parts = (*section.parts, *more, Notes(tuple(notes)))
    return (Section(section.title, section.lead, parts, section.anchor), *_standard(solution))


def _standard(solution: RigidSolution) -> tuple[Section, ...]:
    found = solution.standard
    if found is None:
        return ()
    pairs = zip(found.names, found.nominal.tolist(), found.value.tolist(), found.units, strict=True)
    rows = tuple((name, f"{nominal:.4g}", f"{value:.4g}", unit) for name, nominal, value, unit in pairs)
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


def _estimator_table(solution: RigidSolution) -> Table:
    found, checks, names = solution.estimators, solution.checks, solution.estimate.names
    pairs = zip(found.values.tolist(), found.std.tolist(), strict=True)
    values = [[f"{value:.4g} ± {std:.2g}" for value, std in zip(*pair, strict=True)] for pair in pairs]
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
    return Table(heads, rows, title="Estimators beside each other", caption=caption)


def _test_table(solution: RigidSolution, joints: Sequence[str]) -> Table:
    checks = solution.checks
    largest, odd = (
        np.abs(checks.correlation).max(axis=1),
        (checks.skewness, checks.excess_kurtosis, checks.outlier_share),
    )
    columns = (each.tolist() for each in (*odd, largest))
    rows = tuple(
        (name, f"{skewness:.2f}", f"{kurtosis:.2f}", percent(outliers), f"{correlation:.2f}")
        for name, skewness, kurtosis, outliers, correlation in zip(joints, *columns, strict=True)
    )
    heads = ("Motor", "Skewness", "Excess kurtosis", "Beyond 3 deviations", "Correlation")
    caption = "Residuals of weighted least squares. Of a Gaussian 0.27 % lie beyond 3 deviations."
    return Table(heads, rows, title="Residuals", caption=caption)


def _residuals(solution: RigidSolution, joints: Sequence[str], units: Sequence[str]) -> Section:
    found, every, joins = solution.residuals, range(len(joints)), own_joins(solution)
    parts: list[Part] = [
        Beside(tuple(histogram(found, joint, joints[joint], units[joint]) for joint in every)),
        Beside(tuple(weights(found, joint, joints[joint], units[joint]) for joint in every)),
        Beside(tuple(course(found, joint, joints[joint], units[joint], joins) for joint in every)),
        correlations(solution.checks, joints),
    ]
    filtered = solution.filtered
    if filtered.trial_hz.size > 1:
        parts.append(trials(filtered))
    chosen = "chosen by left-out pieces of the log" if filtered.trial_hz.size > 1 else "as stated"
    lead = (
        f"Positions are low-passed at {significant(filtered.cut_hz, 3)} Hz ({chosen}; 99 % of the speed lies"
        f" below {significant(float(filtered.motion_hz.max()), 3)} Hz), and every {filtered.decimation}th row is kept."
        " Each motor's residuals: against a Gaussian, with Huber's weights, and over time with three deviations."
    )
    return Section("Residuals", lead, tuple(parts), "residuals")


def _prediction(
    validation: RigidValidation, joints: Sequence[str], units: Sequence[str], joins: tuple[Line, ...]
) -> Section:
    forward = validation.forward_error
    simulated = [MISSING] * len(joints) if forward is None else [percent(each) for each in forward.tolist()]
    figures = validation.error_ratio.tolist(), simulated
    rows = tuple((name, significant(ratio, 3), off) for name, ratio, off in zip(joints, *figures, strict=True))
    heads = ("Motor", "Error over the fit's own", "Simulated position off")
    caption = "Positions are simulated in the robot's loop under the recorded commands, where these are known."
    table = Table(heads, rows, caption=caption)
    curves = tuple(
        torques(validation.prediction, joint, name, units[joint], joins) for joint, name in enumerate(joints)
    )
    lead = f"The model {validation.outcome.verdict}."
    return Section("Predicted torques", lead, (table, *curves), "prediction")


def report(shown: Shown) -> FitReport:
    """Lays out a rigid fit for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    estimate, robot = solution.estimate, shown.data.loaded.robot
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    estimates = estimates_of(shown, estimate, robot.to_robot(0.0).assumed, solution.torque_unit)
    joints, sensed = tuple(joint.name for joint in robot.joints), robot.without_motor
    pushed = tuple(joint.name for joint in robot.joints if joint.slides and joint.name in sensed)
    new = () if shown.new is None else shown.new.records
    motors = motors_of(solution, joints, rigid_fit(shown.data.loaded.experiment, shown.data.name).judge)
    return fit_report(
        shown,
        estimate,
        estimates,
        None if validation is None else validation.outcome,
        found="",
        numbers=_key_numbers(solution, validation),
        sections=sections(solution, estimates, motors, validation, sensed, pushed, new),
        summary=_summary(solution, joints, estimates, validation),
        unknown=_gains(solution, joints),
        worst=("", "") if validation is None else _worst_error(validation, motors),
        # What is not identified is told in one sentence.
        terminal=replace(estimates, rows=tuple(row for row in estimates.rows if row.identified)),
    )


def _worst_error(validation: RigidValidation, motors: Motors) -> tuple[str, str]:
    """Writes the error of the worst motor's torque over its size, and its limit."""
    name, _, worst = motors.worst(validation.relative_error)
    return f"{percent(worst)} of the torque of {name}", percent(MOTOR_ERROR_LIMIT)


def _gains(solution: RigidSolution, joints: Sequence[str]) -> str:
    """Says by what the torques were multiplied; nothing where they are as recorded."""
    if solution.gains is None:
        return ""
    told = describe_gains(solution.gains, joints, solution.estimate.confidence)
    return f"{told[0].upper()}{told[1:]}."


def _key_numbers(solution: RigidSolution, validation: RigidValidation | None) -> Iterator[KeyNumber]:
    yield KeyNumber("Torque residual", percent(solution.residuals.total_error), "of the torques' size, own motion")
    if validation is not None:
        yield KeyNumber("Torque error", percent(validation.total_error), "of the torques' size, another motion")
    yield KeyNumber("Condition number", significant(solution.base.condition, 3), "of the scaled columns")


def _summary(
    solution: RigidSolution, joints: Sequence[str], estimates: Estimates, validation: RigidValidation | None
) -> dict[str, float]:
    checks = solution.checks
    found = {
        "trust": float(checks.trust),
        "condition": solution.base.condition,
        "unscaled_condition": solution.base.unscaled_condition,
        "relative_error": solution.residuals.total_error,
        "largest_variation_from_huber": float(checks.huber_variation.max()),
        "cut_hz": solution.filtered.cut_hz,
    }
    if checks.instrument_variation is not None:
        found["largest_variation_from_instruments"] = float(checks.instrument_variation.max())
    if solution.gains is not None:
        found |= {f"gain.{name}": gain for name, gain in zip(joints, solution.gains.gain.tolist(), strict=True)}
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
