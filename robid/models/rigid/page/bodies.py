"""Base parameters and the standard parameters of real bodies: all that a rigid fit estimates, friction among it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.judge.joint_side import is_at_joint
from robid.models.rigid.page.content import RigidContent
from robid.report.numbers import pretty_unit, significant
from robid.report.parameter_section import parameter_section
from robid.report.section import Folded, Notes, Part, Section, Table


def body_sections(content: RigidContent) -> tuple[Section, ...]:
    """Lays out all parameters, those that the data do not determine folded away, and the standard ones."""
    solution, estimates, sensed = content.solution, content.estimates, content.sensed
    told = ", and what belongs to joints without a motor, whose torque is measured there: " if sensed else ""
    sides = f"Everything is on the motor side, but for what links and payload have{told}{', '.join(sensed)}."
    if all(is_at_joint(joint) for joint in content.joints):
        sides = "Everything is at the joints."
    known = tuple(row for row in estimates.rows if row.identified)
    poor = tuple(row for row in estimates.rows if not row.identified)
    (section,) = parameter_section(replace(estimates, rows=known or poor), sides)
    more: list[Part] = []
    if known and poor:
        (rest,) = parameter_section(replace(estimates, rows=poor, undetermined=()), sides)
        title = f"{len(poor)} of {len(estimates.rows)} parameters that the data do not determine"
        more.append(Folded(title, tuple(part for part in rest.parts if isinstance(part, Table))))
    rows = tuple(
        (name, label)
        for name, label in zip(solution.estimate.names, solution.base.labels, strict=True)
        if label != name
    )
    if rows:
        title = f"What {len(rows)} of the {len(solution.base.labels)} base parameters stand for"
        more.append(Folded(title, (Table(("Parameter", "Combination"), rows, styles=("name", "prose")),)))
    parts = (*section.parts, *more, Notes(_notes(solution)))
    return (Section(section.title, section.lead, parts, section.anchor), *_standard(solution))


def _notes(solution: RigidSolution) -> tuple[str, ...]:
    base = solution.base
    gap = "infinite" if not np.isfinite(base.gap) else f"{base.gap:.2g}"
    return (
        f"A gap of {gap} in the singular values separates base parameters from the rest; the condition number of the"
        f" motion is {significant(base.condition, 4)} (columns of norm 1; {significant(base.unscaled_condition, 4)} as"
        " they are).",
        *([f"Without any effect on a torque: {', '.join(base.silent)}."] if base.silent else []),
    )


def _standard(solution: RigidSolution) -> tuple[Section, ...]:
    found = solution.standard
    if found is None:
        return ()
    units = map(pretty_unit, found.units)
    pairs = zip(found.names, found.nominal.tolist(), found.value.tolist(), units, strict=True)
    rows = tuple((name, significant(nominal, 4), significant(value, 4), unit) for name, nominal, value, unit in pairs)
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
