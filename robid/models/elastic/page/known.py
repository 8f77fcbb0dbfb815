"""Gears that were known beforehand, from another fit, beside what a fit makes of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from robid.artifacts.results import estimate_from_artifact
from robid.models.elastic.fit.known_gears import is_known, with_known_gears
from robid.models.elastic.settings import elastic_fit
from robid.models.family import Shown
from robid.models.handed_on import gears_of
from robid.report.numbers import Scale, percent, scale_for
from robid.report.section import Section, Table
from robid.results.estimate import Estimate


@dataclass(frozen=True)
class KnownRow:
    """A gear that another fit has found, in SI units, each with half its interval over its value."""

    name: str  # Name of the transmission
    unit: str  # Unit of its stiffness
    gear: tuple[float, float]  # The gear alone, as the other fit found it
    chain: tuple[float, float]  # With what lies in line with it: what is known beforehand of the fit's parameter
    found: tuple[float, float] | None  # What the fit makes of that; None where it is fixed
    cubic: bool  # Whether its cubic coefficient was known too
    slip: bool  # Whether the torque at which its hysteresis slips was known

    @property
    def scale(self) -> Scale:
        """How its numbers are written."""
        return scale_for(self.chain[0], self.unit, self.chain[0] * self.chain[1])


@dataclass(frozen=True)
class KnownGears:
    """All of them."""

    fit: str = ""  # Name of the fit that found them; empty where none is named
    rows: tuple[KnownRow, ...] = ()
    slipping: frozenset[str] = frozenset()  # Names of the transmissions whose hysteresis the fit estimates


def known_content(shown: Shown, estimate: Estimate) -> KnownGears:
    """Gathers what was known of gears beforehand, and what a fit makes of it."""
    data = shown.data
    settings = elastic_fit(data.loaded.experiment, data.name)
    if settings.springs_from is None:
        return KnownGears()
    robot = data.loaded.robot.to_robot(data.loaded.experiment.campaigns[settings.campaign].payload_kg)
    taken = estimate_from_artifact(data.taken["gears"])
    gears = gears_of(taken, settings.springs_from, robot, data.response.input_unit)
    quantile = float(norm.ppf(0.5 + 0.5 * estimate.confidence))
    rows: list[KnownRow] = []
    for spring in with_known_gears(robot, gears).springs:
        if not is_known(spring, gears):
            continue
        gear, std = gears[spring.name], float(spring.stiffness_std or 0.0)
        rows.append(
            KnownRow(
                name=spring.name,
                unit="N/m" if robot.is_linear(spring) else "N m/rad",
                gear=(gear.stiffness, quantile * gear.stiffness_std),
                chain=(spring.stiffness, quantile * std),
                found=_found(estimate, f"{spring.name}.stiffness"),
                cubic=gear.cubic is not None,
                slip=gear.slip is not None,
            )
        )
    slipping = {name.removesuffix(_SLIP) for name in estimate.names if name.endswith(_SLIP)}
    return KnownGears(settings.springs_from, tuple(rows), frozenset(slipping))


_SLIP = ".hysteresis"


def _found(estimate: Estimate, name: str) -> tuple[float, float] | None:
    if name not in estimate.names:
        return None
    index = estimate.names.index(name)
    half = 0.5 * np.log(estimate.upper[index] / estimate.lower[index])
    return float(estimate.middle[index]), float(half)


def known_section(known: KnownGears) -> tuple[Section, ...]:
    """Lays out which springs were known beforehand, and what the fit makes of them; nothing without any."""
    if not known.rows:
        return ()
    lead = (
        f"Fit {known.fit} found these gears from encoders on both of their sides. That is the gear alone: what is known"
        " of the gear with what lies in line with it is softer by `chain_compliance`, and less sure. The nominal values"
        " of these springs are those, in place of the robot file's."
    )
    table = Table(
        ("Transmission", f"Gear by {known.fit}", "±", "With what lies in line", "±", "This fit", "±", "Unit"),
        tuple(
            (
                row.name,
                *_written(row.scale, row.gear),
                *_written(row.scale, row.chain),
                *(("fixed", "") if row.found is None else _written(row.scale, row.found)),
                row.scale.unit,
            )
            for row in known.rows
        ),
        caption=_caption(known),
        styles=("name", *("number",) * 4, "strong", "number", "text"),
    )
    return (Section("Known beforehand", lead, (table,), "known-gears"),)


def _written(scale: Scale, value: tuple[float, float]) -> tuple[str, str]:
    return scale.text(value[0]), percent(value[1])


def _caption(known: KnownGears) -> str:
    cubic = [row.name for row in known.rows if row.cubic]
    told = f" The cubic coefficient of {', '.join(cubic)} was known from there too." if cubic else ""
    slips = [row.name for row in known.rows if row.slip]
    taken = ", ".join(name for name in slips if name in known.slipping)
    left = ", ".join(name for name in slips if name not in known.slipping)
    told += f" So was the torque at which the hysteresis of {taken} slips." if taken else ""
    told += (
        f" The hysteresis of {left} is not estimated: name `hysteresis` in `free` to use what is known." if left else ""
    )
    return f"± is half the interval relative to the value.{told}"
