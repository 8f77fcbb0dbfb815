"""The parameters of a fit as every family shows them: rows for page and terminal, numbers for the summary."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from robid.arrays import FloatArray
from robid.report.parameters import ParameterRow
from robid.results.estimate import Estimate
from robid.robot.parameters import PARAMETER_KINDS, name_of, owner_of


def with_torque_unit(unit: str, torque_unit: str) -> str:
    """Writes a unit with what stands for N m where the torque constant is unknown."""
    if torque_unit == "N m":
        return unit
    unit = {"kg": "N m s^2/m^2", "kg m": "N m s^2/m", "N/m": "N m/m^2", "N s/m": "N m s/m^2", "N/m^3": "N m/m^4"}.get(
        unit, unit
    )
    return unit.replace("kg m^2", "N m s^2/rad").replace("N m", torque_unit)


def parameter_rows(
    estimate: Estimate, truth: Mapping[str, float], assumed: Collection[str] = (), torque_unit: str = "N m"
) -> tuple[ParameterRow, ...]:
    """Turns estimated parameters into rows.

    Args:
        estimate: The parameters.
        truth: True value by name, where it is known.
        assumed: Dotted names of the robot file's values that no source gives.
        torque_unit: What stands for N m where the torque constant is unknown.
    """
    return tuple(_row(estimate, index, truth, assumed, torque_unit) for index in range(len(estimate.names)))


def parameter_summary(rows: Sequence[ParameterRow]) -> dict[str, float]:
    """Returns what is known of each parameter in numbers, by dotted name."""
    return {
        f"parameters.{name_of(row.name, row.kind)}.{key}": value for row in rows for key, value in _numbers(row).items()
    }


def _row(
    estimate: Estimate, index: int, truth: Mapping[str, float], assumed: Collection[str], torque_unit: str
) -> ParameterRow:
    name, kind, unit = estimate.names[index], estimate.kinds[index], estimate.units[index]
    owner, known = owner_of(name, kind), float(estimate.prior_relative_std[index])
    true, lower, upper = truth.get(name), float(estimate.lower[index]), float(estimate.upper[index])
    followers = zip(estimate.tied.names, estimate.tied.to, strict=True)
    shared = [owner_of(tied, kind) for tied, leader in followers if leader == name]
    return ParameterRow(
        name=owner,
        kind=kind,
        unit="" if unit == "1" else with_torque_unit(unit, torque_unit),
        nominal=float(estimate.nominal[index]),
        estimate=float(estimate.value[index]),
        lower=lower,
        upper=upper,
        relative_std=float(estimate.relative_std[index]),
        truth=true,
        identifiable=bool(estimate.identifiable[index]),
        identified=bool(estimate.identified[index]),
        predicted_relative_std=float(estimate.predicted_relative_std[index]),
        known_relative_std=known if np.isfinite(known) else None,
        covered=None if true is None else lower <= true <= upper,
        assumed=any(f"{owner}.{field}" in assumed for field in PARAMETER_KINDS[kind].fields),
        physical=_optional(estimate.physical_value, index),
        effective=_effective(estimate, index),
        note=f"shared by {', '.join(shared)}" if shared else "",
    )


def _optional(values: FloatArray | None, index: int) -> float | None:
    return None if values is None else float(values[index])


def _effective(estimate: Estimate, index: int) -> tuple[float, float, float] | None:
    value, lower, upper = estimate.effective_value, estimate.effective_lower, estimate.effective_upper
    if value is None or lower is None or upper is None:
        return None
    return float(value[index]), float(lower[index]), float(upper[index])


def _numbers(row: ParameterRow) -> dict[str, float]:
    values = {
        "nominal": row.nominal,
        "estimate": row.estimate,
        "lower": row.lower,
        "upper": row.upper,
        "relative_std": row.relative_std,
        "identifiable": float(row.identifiable),
    }
    if row.physical is not None:
        values["physical_value"] = row.physical
    if row.effective is not None:
        values |= dict(zip(("effective_value", "effective_lower", "effective_upper"), row.effective, strict=True))
    if row.realization_relative_std is not None:
        values["realization_relative_std"] = row.realization_relative_std
    if row.bootstrap is not None:
        values |= {"bootstrap_lower": row.bootstrap[0], "bootstrap_upper": row.bootstrap[1]}
    if row.truth is not None:
        values["truth"] = row.truth
    if row.covered is not None:
        values["covered"] = float(row.covered)
    return values
