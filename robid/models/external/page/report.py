"""What an external fit adds to page, terminal and summary, section by section."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.external.files import solution_from_artifact, validation_from_artifact
from robid.models.external.fit.data import Agreement
from robid.models.external.fit.options import CouplingOptions
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.judge.plausible import NRMSE_LIMIT
from robid.models.external.judge.validating import ExternalValidation
from robid.models.external.page.charts import excitation_figures, locus_figure, response_figures, step_figure
from robid.models.external.page.data import coupling_section, new_section, own_section, own_table
from robid.models.external.settings import external_fit
from robid.models.family import Shown
from robid.models.parameters import estimates_of, fit_report
from robid.report.correlation import correlation_section
from robid.report.numbers import MINUS, MISSING, duration, percent, significant
from robid.report.page import FitReport, KeyNumber
from robid.report.parameter_section import parameter_section
from robid.report.parameters import Estimates
from robid.report.section import Beside, Choice, ColumnStyle, Folded, Notes, Part, Row, Section, Table

_SUPERSCRIPTS = str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹")
_DIGITS = 5


def transfer_text(numerator: FloatArray, denominator: FloatArray) -> str:
    """Writes a transfer function, coefficients highest power first, as `(0.2 s + 3) / (s² + 4 s + 3)`."""
    above, below = polynomial_text(numerator), polynomial_text(denominator)
    return f"{_wrapped(above)} / {_wrapped(below)}"


def without_rates(denominator: FloatArray, integrators: int) -> FloatArray:
    """Returns a denominator (n_power,) as it is with its integrators at zero, where nothing tells them from it."""
    return np.concatenate([denominator[: len(denominator) - integrators], np.zeros(integrators)])


def polynomial_text(coefficients: FloatArray) -> str:
    """Writes a polynomial in s, highest power first."""
    degree = len(coefficients) - 1
    text = ""
    for place, value in enumerate(np.asarray(coefficients, float).tolist()):
        if value == 0:
            continue
        sign = "" if not text and value > 0 else MINUS if not text else f" {MINUS} " if value < 0 else " + "
        power = degree - place
        variable = "" if power == 0 else "s" if power == 1 else f"s{str(power).translate(_SUPERSCRIPTS)}"
        size = "" if abs(value) == 1 and variable else significant(abs(value), _DIGITS)
        text += sign + f"{size} {variable}".strip()
    return text or "0"


def _wrapped(text: str) -> str:
    return f"({text})" if " + " in text or MINUS in text else text


_MOST_SHOTS = 4
_HELD = {"zoh": "constant over a sample", "foh": "in straight lines between samples"}
_VISIBLE = 1e-3  # of the final value
_CONVENTIONS = (
    "A real root is given as its rate, positive in the left half plane; a pair as natural frequency and damping"
    " ratio. Zeros with a negative rate or damping lie in the right half plane."
)


def sections(
    solution: ExternalSolution, estimates: Estimates, data: Section, options: CouplingOptions
) -> tuple[Section, ...]:
    """Lays out a fit."""
    return (
        _transfers(solution),
        data,
        *parameter_section(estimates, _CONVENTIONS),
        *correlation_section(estimates),
        _responses(solution),
        _dynamics(solution),
        *coupling_section(solution.coupling, solution.ports, options),
        _excitation(solution),
    )


def _transfers(solution: ExternalSolution) -> Section:
    transfers, quality, ports = solution.transfers, solution.quality, solution.ports
    rows = []
    for channel, name in enumerate(transfers.names):
        block = int(transfers.block_of[channel])
        samples = int(transfers.delay_samples[block])
        delay = f"{samples} ({duration(samples * ports.sampling_period_s)})" if samples else "0"
        below = without_rates(transfers.denominator[block], solution.integrators(block))
        text = transfer_text(transfers.numerator[channel], below)
        rows.append((name, f"{transfers.zeros[block]} / {transfers.poles[block]}", delay, text))
    sampled = f"Sampled every {duration(ports.sampling_period_s)}, commands {_HELD.get(ports.hold, ports.hold)}"
    averaged = f", averaged over {transfers.moving_average} samples" if transfers.moving_average > 1 else ""
    table = Table(
        ("Channel", "Zeros / poles", "Delay in samples", "Transfer function, s in rad/s"),
        tuple(rows),
        caption=f"{sampled}{averaged}: hold, average and delay come on top of these functions.",
        styles=("name", "number", "number", "code"),
    )
    lead = "From command to output, strictly proper, without delay, hold and moving average."
    parts: list[Part] = [table, own_table(solution), Folded("Structures that were tried", (_tried(solution),))]
    told = (f"{finding.channel}: {finding.message}." for finding in solution.findings)
    notes = [*_behaviour(solution), *solution.remarks, *told]
    if notes:
        parts.append(Notes(tuple(notes)))
    reasons = zip(transfers.blocks, quality.reason, strict=True)
    parts.append(Folded("Why these structures", (Notes(tuple(f"{name}: {reason}" for name, reason in reasons)),)))
    return Section("Transfer functions", lead, tuple(parts), "transfers")


def _tried(solution: ExternalSolution) -> Table:
    rows = []
    for each in solution.tried:
        structure = (str(number) for number in (each.poles, each.zeros, each.delay_samples))
        bic = f"{each.bic:.1f}" if np.isfinite(each.bic) else MISSING
        cells = (*structure, bic, f"{each.nrmse:.4f}", percent(each.whiteness_p), "chosen" if each.chosen else "")
        rows.append(Row(cells, group=each.block, faint=not each.chosen, choice=each.block))
    caption = "BIC: Bayesian information criterion, the smaller the better."
    heads = ("Poles", "Zeros", "Delay", "BIC", "NRMSE", "Whiteness", "")
    styles: tuple[ColumnStyle, ...] = ("name", *("number",) * 5, "text")
    return Table(heads, tuple(rows), caption=caption, styles=styles, choice="Channel", fit="tall")


def _behaviour(solution: ExternalSolution) -> list[str]:
    names = solution.transfers.names
    return [
        f"{name}: a step goes the wrong way first, by {percent(share)} of its final value (a zero in the right half"
        " plane)."
        for name, share, own in zip(names, solution.steps.undershoot.tolist(), _own(solution), strict=True)
        if own and share > _VISIBLE
    ]


def _own(solution: ExternalSolution) -> list[bool]:
    """Whether each channel leads from a command to its own output; others may end anywhere near zero."""
    transfers = solution.transfers
    return [bool(own) for own in solution.coupling.own[transfers.outputs, transfers.inputs]]


def _responses(solution: ExternalSolution) -> Section:
    options = tuple(
        (name, (Beside(response_figures(solution, channel), 2),))
        for channel, name in enumerate(solution.transfers.names)
    )
    lead = (
        "The empirical response with the region that contains the true one, over the band that was excited, and the"
        " model with its bounds, both from samples to samples: with delay, hold and moving average."
    )
    return Section("Frequency response", lead, (Choice("Channel", options),), "response")


def _dynamics(solution: ExternalSolution) -> Section:
    steps, confidence, transfers = solution.steps, solution.estimate.confidence, solution.transfers
    options: list[tuple[str, tuple[Part, ...]]] = []
    for channel, name in enumerate(solution.transfers.names):
        step = step_figure(steps, channel, _final(solution, channel), confidence)
        options.append((name, (Beside((locus_figure(solution, channel), step), 2),)))
    # What integrates has no final value that these could be related to.
    rests = [
        own and not solution.integrators(int(block))
        for own, block in zip(_own(solution), transfers.block_of, strict=True)
    ]
    columns = (steps.undershoot.tolist(), steps.overshoot.tolist(), steps.rise_s.tolist(), rests)
    rows = tuple(
        (name, percent(under), percent(over), duration(rise) if np.isfinite(rise) else MISSING)
        for name, under, over, rise, own in zip(solution.transfers.names, *columns, strict=True)
        if own
    )
    table = Table(("Channel", "Undershoot", "Overshoot", "Rise, 10 to 90 %"), rows, title="Steps", fit="compact")
    lead = (
        "Poles and zeros with bounds on their real and imaginary parts, and where the poles go in a proportional loop"
        " around the channel without its delay; roots beyond half the sampling rate are left out. Beside them what the"
        " model does after a step of one unit, delay included, with bounds."
    )
    return Section("Poles, zeros and steps", lead, (Choice("Channel", tuple(options)), table), "dynamics")


def _final(solution: ExternalSolution, channel: int) -> float:
    """Static gain of a channel, where it comes to rest."""
    block = int(solution.transfers.block_of[channel])
    model, place = solution.transfer(block), solution.transfers.channels_of(block).tolist().index(channel)
    rests = model.is_stable and not solution.integrators(block)
    return float(model.static_gain.ravel()[place]) if rests else float("nan")


def _excitation(solution: ExternalSolution) -> Section:
    found, ports, transfers = solution.excitation, solution.ports, solution.transfers
    options = []
    for channel, name in enumerate(found.names):
        place = transfers.names.index(name)
        units = ports.input_units[transfers.inputs[place]], ports.output_units[transfers.outputs[place]]
        shots = np.unique(found.time_shot[found.time_channel == channel])[:_MOST_SHOTS]
        rows = tuple(Beside(excitation_figures(found, channel, int(shot), units), 2) for shot in shots)
        options.append((name, rows))
    lead = "What was commanded, and what came of it: over time, and component by component against the resolution."
    return Section("Excitation", lead, (Choice("Channel", tuple(options)),), "excitation")


def report(shown: Shown) -> FitReport:
    """Lays out an external fit for page, terminal and summary."""
    solution = solution_from_artifact(shown.model)
    estimate, count = solution.estimate, len(solution.transfers.names)
    validation = None if shown.validation is None else validation_from_artifact(shown.validation)
    estimates = with_differences(estimates_of(shown, estimate), solution)
    data = own_section(solution) if validation is None else new_section(solution, validation)
    options = external_fit(shown.data.loaded.experiment, shown.data.name).coupling
    return fit_report(
        shown,
        estimate,
        estimates,
        None if validation is None else validation.outcome,
        found=f"{count} transfer function{'s' if count > 1 else ''}",
        unknown=_unknown(solution),
        numbers=_key_numbers(solution, validation),
        sections=sections(solution, estimates, data, options),
        summary=_summary(solution, validation),
        worst=("", "") if validation is None else _worst_error(validation),
    )


def _worst_error(validation: ExternalValidation) -> tuple[str, str]:
    """Writes the worst output's share of motion that is not predicted, 1 - NRMSE, and its limit."""
    worst = min(validation.agreements, key=lambda each: each.nrmse)
    return f"{percent(1 - worst.nrmse)} of the motion of {worst.output}", percent(1 - NRMSE_LIMIT)


