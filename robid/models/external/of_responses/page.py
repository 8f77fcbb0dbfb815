"""What an external fit of a response adds to page, terminal and summary."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.models.external.of_responses.files import solution_from_artifact, validation_from_artifact
from robid.models.external.of_responses.judging import LIMIT
from robid.models.external.of_responses.solution import RationalSolution, RationalValidation
from robid.models.external.of_responses.solution import Shown as ShownResponse
from robid.models.external.page.report import transfer_text
from robid.models.family import Shown
from robid.models.parameters import MEASURED, MODEL, curve, estimates_of, fit_report, quantile
from robid.report.correlation import correlation_section
from robid.report.numbers import duration, percent, significant
from robid.report.page import FitReport, KeyNumber
from robid.report.parameter_section import parameter_section
from robid.report.section import Beside, Choice, ColumnStyle, Figure, Folded, Notes, Part, Row, Section, Table

_CONVENTIONS = (
    "A real root is given as its rate, positive in the left half plane; a pair as natural frequency and damping"
    " ratio. Zeros with a negative rate or damping lie in the right half plane. Roots in z are given as those in s."
)
_STYLES: tuple[ColumnStyle, ...] = ("name", *("number",) * 6, "text")


def report(shown: Shown) -> FitReport:
    """Lays out an external fit of a response for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    estimate, count = solution.estimate, len(solution.transfers.names)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    estimates = estimates_of(shown, estimate)
    sections = (
        _transfers(solution),
        _responses("Frequency response", "response", solution, solution.shown),
        *(() if validation is None else (_responses("Validation", "validation", solution, validation.shown),)),
        *parameter_section(estimates, _CONVENTIONS),
        *correlation_section(estimates),
    )
    return fit_report(
        shown,
        estimate,
        estimates,
        None if validation is None else validation.outcome,
        found=f"{count} transfer function{'s' if count > 1 else ''}",
        unknown="All is of one response: nothing shows what differs from day to day.",
        numbers=_key_numbers(solution, validation),
        sections=sections,
        summary=_summary(solution, validation),
        worst=("", "") if validation is None else _worst(solution, validation),
    )


def _transfers(solution: RationalSolution) -> Section:
    own, quality = solution.transfers, solution.quality
    rows = []
    for channel, name in enumerate(own.names):
        block = int(own.block_of[channel])
        delay = duration(float(own.delay_s[block])) if own.delay_s[block] else "0"
        text = transfer_text(np.trim_zeros(own.numerator[channel], "f"), np.trim_zeros(own.denominator[block], "f"))
        text = text.replace("s", "z") if own.time == "discrete" else text
        error = percent(float(quality.relative_error[channel]))
        rows.append((name, f"{own.zeros[channel]} / {own.poles[block]}", delay, error, text))
    variable = (
        "s in rad/s" if own.time == "continuous" else f"z, sampled every {duration(solution.ports.sampling_period_s)}"
    )
    table = Table(
        ("Channel", "Zeros / poles", "Delay", "Off by", f"Transfer function, {variable}"),
        tuple(rows),
        caption="Off by: root mean square of the relative error over lines that noise leaves. The delay comes on top.",
        styles=("name", "number", "number", "number", "code"),
    )
    parts: list[Part] = [table, _misfit(solution)]
    if solution.remarks:
        parts.append(Notes(solution.remarks))
    parts.append(Folded("Structures that were tried", (_tried(solution),)))
    return Section(
        "Transfer functions",
        "From input to output, fitted to the response by its deviations.",
        tuple(parts),
        "transfers",
    )


def _misfit(solution: RationalSolution) -> Table:
    quality = solution.quality
    rows = tuple(
        (name, significant(cost, 4), str(int(freedom)), percent(chance), f"{wide:.3g}")
        for name, cost, freedom, chance, wide in zip(
            solution.transfers.blocks,
            quality.cost.tolist(),
            quality.degrees_of_freedom.tolist(),
            quality.misfit_chance.tolist(),
            quality.widened.tolist(),
            strict=True,
        )
    )
    return Table(
        ("Block", "Cost", "Expected", "Chance", "Intervals widened"),
        rows,
        caption="Cost: squares of real and imaginary parts over their deviations, chi-square with as many degrees of"
        " freedom as expected, were the model and the deviations right.",
        styles=("name", *("number",) * 4),
    )


