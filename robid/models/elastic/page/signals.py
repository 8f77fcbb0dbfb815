"""Measured against simulated signals of an elastic fit, in time: a few configurations, the worst among them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.frf.frf import Frf
from robid.frf.replay import Replay, corrected_inputs, replay
from robid.models.elastic.page.gather import FitContent
from robid.models.family import Shown
from robid.models.parameters import ERROR, GREY, MEASURED, MODEL, over_time
from robid.report.charts import configuration_label
from robid.report.costs import CostRow
from robid.report.numbers import percent, pretty_unit
from robid.report.section import Choices, Figure, Part, Section, Table

_PICTURES = 30  # of all motors and configurations
_MOST_CONFIGURATIONS = 3  # of the fit's own, and of the validation's
_POINTS = 700  # of a curve
_EXCERPT = 0.08  # of a period
_LEAD = (
    "One period of the first experiment, at the excited lines: what was measured, and the model's answer to the"
    " measured inputs, less the friction that was subtracted for the response. The excerpt is about the largest"
    " difference; grey is what all lines of the band hold, noise and distortion among it. Curves are thinned to the"
    " smallest and the largest value of each stretch, so that peaks stay."
)


@dataclass(frozen=True)
class Signals:
    """Signals of one configuration."""

    name: str  # configuration, and whose it is
    outputs: tuple[str, ...]  # name of each output
    units: tuple[str, ...]  # unit of each output
    quantities: tuple[str, ...]  # what each output is
    found: Replay


def signals_of(shown: Shown, fit: FitContent) -> tuple[Signals, ...]:
    """Replays a few configurations of a fit and of its validation, as far as their records are there."""
    most = max(1, min(_MOST_CONFIGURATIONS, _PICTURES // (2 * len(fit.frf.output_names))))
    data = shown.data
    own = zip(data.origins, data.rows, strict=True)
    found = [*_replayed(shown, data.response, fit.frf.response, fit.model_response, [*own], fit.estimation_costs, most)]
    found = [(f"{name} (fit)", one) for name, one in found]
    if fit.validation_frf is not None and fit.validation_model is not None and shown.new is not None:
        new = [(fit.validation_campaign, row) for row in range(len(fit.validation_frf.configurations))]
        pair = fit.validation_frf.response, fit.validation_model
        more = _replayed(shown, shown.new.response, *pair, new, fit.validation_costs, most)
        found += [(f"{name} (validation)", one) for name, one in more]
    channels = fit.frf.output_channels
    described = (
        tuple(channel.name for channel in channels),
        tuple(channel.unit for channel in channels),
        tuple(channel.title for channel in channels),
    )
    return tuple(Signals(name, *described, one) for name, one in found)


def _replayed(
    shown: Shown,
    frf: Frf,
    measured: ComplexArray,
    model: ComplexArray,
    places: Sequence[tuple[str, int]],
    costs: Sequence[CostRow],
    most: int,
) -> Iterator[tuple[str, Replay]]:
    """Yields the replay of the configurations that cost most over what noise gives, in their order."""
    corrected = corrected_inputs(frf, measured)
    for index in worst_of(costs, len(places), most):
        record = shown.record(*places[index])
        found = None if record is None else replay(record, corrected, model[index], index)
        if found is not None:
            yield configuration_label(frf, index), found


def worst_of(costs: Sequence[CostRow], count: int, most: int) -> list[int]:
    """Returns the configurations with the highest costs over the expected ones, by index and in order."""
    sizes = [row.cost / row.expected_cost if row.expected_cost else row.cost for row in costs]
    sizes = sizes if len(sizes) == count else [0.0] * count
    return sorted(sorted(range(count), key=lambda index: -sizes[index])[:most])


def signal_section(signals: Sequence[Signals]) -> tuple[Section, ...]:
    """Lays out signals in time; nothing where no record is there."""
    if not signals:
        return ()
    outputs = range(len(signals[0].outputs))
    options: list[tuple[tuple[str, ...], tuple[Part, ...]]] = [
        ((signals[0].outputs[output], one.name), _figures(one, output)) for output in outputs for one in signals
    ]
    choice = Choices(("Output", "Configuration"), tuple(options))
    return (Section("Signals in time", _LEAD, (choice, _table(signals)), "signals"),)


def _table(signals: Sequence[Signals]) -> Table:
    rows = tuple((one.name, *(percent(each) for each in one.found.relative_error.tolist())) for one in signals)
    caption = "Root mean square of measured less model over that of what was measured, in the period shown."
    return Table(("Configuration", *signals[0].outputs), rows, title="Differences over size", caption=caption)


def _figures(signals: Signals, output: int) -> tuple[Figure, ...]:
    """One output over a period, the difference beneath it, and an excerpt about the largest difference."""
    found, unit = signals.found, pretty_unit(signals.units[output])
    time_s, measured, modelled = found.time_s, found.measured[:, output], found.modelled[:, output]
    title = f"{signals.quantities[output].capitalize()} [{unit}]"
    both = (
        over_time("measured", time_s, measured, MEASURED, _POINTS),
        over_time("model", time_s, modelled, MODEL, _POINTS),
    )
    left = (over_time("measured less model", time_s, measured - modelled, ERROR, _POINTS),)
    near = excerpt(measured - modelled)
    part = (
        over_time("all lines of the band", time_s[near], found.whole[near, output], GREY, _POINTS),
        over_time("measured", time_s[near], measured[near], MEASURED, _POINTS),
        over_time("model", time_s[near], modelled[near], MODEL, _POINTS),
    )
    return (
        Figure("One period", "", title, both, log_x=False, log_y=False, height=270),
        Figure("Difference", "Time [s]", f"[{unit}]", left, log_x=False, log_y=False, height=200),
        Figure("Excerpt", "Time [s]", title, part, log_x=False, log_y=False, height=290),
    )


def excerpt(difference: FloatArray) -> slice:
    """A stretch of a period (n_sample,) about its largest difference."""
    n_sample = len(difference)
    length = max(2, round(_EXCERPT * n_sample))
    first = int(np.clip(int(np.argmax(np.abs(difference))) - length // 2, 0, n_sample - length))
    return slice(first, first + length)
