"""Least squares beside other estimators: what their tests found, and what the grade makes of it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.plausible import estimator_findings
from robid.models.rigid.page.content import RigidContent
from robid.report.numbers import MISSING, percent, significant
from robid.report.section import Folded, Notes, Part, Section, Table
from robid.results.grade import DO_NOT_USE, PREDICTS, WORDS

_TITLES = {
    "ordinary": "Least squares",
    "weighted": "Weighted per motor",
    "huber": "Huber",
    "instruments": "Instrumental variables",
}
_NAMED = 4


def estimators_section(content: RigidContent) -> Section:
    """Lays out the tests of least squares: what they found, what the grade makes of it, and the numbers behind."""
    solution = content.solution
    parts: list[Part] = [Notes(tuple(_found(content)))]
    parts += [_estimator_table(solution), _test_table(solution, content.motors.names)]
    if solution.estimators.bends.size:
        heads = ("Parameter", *(f"H = {bend:g}" for bend in solution.estimators.bends.tolist()))
        columns = [[significant(value, 4) for value in row] for row in solution.estimators.bent.tolist()]
        bent = Table(heads, tuple(zip(solution.estimate.names, *columns, strict=True)))
        parts.append(Folded("Other bends of Huber's estimator", (bent,)))
    lead = f"{_lead(solution)} {grade_sentence(content)}".strip()
    return Section("Least squares against other estimators", lead, tuple(parts), "verdict")


def _lead(solution: RigidSolution) -> str:
    checks = solution.checks
    alarms = (
        (checks.instruments_differ, "instrumental variables give other values"),
        (checks.huber_differs, "Huber's estimator gives other values"),
        (checks.coloured, "the residuals are correlated in time"),
        (checks.odd, "the residuals are not Gaussian"),
        (checks.untested, "too few rows are left to test the residuals"),
    )
    found = [text for is_so, text in alarms if is_so]
    if not found:
        return "The tests of least squares found nothing."
    return f"The tests of least squares found: {'; '.join(found)}."


def grade_sentence(content: RigidContent) -> str:
    """Says what the grade makes of the tests; empty where the grade is unknown."""
    grade, checks = content.grade, content.solution.checks
    if grade is None:
        return ""
    own = {finding.message for finding in estimator_findings(content.solution, content.motors.names)}
    mine = [finding for finding in grade.findings if finding.message in own]
    words = f"The grade is “{WORDS[grade.value].partition(',')[0]}”"
    if grade.value == DO_NOT_USE:
        return f"{words}, for this reason." if any(each.decisive for each in mine) else f"{words}, for other reasons."
    if checks.trust:
        return f"{words}{', for other reasons' if grade.value == PREDICTS else ''}."
    if grade.value == PREDICTS:
        return (
            f"{words}: this does not forbid the torques that it predicts, whose errors stand above, but single"
            " parameters may be off by more than their intervals say."
        )
    return f"{words} all the same: a motion that the fit never saw was predicted."


def _found(content: RigidContent) -> Iterator[str]:
    """Says what each test found, with the parameters that differ."""
    checks, tests, names = content.solution.checks, content.tests, content.solution.estimate.names
    share = tests.level / (3 if checks.instrument_variation is None else 4)
    against = [("Huber's estimator", checks.huber_variation, checks.huber_p)]
    if checks.instrument_variation is not None and checks.instrument_p is not None:
        against.insert(0, ("instrumental variables", checks.instrument_variation, checks.instrument_p))
    for other, variation, chance in against:
        beyond = (variation > tests.variation) & (chance < share / len(names))
        yield f"Least squares against {other}: {_differing(names, variation, beyond, tests.variation)}."
    if checks.instrument_variation is None:
        yield "Instrumental variables were not computed: they need the robot's loop and a record of its commands."
    if checks.untested:
        yield "Residuals: too few rows are left to test all of them."
    motors = content.motors.names
    if checks.coloured:
        size = np.abs(checks.correlation).max(axis=1)
        worst = int(np.nanargmax(size))
        yield (
            f"Residuals: correlated in time beyond what the filter does, most those of {motors[worst]}"
            f" ({size[worst]:.2f}). The model lacks a torque, or its friction has another form."
        )
    if checks.odd:
        worst = int(np.nanargmax(checks.outlier_share))
        yield (
            f"Residuals: not Gaussian; of {motors[worst]} {percent(float(checks.outlier_share[worst]))} lie beyond 3"
            " deviations."
        )
    if not (checks.coloured or checks.odd or checks.untested):
        yield "Residuals: white beyond the filter, and Gaussian, as far as the rows show."


def _differing(names: Sequence[str], variation: FloatArray, beyond: BoolArray, limit: float) -> str:
    """Says which parameters differ by how much, the largest difference first."""
    order = [int(index) for index in np.argsort(-variation) if beyond[index]]
    if not order:
        return f"no parameter differs by more than {percent(limit)} and more than chance"
    listed = ", ".join(f"{names[index]} by {percent(float(variation[index]))}" for index in order[:_NAMED])
    more = f" and {len(order) - _NAMED} more" if len(order) > _NAMED else ""
    return f"{len(order)} of {len(names)} parameters differ by more than chance: {listed}{more}"


def _estimator_table(solution: RigidSolution) -> Table:
    found, checks, names = solution.estimators, solution.checks, solution.estimate.names
    pairs = zip(found.values.tolist(), found.std.tolist(), strict=True)
    values = [
        [f"{significant(value, 4)} ± {significant(std, 2)}" for value, std in zip(*pair, strict=True)] for pair in pairs
    ]
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
    leaves = ("From Huber", "From instruments", *heads[-3:1:-1])
    return Table(heads, rows, title="Estimators beside each other", caption=caption, leaves=leaves, fit="tall")


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
