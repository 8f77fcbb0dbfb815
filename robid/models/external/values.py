"""The external fit of records in memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from robid.models.external.fit.data import commands_of, shots_of
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.records import homes_of, refuse_other_channels, refuse_other_ports
from robid.models.external.judge.plausible import assess_external
from robid.models.external.judge.validating import validate_external
from robid.results.fitted import Fitted
from robid.results.options import options_from
from robid.signals.record import Record


def fit_values(
    records: Record | Sequence[Record],
    *,
    choose_on: Record | None = None,
    validate_on: Record | None = None,
    **options: Any,  # noqa: ANN401
) -> Fitted:
    """Fits transfer functions from commands to measured motions.

    Args:
        records: Records of the commands and motions.
        choose_on: A record that only decides the orders.
        validate_on: A record that the fit does not see.
        options: Fields of `ExternalOptions`.

    Raises:
        DataError: If the records cannot be used, or not together.

    Source:
        Oliveira et al. (2019); docs/methods, external fits.
    """
    chosen = options_from(ExternalOptions, options, "fit_model(external)")
    own = (records,) if isinstance(records, Record) else tuple(records)
    every = own if choose_on is None else (*own, choose_on)
    names = [f"record {number}" for number in range(1, len(every) + 1)]
    refuse_other_channels(every, names, chosen)
    shots = [shots_of(record, chosen, name) for record, name in zip(every, names, strict=True)]
    fitted = [shot for group in shots[: len(own)] for shot in group]
    held_back = [shot for group in shots[len(own) :] for shot in group]
    told = commands_of(own[0], chosen)
    solution = fit_external(fitted, told.channels, own[0].output_channels, told.hold, chosen, held_back)
    solution = replace(solution, homes=homes_of(own))
    alone = assess_external(solution, chosen)
    if validate_on is None:
        return Fitted("external", solution.estimate, solution, alone)
    refuse_other_ports(solution.ports, validate_on, chosen)
    held = validate_external(solution, shots_of(validate_on, chosen, "validate_on"), alone.findings)
    return Fitted("external", solution.estimate, solution, alone, held, held.outcome.grade)
