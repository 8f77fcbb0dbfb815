"""Gears on the page of a fit and in the terminal: with what lies in line with them, and what they alone may be."""

from __future__ import annotations

from dataclasses import dataclass

from robid.models.elastic.fit.gears_alone import WITH_CHAIN, most_share
from robid.models.elastic.fit.solution import ElasticSolution
from robid.models.parameters import with_torque_unit
from robid.report.numbers import Scale, percent, scale_for
from robid.report.section import Section, Table

_IN_LINE = "links, shafts, hinges"


@dataclass(frozen=True)
class GearRow:
    """A gear by itself, in SI units."""

    name: str  # Name of the transmission
    unit: str  # Unit of its stiffness
    chain: tuple[float, float]  # Physical interval of the gear with what lies in line with it
    value: float  # The gear alone
    alone: tuple[float, float]  # Its interval
    share: float  # Share of the compliance that is not the gear's, at most

    @property
    def scale(self) -> Scale:
        """How its numbers are written."""
        return scale_for(self.value, self.unit, (self.alone[1] - self.alone[0]) / 2)


def gear_rows(solution: ElasticSolution, torque_unit: str) -> tuple[GearRow, ...]:
    """Turns what a fit says of gears alone into rows."""
    gears, estimate = solution.gears, solution.estimate
    if gears is None:
        return ()
    rows = [estimate.names.index(name) for name in gears.names]
    return tuple(
        GearRow(
            name=name.rpartition(".")[0],
            unit=with_torque_unit(estimate.units[row], torque_unit),
            chain=(float(estimate.lower[row]), float(estimate.upper[row])),
            value=float(gears.value[index]),
            alone=(float(gears.lower[index]), float(gears.upper[index])),
            share=most_share(float(gears.share_std[index]), estimate.confidence),
        )
        for index, (name, row) in enumerate(zip(gears.names, rows, strict=True))
    )


def gear_sentence(rows: tuple[GearRow, ...]) -> str:
    """Says below a table what the stiffness of gears is, and what they alone may be; empty without any."""
    if not rows:
        return ""
    named = ", ".join(row.name for row in rows)
    told = f"Stiffness of {named}: {WITH_CHAIN} ({_IN_LINE}), which no response distinguishes."
    uncertain = [row for row in rows if row.share > 0]
    if not uncertain:
        return told
    alone = ", ".join(f"{row.name} {_interval(row.scale, row.alone)} {row.scale.unit}" for row in uncertain)
    return f"{told} The gear alone, by the share of the compliance that may not be its own: {alone}."


def gear_section(rows: tuple[GearRow, ...], level: float) -> tuple[Section, ...]:
    """Lays out what gears alone may be, beside what was fitted; nothing without any."""
    if not rows:
        return ()
    lead = (
        f"The stiffness of a transmission is that of the {WITH_CHAIN} ({_IN_LINE}): compliances in line add up, and no"
        f" response tells them apart. What the gear alone may be, {percent(level)} intervals, rests on"
        " `chain_compliance`, what the robot file says of the share that is not the gear's."
    )
    table = Table(
        ("Transmission", "With what lies in line", "Gear alone", "Its interval", "Unit", "Not the gear's, at most"),
        tuple(
            (
                row.name,
                _interval(row.scale, row.chain),
                row.scale.text(row.value),
                _interval(row.scale, row.alone),
                row.scale.unit,
                percent(row.share),
            )
            for row in rows
        ),
        styles=("name", "number", "strong", "number", "text", "number"),
    )
    return (Section("Gears alone", lead, (table,), "gears-alone"),)


def _interval(scale: Scale, ends: tuple[float, float]) -> str:
    return f"{scale.text(ends[0])} … {scale.text(ends[1])}"