def _tried(solution: RationalSolution) -> Table:
    rows = [
        Row(
            (
                *(str(each.poles), each.zeros, str(each.integrators), duration(each.delay_s) if each.delay_s else "0"),
                *(significant(each.cost, 5), significant(each.score, 5), "", "chosen" if each.chosen else ""),
            ),
            group=each.block,
            faint=not each.chosen,
            choice=each.block,
        )
        for each in solution.tried
    ]
    heads = ("Poles", "Zeros", "Integrators", "Delay", "Cost", "Score", "", "")
    caption = "Score: cost with the price of its parameters; the smaller, the more evidence."
    return Table(heads, tuple(rows), caption=caption, styles=_STYLES, choice="Block", fit="tall")


def _responses(title: str, anchor: str, solution: RationalSolution, shown: ShownResponse) -> Section:
    options = tuple(
        (name, (Beside(_figures(solution, shown, channel), 2),))
        for channel, name in enumerate(solution.transfers.names)
    )
    lead = "The measured response with its deviation, and the model with its bounds, delay and hold included."
    return Section(title, lead, (Choice("Channel", options),), anchor)


def _figures(solution: RationalSolution, shown: ShownResponse, channel: int) -> tuple[Figure, Figure]:
    wide, frequency = quantile(solution.estimate.confidence), shown.frequency_hz
    measured, model = shown.measured[:, channel], shown.model[:, channel]
    size, off = np.abs(model), shown.model_std[:, channel] / np.sqrt(2)
    angle = np.degrees(np.unwrap(np.angle(model)))
    phase = angle + (np.degrees(np.angle(measured)) - angle + 180) % 360 - 180
    with np.errstate(invalid="ignore", divide="ignore"):
        half = np.degrees(shown.measured_std[:, channel] / np.abs(measured)) / np.sqrt(2) * wide
        turned = np.degrees(wide * off / size)
    magnitude = (
        curve(
            "measured",
            frequency,
            np.abs(measured),
            MEASURED,
            wide * shown.measured_std[:, channel] / np.sqrt(2),
            points=True,
        ),
        curve("model", frequency, size, MODEL, wide * off),
    )
    turn = (
        curve("measured", frequency, phase, MEASURED, half, points=True),
        curve("model", frequency, angle, MODEL, turned),
    )
    transfers, ports = solution.transfers, solution.ports
    unit = f"{ports.output_units[transfers.outputs[channel]]} per {ports.input_units[transfers.inputs[channel]]}"
    return (
        Figure("Magnitude", "Frequency [Hz]", f"Magnitude [{unit}]", magnitude, height=300),
        Figure("Phase", "Frequency [Hz]", "Phase [°]", turn, log_y=False, height=300),
    )


def _key_numbers(solution: RationalSolution, validation: RationalValidation | None) -> Iterator[KeyNumber]:
    own = solution.quality.relative_error
    yield KeyNumber(
        "Off by, own data", percent(float(np.nanmax(own))), f"worst: {solution.transfers.names[int(np.nanargmax(own))]}"
    )
    if validation is not None:
        new = validation.relative_error
        yield KeyNumber(
            "Off by, new data",
            percent(float(np.nanmax(new))),
            f"worst: {solution.transfers.names[int(np.nanargmax(new))]}",
        )


def _worst(solution: RationalSolution, validation: RationalValidation) -> tuple[str, str]:
    worst = int(np.nanargmax(validation.relative_error))
    return f"{percent(float(validation.relative_error[worst]))} of {solution.transfers.names[worst]}", percent(LIMIT)


def _summary(solution: RationalSolution, validation: RationalValidation | None) -> dict[str, float]:
    own, quality, found = solution.transfers, solution.quality, dict[str, float]()
    for channel, name in enumerate(own.names):
        found[f"{name}.relative_error"] = float(quality.relative_error[channel])
        found[f"{name}.zeros"] = float(own.zeros[channel])
        if validation is not None:
            found[f"validation.{name}.relative_error"] = float(validation.relative_error[channel])
    for block, name in enumerate(own.blocks):
        found |= {
            f"{name}.poles": float(own.poles[block]),
            f"{name}.delay_s": float(own.delay_s[block]),
            f"{name}.misfit": float(quality.cost[block] / max(quality.degrees_of_freedom[block], 1)),
        }
    if validation is not None:
        found["validation.ok"] = float(validation.outcome.ok)
    return found
