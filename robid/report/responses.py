"""Sections on responses that no model was fitted to: the responses themselves, and how well they are known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import TypeAlias

import numpy as np

from robid.arrays import FloatArray
from robid.frf.frf import Frf
from robid.frf.quality import Quality, dropped_lines, judge, lowest, middle, saturation_text, worst_saturation
from robid.report.charts import BodeMatrix, BodeResponse, configuration_label
from robid.report.numbers import MISSING, number_of, percent, significant
from robid.report.page import Headline, KeyNumber
from robid.report.peaks import peak_table
from robid.report.section import ColumnStyle, Notes, Part, Section, Table
from robid.signals.quantities import Channel, response_unit

_NINES = 6
_NUMBERS: tuple[ColumnStyle, ...] = ("number",) * 10
_SHOWN = 12
_STYLES: tuple[ColumnStyle, ...] = ("name", "text", "text", *_NUMBERS)
_LEAD = (
    "Responses to which no model was fitted, with their uncertainty. Every column is one input, every row one output;"
    " select an element to enlarge it."
)
_FEW_DROPPED = 0.05  # share of the lines from which on the sentence that sums up says that they were dropped
_CAPTION = (
    "Of each output, at the input that moves it the most: median over the lines, and the worst line. Uncertainty is the"
    " standard deviation over the magnitude; it contains noise alone where there is one realization. Coherence is the"
    " multiple one: the share of the output's power that the response to all inputs explains. Odd and even: what the"
    " silent lines show, noise included, as a deviation of the response."
)


@dataclass(frozen=True)
class _Kind:
    """What responses must share to stand in one matrix."""

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    unit: str


Campaigns: TypeAlias = Sequence[tuple[str, Frf]]


def response_sections(campaigns: Campaigns) -> tuple[Section, ...]:
    """Lays out the responses of some campaigns, those of a kind in one section; nothing without any."""
    ordered = sorted(campaigns, key=lambda item: repr(_kind(item[1])))
    grouped = [list(members) for _, members in groupby(ordered, key=lambda item: _kind(item[1]))]
    grouped.sort(key=lambda members: [name for name, _ in campaigns].index(members[0][0]))
    several = len(grouped) > 1
    return tuple(_section(members, number if several else 0) for number, members in enumerate(grouped, 1))


def response_headlines(campaigns: Campaigns) -> tuple[Headline, ...]:
    """Picks the numbers about each campaign's responses that a reader looks for first."""
    return tuple(Headline(name, _key_numbers(frf)) for name, frf in campaigns)


def responses_verdict(campaigns: Campaigns) -> str:
    """Says in one sentence what is there, for experiments that ask for no model."""
    trusted = [(name, frf, middle(judge(frf).relative_std)) for name, frf in campaigns if not saturation_text(frf)]
    told = ", ".join(f"{name} to {percent(value)}{_by(frf)}" for name, frf, value in trusted if not np.isnan(value))
    end = f" and known: {told} (median standard deviation)" if told else ", with unknown uncertainty" if trusted else ""
    responses = "response is" if len(campaigns) == 1 else f"responses of {len(campaigns)} campaigns are"
    clipped = "".join(f" Do not trust {name}: {text}." for name, frf in campaigns if (text := saturation_text(frf)))
    lacking = ""
    for name, frf in campaigns:
        dropped, whole = _count(frf), len(frf.response) * len(frf.frequency_hz)
        lacking += f" At {dropped} of {whole} lines of {name} too little is known." * (dropped > _FEW_DROPPED * whole)
    return f"No fit was asked for; the {responses} measured{end}.{lacking}{clipped}"


def _by(frf: Frf) -> str:
    return " by noise alone" if frf.total_covariance is None else ""


def response_summary(frf: Frf) -> dict[str, float]:
    """Returns what `response_headlines` shows as numbers, by name; what is unknown is left out."""
    quality = judge(frf)
    found = {
        "dropped_lines": float(_count(frf)),
        "saturated_share": float("nan") if frf.saturated_inputs is None else worst_saturation(frf),
        "median_relative_std": middle(quality.relative_std),
        "median_signal_to_noise_db": middle(quality.signal_to_noise_db),
        "median_coherence": middle(quality.coherence),
        "lowest_coherence": lowest(quality.coherence),
    }
    return {f"response.{key}": value for key, value in found.items() if np.isfinite(value)}


def quantity_title(channels: Sequence[Channel]) -> str:
    """What some channels are, in plain words; empty where they differ, see `named_by_quantity`."""
    titles = {channel.title for channel in channels}
    return titles.pop() if len(titles) == 1 else ""


def named_by_quantity(frf: Frf) -> Frf:
    """The response, the channels of a side that mixes quantities named with what they are."""
    return replace(frf, input_channels=_told(frf.input_channels), output_channels=_told(frf.output_channels))


def shown_unit(frf: Frf) -> str:
    """Unit of a response's elements, each once."""
    units = [response_unit(output.unit, frf.input_unit) for output in frf.output_channels]
    return " or ".join(dict.fromkeys(units))


def _told(channels: tuple[Channel, ...]) -> tuple[Channel, ...]:
    if quantity_title(channels):
        return channels
    return tuple(replace(channel, name=f"{channel.name} {channel.title}") for channel in channels)


def _kind(frf: Frf) -> _Kind:
    inputs, outputs = ({channel.title for channel in side} for side in (frf.input_channels, frf.output_channels))
    return _Kind(tuple(sorted(inputs)), tuple(sorted(outputs)), shown_unit(frf))


