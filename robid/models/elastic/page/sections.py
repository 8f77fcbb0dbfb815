"""What of an elastic fit stands on the page and at the end of a run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from rich.console import Group

from robid.models.elastic.page.content import DoubtRow, FitContent
from robid.models.elastic.page.resonances import resonance_number, resonance_section, resonance_table
from robid.report.charts import BodeMatrix, BodeResponse, Mark
from robid.report.costs import campaign_title, cost_number, cost_section, start_number, start_section
from robid.report.numbers import MINUS, MISSING, percent
from robid.report.page import Headline
from robid.report.parameter_section import parameter_numbers, parameter_section, parameter_table
from robid.report.section import Folded, Notes, Part, Section, Table

_FEW_MOTORS = 2
_CONVENTIONS = "Stiffness and damping are arm side."
_OF_LOADS = "Dampers of gears with `load_damping` are those without load."
_OF_BRISTLES = (
    "`hysteresis` is the torque at which bristles beside a gear slip, a tenth as stiff as it: as this campaign swings"
    " the gear. It holds for this amplitude; what sticks there is part of the spring. Dampers of these gears come out"
    " low, and their intervals hold less than they say."
)


def headline(fit: FitContent) -> Headline:
    """Picks what decides whether a fit can be used."""
    return Headline(
        name=fit.name,
        numbers=(
            *parameter_numbers(fit.estimates, usable=fit.usable),
            *resonance_number(fit.resonances),
            *cost_number(fit.estimation_costs, fit.validation_costs),
            *start_number(fit.starts),
        ),
        doubts=() if fit.grade is None else fit.grade.doubts,
        status=fit.status,
        advice=fit.advice,
    )


def sections(fit: FitContent, told: tuple[str, ...] = ()) -> tuple[Section, ...]:
    """Lays out a fit: its responses, parameters, doubts, resonances, costs and starts.

    Args:
        fit: The fit.
        told: What the page warns of anyway.
    """
    return (
        _response(fit, told),
        *parameter_section(fit.estimates, _conventions(fit)),
        *doubt_section(fit.file_doubts, fit.estimates.level),
        *resonance_section(fit.resonances, fit.frf, fit.estimates.level),
        *cost_section(fit.estimation_costs, fit.validation_costs, element_sentence(fit)),
        *start_section(fit.starts),
    )


def _conventions(fit: FitContent) -> str:
    """What values are to be understood as."""
    kinds = {row.name.rpartition(".")[2] for row in fit.estimates.rows if row.kind == "doubt"}
    more = [text for kind, text in (("load_damping", _OF_LOADS), ("hysteresis", _OF_BRISTLES)) if kind in kinds]
    return " ".join((_CONVENTIONS, *more))


def doubt_section(rows: tuple[DoubtRow, ...], level: float) -> tuple[Section, ...]:
    """Lays out what the data say of the robot file; nothing without doubts."""
    if not rows:
        return ()
    off = [row for row in rows if row.is_off]
    lead = (
        f"Estimated with the parameters, from how far the robot file says that it may be off. {percent(level)} "
        f"intervals exclude that it is right in {len(off)} of {len(rows)} doubts."
    )
    parts: list[Part] = [_doubt_table(off)] if off else []
    parts.append(Folded(f"All doubts, {len(rows)}", (_doubt_table(rows),)))
    return (Section("What the robot file may have wrong", lead, tuple(parts), "file-doubts"),)


def _doubt_table(rows: Sequence[DoubtRow]) -> Table:
    return Table(
        ("Doubt", "Off by", "±", "Known beforehand ±", "Unit"),
        tuple((row.name, *map(_written, (row.amount, row.half_width, row.known)), row.unit) for row in rows),
        caption="Off by: what is true less what the file says, to first order where no robot could be moved along.",
        styles=("name", "strong", "number", "number", "text"),
    )


def _written(value: float) -> str:
    return f"{value:.3g}".replace("-", MINUS) if math.isfinite(value) else MISSING


def fit_tables(fit: FitContent) -> Iterator[Group]:
    """Yields what the end of a run shows of a fit: its parameters and, of a small drive, its resonances."""
    yield parameter_table(fit.estimates)
    if fit.resonances and len(fit.frf.input_names) <= _FEW_MOTORS:
        yield resonance_table(fit)


def element_sentence(fit: FitContent) -> str:
    """Says what the residuals hold beyond their covariance; empty where that is unknown."""
    errors = fit.element_errors
    if errors is None:
        return ""
    level = f", where the model is off by {percent(errors.median_level)} (median)" if errors.median_level > 0 else ""
    return (
        f"Beyond their covariance are {percent(errors.share_above)} of the elements{level}; the residuals of "
        f"{percent(errors.share_correlated)} are correlated over frequency. Of an exact model 5 % would be either."
    )


def _response(fit: FitContent, told: tuple[str, ...]) -> Section:
    marks = tuple(Mark(row.configuration, row.channel, row.measured_hz) for row in fit.resonances if row.measured_hz)
    title = "measured resonances and antiresonances of this channel"
    label = campaign_title("Estimation", fit.campaign)
    responses = [BodeResponse(label, fit.frf, (("model", fit.model_response),), marks, title)]
    if fit.validation_frf is not None and fit.validation_model is not None:
        label = campaign_title("Validation", fit.validation_campaign)
        responses.append(BodeResponse(label, fit.validation_frf, (("model", fit.validation_model),)))
    notes = [note for note in fit.frf.notes if note not in told]
    parts: list[Part] = [BodeMatrix("", tuple(responses), fit.estimates.level)]
    parts += [Notes(tuple(notes))] if notes else []
    lead = (
        "Torque to acceleration, both motor side, measured against model. Every column is one input, every row one"
        " output; select an element to enlarge it."
    )
    return Section("Frequency response", lead, tuple(parts), "response")