def _unknown(solution: ExternalSolution) -> str:
    """Says what no interval of a fit of single recordings holds."""
    single = solution.recordings.size > 0 and int(solution.recordings.max()) == 1
    told = "All is of one recording: nothing shows what differs from day to day, as several in `from` would."
    return told if single else ""


def with_differences(estimates: Estimates, solution: ExternalSolution) -> Estimates:
    """Notes beside each parameter how much it differs from recording to recording, where that is more than noise."""
    notes = [
        f"differs by {percent(std)} between recordings" if np.isfinite(std) and std > 0 else ""
        for std in solution.between_std.tolist()
    ]
    if not notes:
        return estimates
    rows = zip(estimates.rows, notes, strict=True)
    return replace(estimates, rows=tuple(replace(row, note=note) if note else row for row, note in rows))


def _key_numbers(solution: ExternalSolution, validation: ExternalValidation | None) -> Iterator[KeyNumber]:
    yield _worst("NRMSE, own data", solution.agreements)
    if validation is not None:
        yield _worst("NRMSE, new data", validation.agreements)
    if not solution.coupling.own.all():
        yield KeyNumber("Decoupled up to", f"{significant(solution.coupling.overall_hz, 3)} Hz")


def _worst(label: str, every: Sequence[Agreement]) -> KeyNumber:
    worst = min(every, key=lambda each: each.nrmse)
    return KeyNumber(label, f"{worst.nrmse:.3f}", f"worst: {worst.output}" if len(every) > 1 else "")


