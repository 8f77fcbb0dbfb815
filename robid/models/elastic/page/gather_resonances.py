"""The resonances of an elastic fit as rows, beside what other campaigns of the run show of the same configurations."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.models.elastic.files import new_resonances_from_artifact, resonances_from_artifact
from robid.models.elastic.judge.repeats import Measured, Repeat, pool_repeats
from robid.models.elastic.judge.resonances import ResonanceTable
from robid.models.elastic.page.content import RepeatRow, ResonanceRow
from robid.models.elastic.settings import elastic_fit
from robid.models.family import Shown
from robid.settings.experiment import payload_kg


def resonance_rows(shown: Shown, confidence: float) -> tuple[ResonanceRow, ...]:
    """Returns the resonances of a fit's own data, their intervals widened to what further campaigns scatter.

    Args:
        shown: The fit, and the others of the run.
        confidence: Level of the intervals.
    """
    own = _fitted(shown)
    others = [*_validated(shown), *(each for other in shown.beside for each in (_fitted(other), *_validated(other)))]
    table, repeats = pool_repeats(own, [each for each in others if _same_payload(shown, own, each)], confidence)
    return _rows(table, {repeat.row: repeat for repeat in repeats})


def _fitted(shown: Shown) -> Measured:
    data = shown.data
    return Measured(resonances_from_artifact(shown.model), data.response.configurations, data.origins)


def _validated(shown: Shown) -> Iterator[Measured]:
    """Resonances of the campaign that a fit was validated on, if there are some."""
    table = None if shown.validation is None else new_resonances_from_artifact(shown.validation)
    campaign = elastic_fit(shown.data.loaded.experiment, shown.data.name).validate_on
    if table is not None and shown.new is not None and campaign is not None:
        places = shown.new.response.configurations
        yield Measured(table, places, (campaign,) * len(places))


def _same_payload(shown: Shown, own: Measured, other: Measured) -> bool:
    """Whether all campaigns move the same mass: what carries another one is another robot."""
    campaigns, robot = shown.data.loaded.experiment.campaigns, shown.data.loaded.robot
    return len({payload_kg(campaigns[name], robot) for name in (*own.campaigns, *other.campaigns)}) == 1


def _rows(table: ResonanceTable, repeats: dict[int, Repeat]) -> tuple[ResonanceRow, ...]:
    nowhere = np.full(table.measured_hz.size, np.nan)
    pole, low, high = (
        nowhere if values is None else values for values in (table.pole_hz, table.pole_lower_hz, table.pole_upper_hz)
    )
    return tuple(
        ResonanceRow(
            configuration=int(table.configuration[row]),
            channel=channel,
            kind="resonance" if table.kind[row] == "resonance" else "antiresonance",
            measured_hz=float(table.measured_hz[row]),
            model_hz=_finite(table.model_hz[row]),
            interval_hz=_interval(table.lower_hz[row], table.upper_hz[row]),
            mode_hz=_finite(table.mode_hz[row]),
            mode_interval_hz=_interval(table.mode_lower_hz[row], table.mode_upper_hz[row]),
            damping=_finite(table.damping[row]),
            pole_hz=_finite(pole[row]),
            pole_interval_hz=_interval(low[row], high[row]),
            repeat=_repeat_row(repeats[row]) if row in repeats else None,
        )
        for row, channel in enumerate(table.channel)
    )


def _repeat_row(repeat: Repeat) -> RepeatRow:
    low, high = repeat.mean_hz - repeat.half_hz, repeat.mean_hz + repeat.half_hz
    return RepeatRow(
        campaigns=repeat.campaigns,
        lowest_hz=float(repeat.peaks_hz.min()),
        highest_hz=float(repeat.peaks_hz.max()),
        peak_hz=float(repeat.mean_hz[0]),
        peak_interval_hz=(float(low[0]), float(high[0])),
        pole_hz=_finite(repeat.mean_hz[1]),
        pole_interval_hz=_interval(low[1], high[1]),
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _interval(lower: float, upper: float) -> tuple[float, float] | None:
    return (float(lower), float(upper)) if np.isfinite([lower, upper]).all() else None
