"""The position-dependent fit of responses in memory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from robid.arrays import IntArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.frf.quality import saturated_signals
from robid.models.lpv.fit.channels import channel_indices, local_responses
from robid.models.lpv.fit.fitting import fit_lpv
from robid.models.lpv.fit.options import BasisOptions, LpvOptions
from robid.models.lpv.fit.responses import LocalResponses
from robid.models.lpv.fit.solution import Ports
from robid.models.lpv.judge import assess_lpv, validate_lpv
from robid.results.finding import saturation_findings
from robid.results.fitted import Fitted
from robid.results.options import options_from
from robid.signals.quantities import channel_names

_CONFIDENCE, _IDENTIFIABLE = 0.95, 0.2


def fit_values(
    responses: Frf,
    *,
    choose_on: Sequence[int],
    scheduling: Sequence[int] | None = None,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    basis: BasisOptions | Mapping[str, Any] | None = None,
    validate_on: Frf | None = None,
    **options: Any,  # noqa: ANN401
) -> Fitted:
    """Fits one sparse state-space model to responses at several positions of the robot.

    Args:
        responses: Responses with covariance, one position a configuration.
        choose_on: Rows, from 0, of the positions that only choose the structure.
        scheduling: Columns of the configurations that the model depends on; those that change when not given.
        inputs: Names of the model's inputs; all when empty.
        outputs: Names of its outputs; all when empty.
        basis: Functions of the scheduling parameters; polynomials up to degree four when not given.
        validate_on: Responses at positions that the fit does not see, within the range of the others.
        options: Fields of `LpvOptions`, as `order`.

    Raises:
        DataError: If the responses cannot be used, or leave none to fit or to choose on.

    Source:
        Turk et al. (2018); docs/methods, position-dependent fits.
    """
    chosen, rows = options_from(LpvOptions, options, "fit_model(lpv)"), np.arange(len(responses.response))
    if not isinstance(basis, BasisOptions):
        basis = options_from(BasisOptions, basis or {}, "fit_model(lpv), basis")
    held_back = np.isin(rows, np.asarray(choose_on))
    if held_back.all() or not held_back.any():
        what = "D292 `choose_on` leaves no position to fit, or names none"
        raise DataError(what, where="fit_model(lpv)", remedy=f"name some of the rows 0 to {len(rows) - 1}")
    seen = _Seen(inputs, outputs, _columns(responses, scheduling))
    own, choosing = (seen.local(responses.select(rows[some].tolist())) for some in (~held_back, held_back))
    solution = fit_lpv(
        own,
        choosing,
        seen.ports(responses),
        basis,
        chosen,
        degrees_of_freedom=responses.degrees_of_freedom,
        confidence=_CONFIDENCE,
        identifiable_relative_std=_IDENTIFIABLE,
    )
    saturated = saturated_signals(responses, *(at.tolist() for at in seen.channels(responses)))
    alone = assess_lpv(solution, saturation_findings(saturated))
    if validate_on is None:
        return Fitted("lpv", solution.estimate, solution, alone)
    new, degrees = seen.local(validate_on), validate_on.degrees_of_freedom
    held = validate_lpv(solution, seen.ports(validate_on), new, degrees, alone.findings)
    return Fitted("lpv", solution.estimate, solution, alone, held, held.outcome.grade)


def _columns(frf: Frf, scheduling: Sequence[int] | None) -> IntArray:
    if scheduling is not None:
        return np.asarray(scheduling, int)
    return np.flatnonzero(np.ptp(frf.configurations, axis=0) > 0)


@dataclass(frozen=True)
class _Seen:
    """What of a response the model is about."""

    inputs: Sequence[str]  # Names of its inputs; all when empty
    outputs: Sequence[str]  # Names of its outputs; all when empty
    columns: IntArray  # (n_scheduling,) Columns of the configurations that schedule

    def channels(self, frf: Frf) -> tuple[IntArray, IntArray]:
        """Returns the indices of outputs and inputs in a response."""
        return channel_indices(frf, self.outputs, self.inputs, "fit_model(lpv)")

    def local(self, frf: Frf) -> LocalResponses:
        """Returns its elements at the positions of the response."""
        return local_responses(frf, frf.configurations[:, self.columns], *self.channels(frf))

    def ports(self, frf: Frf) -> Ports:
        """Returns what goes in, what comes out, and what schedules."""
        outputs, inputs = self.channels(frf)
        into, out = (
            [some[at] for at in rows] for some, rows in ((frf.input_channels, inputs), (frf.output_channels, outputs))
        )
        units = frf.joint_units or ("rad",) * frf.configurations.shape[1]
        return Ports(
            inputs=channel_names(into),
            input_units=tuple(one.unit for one in into),
            outputs=channel_names(out),
            output_units=tuple(one.unit for one in out),
            scheduling=tuple(f"joint {column + 1}" for column in self.columns.tolist()),
            scheduling_units=tuple(units[column] for column in self.columns.tolist()),
            sampling_period_s=frf.sampling_period_s,
        )