def _section(campaigns: Campaigns, number: int) -> Section:
    first = campaigns[0][1]
    responses = tuple(BodeResponse(name, named_by_quantity(frf)) for name, frf in campaigns)
    given, answered = (quantity_title(side) for side in (first.input_channels, first.output_channels))
    bode = BodeMatrix("", responses, input_quantity=given, output_quantity=answered, unit=shown_unit(first))
    parts: list[Part] = [bode, *peak_table(campaigns), _table(campaigns)]
    dropped = [sentence for name, frf in campaigns for sentence in _dropped(name, frf)]
    parts += [Notes(tuple(dropped))] if dropped else []
    what = f", {', '.join(_kind(first).outputs)}" if number else ""
    return Section(f"Frequency response{what}", _LEAD, tuple(parts), f"responses-{number}" if number else "responses")


def _table(campaigns: Campaigns) -> Table:
    rows = [row for name, frf in campaigns for row in _rows(name, frf, judge(frf))]
    worst = [head for what in ("Uncertainty", "SNR", "Coherence") for head in (what, "Worst")]
    return Table(
        ("Campaign", "Configuration", "Output", "Lines", "Dropped", *worst, "Odd", "Even"),
        tuple(rows),
        title="How well the responses are known",
        caption=_CAPTION,
        styles=_STYLES,
        fit="tall",
    )


def _rows(name: str, frf: Frf, quality: Quality) -> list[tuple[str, ...]]:
    dropped = dropped_lines(frf).any(axis=2).sum(axis=1).tolist()
    return [
        (
            name,
            number_of(index),
            output.name,
            str(len(frf.lines) - dropped[index]),
            str(dropped[index]),
            *(percent(value) for value in _both(quality.relative_std[index, :, place], highest=True)),
            *(_decibels(value) for value in _both(quality.signal_to_noise_db[index, :, place])),
            *(coherence_text(value) for value in _both(quality.coherence[index, :, place])),
            *(percent(middle(level[index, :, place])) for level in (quality.odd, quality.even)),
        )
        for index in range(len(frf.configurations))
        for place, output in enumerate(frf.output_channels)
    ]


def _both(values: FloatArray, *, highest: bool = False) -> tuple[float, float]:
    return middle(values), -lowest(-values) if highest else lowest(values)


def _decibels(value: float) -> str:
    return MISSING if np.isnan(value) else f"{significant(value)} dB"


def coherence_text(value: float) -> str:
    """Writes a coherence with as many nines as it has, six at most, as in `0.99987`."""
    if np.isnan(value):
        return MISSING
    lost = max(1 - value, 10.0**-_NINES)
    return f"{min(value, 1 - 10.0**-_NINES):.{int(np.clip(1 - np.floor(np.log10(lost)), 2, _NINES))}f}"


def _dropped(name: str, frf: Frf) -> list[str]:
    """Which lines were dropped, by configuration and input."""
    sentences = []
    for index, motor in np.argwhere(dropped_lines(frf).any(axis=1)).tolist():
        lost = dropped_lines(frf)[index, :, motor]
        told = ", ".join(significant(value, 4) for value in frf.frequency_hz[lost][:_SHOWN].tolist())
        more = f" and {lost.sum() - _SHOWN} more" if lost.sum() > _SHOWN else ""
        where = f"{name}, configuration {configuration_label(frf, index)}"
        sentences.append(
            f"{where}: {lost.sum()} of {len(lost)} lines say too little of {frf.input_names[motor]} and were dropped:"
            f" {told}{more} Hz."
        )
    return sentences


def _count(frf: Frf) -> int:
    return int(dropped_lines(frf).any(axis=2).sum())


def _key_numbers(frf: Frf) -> tuple[KeyNumber, ...]:
    quality = judge(frf)
    dropped = _count(frf)
    low, high = frf.frequency_hz[[0, -1]].tolist()
    band, worst = f"{significant(low)} … {significant(high)} Hz", coherence_text(lowest(quality.coherence))
    numbers = [
        KeyNumber("Lines", str(len(frf.lines)), f"{band}, {dropped} dropped" if dropped else band),
        KeyNumber("Uncertainty", percent(middle(quality.relative_std)), "median standard deviation"),
        KeyNumber("Signal to noise", _decibels(middle(quality.signal_to_noise_db)), "median"),
        KeyNumber("Coherence", coherence_text(middle(quality.coherence)), f"median; worst {worst}"),
        KeyNumber("Odd distortion", percent(middle(quality.odd)), "median, noise included"),
        KeyNumber("Even distortion", percent(middle(quality.even)), "median, noise included"),
    ]
    share = worst_saturation(frf)
    clipped = [KeyNumber("Saturated", percent(share), "of the time: do not trust it")] if share else []
    return (*clipped, *(number for number in numbers if number.value != MISSING))


def measured_sentence(name: str, frf: Frf) -> str:
    """Says what a campaign's response is, and how well it is known."""
    n_conf, n_freq, n_out, n_in = frf.response.shape
    quality = judge(frf)
    low, high = frf.frequency_hz[[0, -1]].tolist()
    text = f"{n_out} x {n_in} response at {n_freq} lines from {significant(low)} to {significant(high)} Hz"
    text += f" in {n_conf} configurations" if n_conf > 1 else ""
    dropped = _count(frf)
    text += f", {dropped} of {n_conf * n_freq} with a dropped input" if dropped else ""
    if np.isfinite(quality.relative_std).any():
        known = f"{percent(middle(quality.relative_std))}{_by(frf)} (median standard deviation)"
        text += f", scattering by {known}" if saturation_text(frf) else f", known to {known}"
    if np.isfinite(quality.coherence).any():
        worst = coherence_text(lowest(quality.coherence))
        text += f", multiple coherence {coherence_text(middle(quality.coherence))} (median; worst {worst})"
    told = saturation_text(frf)
    return f"{name}: {text}; do not trust it: {told}" if told else f"{name}: {text}"
