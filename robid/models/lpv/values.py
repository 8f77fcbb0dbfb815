"""The position-dependent fit of responses in memory."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from robid.arrays import FloatArray, IntArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.quality import saturated_signals
from robid.models.lpv.fit.fitting import fit_lpv
from robid.models.lpv.fit.options import BasisOptions, LpvOptions
from robid.models.lpv.fit.responses import LocalResponses, local_responses
from robid.models.lpv.fit.solution import Ports
from robid.models.lpv.judge import assess_lpv, validate_lpv
from robid.results.finding import saturation_findings
from robid.results.fitted import Fitted, options_from
from robid.signals.quantities import channel_names

_CONFIDENCE, _IDENTIFIABLE = 0.95, 0.2


def fit_values(
    responses: Frf,
    *,
    choose_on: Sequence[int],
    scheduling: Sequence[int] | None = None,
    basis: BasisOptions | None = None,
    validate_on: Frf | None = None,
    **options: Any,  # noqa: ANN401
) -> Fitted:
    """Fits one sparse state-space model to responses at several positions of the robot.

    Args:
        responses: Responses with covariance, one position a configuration.
        choose_on: Rows, from 0, of the positions that only choose the structure.
        scheduling: Columns of the configurations that the model depends on; those that change when not given.
        basis: Functions of the scheduling parameters; polynomials up to degree four when not given.
        validate_on: Responses at positions that the fit does not see, within the range of the others.
        options: Fields of `LpvOptions`, as `order`.

    Raises:
        DataError: If the responses cannot be used, or leave none to fit or to choose on.

    Source:
        Turk et al. (2018); docs/methods, position-dependent fits.
    """
    chosen, rows = options_from(LpvOptions, options, "fit_model(lpv)"), np.arange(len(responses.response))
    held_back = np.isin(rows, np.asarray(choose_on))
    if held_back.all() or not held_back.any():
        what = "D292 `choose_on` leaves no position to fit, or names none"
        raise DataError(what, where="fit_model(lpv)", remedy=f"name some of the rows 0 to {len(rows) - 1}")
    columns = _columns(responses, scheduling)
    ports, degrees = _ports(responses, columns), responses.degrees_of_freedom
    own, choosing = (_local(responses.select(rows[some].tolist()), columns) for some in (~held_back, held_back))
    solution = fit_lpv(
        own,
        choosing,
        ports,
        BasisOptions() if basis is None else basis,
        chosen,
        degrees_of_freedom=degrees,
        confidence=_CONFIDENCE,
        identifiable_relative_std=_IDENTIFIABLE,
    )
    outputs, inputs = (list(range(size)) for size in responses.response.shape[2:])
    alone = assess_lpv(solution, saturation_findings(saturated_signals(responses, inputs, outputs)))
    if validate_on is None:
        return Fitted("lpv", solution.estimate, solution, alone)
    new, found = _local(validate_on, columns), _ports(validate_on, columns)
    held = validate_lpv(solution, found, new, validate_on.degrees_of_freedom, alone.findings)
    return Fitted("lpv", solution.estimate, solution, alone, held, held.outcome.grade)


def _columns(frf: Frf, scheduling: Sequence[int] | None) -> IntArray:
    if scheduling is not None:
        return np.asarray(scheduling, int)
    return np.flatnonzero(np.ptp(frf.configurations, axis=0) > 0)


def _local(frf: Frf, columns: IntArray) -> LocalResponses:
    points: FloatArray = frf.configurations[:, columns]
    outputs, inputs = (np.arange(size) for size in frf.response.shape[2:])
    return local_responses(frf, points, outputs, inputs)


def _ports(frf: Frf, columns: IntArray) -> Ports:
    inputs, outputs = frf.input_channels, frf.output_channels
    units = frf.joint_units or ("rad",) * frf.configurations.shape[1]
    return Ports(
        inputs=channel_names(inputs),
        input_units=tuple(one.unit for one in inputs),
        outputs=channel_names(outputs),
        output_units=tuple(one.unit for one in outputs),
        scheduling=tuple(f"joint {column + 1}" for column in columns.tolist()),
        scheduling_units=tuple(units[column] for column in columns.tolist()),
        sampling_period_s=frf.sampling_period_s,
    )
