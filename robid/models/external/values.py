"""The external fit of records, or of a response, in memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.external.fit.data import commands_of, shots_of
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.records import homes_of, refuse_other_channels, refuse_other_ports
from robid.models.external.judge.plausible import assess_external
from robid.models.external.judge.validating import validate_external
from robid.models.external.of_responses.fitting import fit_rational
from robid.models.external.of_responses.judging import assess_rational, validate_rational
from robid.results.fitted import Fitted
from robid.results.options import options_from
from robid.signals.record import Record

_CALLED = "fit_model(external)"


def fit_values(
    data: Record | Sequence[Record] | Frf,
    *,
    choose_on: Record | None = None,
    validate_on: Record | Frf | None = None,
    **options: Any,  # noqa: ANN401
) -> Fitted:
    """Fits transfer functions from commands to measured motions, or to a measured response.

    Args:
        data: Records of the commands and motions, or the response of one configuration.
        choose_on: A record that only decides the orders; none with a response.
        validate_on: A record, or a response, that the fit does not see.
        options: Fields of `ExternalOptions`.

    Raises:
        DataError: If the data cannot be used, or not together.

    Source:
        Oliveira et al. (2019); docs/methods, external fits, and sec. 14 of responses.
    """
    chosen = options_from(ExternalOptions, options, _CALLED)
    if isinstance(data, Frf):
        return _of_response(data, choose_on, validate_on, chosen)
    return _of_records(data, choose_on, validate_on, chosen)


def _of_response(frf: Frf, choose_on: object, validate_on: Any, chosen: ExternalOptions) -> Fitted:  # noqa: ANN401
    if choose_on is not None:
        what = "D660 `choose_on` decides nothing of a response: its order is chosen by evidence"
        raise DataError(what, where=_CALLED, remedy="leave it out")
    solution = fit_rational(frf, chosen)
    alone = assess_rational(solution, chosen)
    if validate_on is None:
        return Fitted("external", solution.estimate, solution, alone)
    held = validate_rational(solution, validate_on, alone.findings)
    return Fitted("external", solution.estimate, solution, alone, held, held.outcome.grade)


def _of_records(
    records: Record | Sequence[Record],
    choose_on: Record | None,
    validate_on: Any,  # noqa: ANN401
    chosen: ExternalOptions,
) -> Fitted:
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
