"""Transfer functions from a response: the fits of its blocks, and all of it as a solution."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.linalg import block_diag

from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.conclusions import estimate_of_rows
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.of_responses.agreement import quality_of, shown_of
from robid.models.external.of_responses.blocks import Block, blocks_of, measured_of
from robid.models.external.of_responses.parameters import rows_of
from robid.models.external.of_responses.solution import (
    RationalSolution,
    RationalTransfers,
    ResponsePorts,
    TriedRational,
)
from robid.models.external.response.fitting import fit_response
from robid.models.external.response.options import ResponseFitOptions
from robid.models.external.response.result import RationalFit


def options_of(options: ExternalOptions, sampling_period_s: float | None) -> ResponseFitOptions:
    """The options of the algorithm."""
    delay: float | None = None
    if options.delay_samples is not None:
        discrete = options.time == "discrete"
        delay = float(options.delay_samples) * (1.0 if discrete else sampling_period_s or 0.0)
    longest = None if sampling_period_s is None else options.max_delay_samples * sampling_period_s
    return ResponseFitOptions(
        poles=options.poles,
        zeros=options.zeros,
        max_poles=options.max_poles,
        time=options.time,
        delay=delay,
        max_delay_s=longest,
        integrators=options.integrators,
        relative_degree=options.relative_degree,
        stable=options.stable,
        confidence=options.confidence,
    )


def fit_rational(frf: Frf, options: ExternalOptions) -> RationalSolution:
    """Fits transfer functions to the response of one configuration.

    Raises:
        DataError: If the response has several configurations, or too little for what is asked.
    """
    if len(frf.configurations) != 1:
        what = f"D638 transfer functions are of one configuration, and the fit reads {len(frf.configurations)}"
        raise DataError(what, where="configurations", remedy="name one under `configurations` of the fit")
    blocks, period = blocks_of(frf, options), frf.hold_period_s
    if options.time == "discrete" and period is None:
        what = "D639 a discrete model needs a response between samples"
        raise DataError(what, where="time", remedy="state `sampling_period_s` of the response, or use continuous time")
    asked = options_of(options, period)
    fits = [_fitted(frf, block, asked, period) for block in blocks]
    ports = ResponsePorts(
        inputs=frf.input_names,
        input_units=tuple(one.unit for one in frf.input_channels),
        outputs=frf.output_names,
        output_units=tuple(one.unit for one in frf.output_channels),
        sampling_period_s=period or 0.0,
        hold="none" if period is None or options.time == "discrete" else "zoh",
    )
    transfers = _transfers(blocks, fits, ports)
    shown = shown_of(frf, blocks, fits, ports)
    rows = [
        rows_of(block, fit, transfers, index, ports)
        for index, (block, fit) in enumerate(zip(blocks, fits, strict=True))
    ]
    estimate = estimate_of_rows(
        [row for each in rows for row in each],
        block_diag(*(np.array([row.moves for row in each]) @ np.array([row.moves for row in each]).T for each in rows)),
        "the response's deviation, widened by its misfit",
        "converged",
        "",
        confidence=options.confidence,
        identifiable_relative_std=options.identifiable_relative_std,
    )
    return RationalSolution(
        estimate=estimate,
        ports=ports,
        transfers=transfers,
        quality=quality_of(fits, shown),
        tried=tuple(each for block, fit in zip(blocks, fits, strict=True) for each in _tried(block, fit)),
        shown=shown,
        remarks=tuple(text for block, fit in zip(blocks, fits, strict=True) for text in _remarks(block, fit, asked)),
    )


def _fitted(frf: Frf, block: Block, asked: ResponseFitOptions, period: float | None) -> RationalFit:
    data = measured_of(frf, block, period)
    try:
        return fit_response(data, asked)
    except ValueError as error:
        told = str(error).rstrip(".")
        remedy = "ask for less, measure more lines, or leave channels out"
        raise DataError(f"D640 {block.name}: {told}", where="fit", remedy=remedy) from error


def _transfers(blocks: Sequence[Block], fits: Sequence[RationalFit], ports: ResponsePorts) -> RationalTransfers:
    places = [(index, *place) for index, block in enumerate(blocks) for place in block.channels()]
    numerators = [each for fit in fits for each in fit.numerator.reshape(-1, fit.numerator.shape[2])]
    size = max([len(fit.denominator) for fit in fits] + [len(each) for each in numerators])
    names = [
        blocks[index].name if len(blocks) > 1 or len(places) == 1 else f"{ports.outputs[out]} by {ports.inputs[one]}"
        for index, out, one in places
    ]
    block_of, outputs, inputs = np.array(places).T
    return RationalTransfers(
        time=fits[0].time,
        blocks=tuple(block.name for block in blocks),
        poles=np.array([fit.n_pole for fit in fits]),
        integrators=np.array([fit.integrators for fit in fits]),
        delay_s=np.array([fit.delay_s for fit in fits]),
        delay_std_s=np.array([fit.delay_std_s for fit in fits]),
        denominator=np.array([np.pad(fit.denominator, (size - len(fit.denominator), 0)) for fit in fits]),
        names=tuple(names),
        block_of=block_of,
        inputs=inputs,
        outputs=outputs,
        zeros=np.array([len(np.trim_zeros(each, "f")) - 1 for each in numerators]),
        numerator=np.array([np.pad(each, (size - len(each), 0)) for each in numerators]),
    )


def _tried(block: Block, fit: RationalFit) -> Iterator[TriedRational]:
    for index, one in enumerate(fit.tried):
        zeros = ", ".join(map(str, dict.fromkeys(one.zeros)))
        yield TriedRational(
            block.name, one.poles, zeros, one.integrators, one.delay_s, one.cost, one.score, chosen=index == 0
        )


def _remarks(block: Block, fit: RationalFit, asked: ResponseFitOptions) -> Iterator[str]:
    if fit.missing_zeros:
        least = asked.relative_degree - fit.missing_zeros
        yield (
            f"{block.name}: the response rises as improper functions do: `relative_degree: {least}` has more evidence"
            f" than {fit.missing_zeros} of the poles, which lie beyond all lines and stand for zeros."
        )
    if fit.integrators:
        count = "an integrator" if fit.integrators == 1 else f"{fit.integrators} integrators"
        yield f"{block.name}: the slowest poles are {count}; no line is low enough to tell them from zero."
    if fit.poles and fit.time == "continuous" and all(root.place.real > 0 for root in fit.poles):
        yield (
            f"{block.name}: all poles are in the right half plane, as a stable plant has them whose phase has the wrong"
            " sign."
        )
    elif not fit.is_stable:
        yield f"{block.name}: a pole is in the right half plane; a measured response does not tell whether that is so."
    if fit.widened > 1:
        told = f"{fit.cost / max(fit.degrees_of_freedom, 1):.3g} times what its deviations explain"
        yield f"{block.name}: the misfit is {told}; intervals are widened by {fit.widened:.3g}."