def _summary(solution: ExternalSolution, validation: ExternalValidation | None) -> dict[str, float]:
    found = {"decoupled_up_to_hz": solution.coupling.overall_hz}
    if solution.recordings.size:
        found["recordings"] = float(solution.recordings.min())
    for row, name in enumerate(solution.quality.output_names):
        found[f"{name}.nrmse"] = float(solution.quality.nrmse[row])
    transfers = solution.transfers
    for block, name in enumerate(transfers.blocks):
        found |= {
            f"{name}.poles": float(transfers.poles[block]),
            f"{name}.zeros": float(transfers.zeros[block]),
            f"{name}.delay_samples": float(transfers.delay_samples[block]),
            f"{name}.fpe": float(solution.quality.fpe[block]),
        }
    if validation is not None:
        found["validation.ok"] = float(validation.outcome.ok)
        found["validation.nrmse"] = min(each.nrmse for each in validation.agreements)
        # Of each output in the place where it is worst, which comes last.
        pairs = sorted(zip(validation.agreements, validation.bounds, strict=True), key=lambda pair: -pair[0].nrmse)
        for each, bounds in pairs:
            found |= {
                f"validation.{each.output}.nrmse": each.nrmse,
                f"validation.{each.output}.r_squared": each.r_squared,
                f"validation.{each.output}.fpe": bounds.fpe,
                f"validation.{each.output}.inside": bounds.inside,
            }
    return found
