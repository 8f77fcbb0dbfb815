"""Transfer functions from a response: blocks, their fits, and all of it as a solution."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.conclusions import Row, estimate_of_rows, root_rows
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.parameters import Root, gain_unit
from robid.models.external.of_responses.solution import (
    RationalQuality,
    RationalSolution,
    RationalTransfers,
    ResponsePorts,
    Shown,
    TriedRational,
)
from robid.models.external.response.data import MeasuredResponse
from robid.models.external.response.fitting import fit_response
from robid.models.external.response.options import ResponseFitOptions
from robid.models.external.response.result import RationalFit
from robid.models.external.response.uncertainty import gain_moves
from robid.robot.sampling import hold_factor

_LOUD = 0.3  # Deviation over the response from which on a line says nothing of a relative error


@dataclass(frozen=True)
class Block:
    """Channels with common poles: every output by every input."""

    name: str
    outputs: tuple[int, ...]
    inputs: tuple[int, ...]

    def channels(self) -> Iterator[tuple[int, int]]:
        """Outputs and inputs, inputs fastest."""
        return ((out, one) for out in self.outputs for one in self.inputs)


def blocks_of(frf: Frf, options: ExternalOptions) -> list[Block]:
    """The blocks that the options ask for.

    Raises:
        DataError: If a pair is not in the response, or no channel is.
    """
    outputs, inputs = frf.output_names, frf.input_names
    if options.matrix == "full":
        return [Block("matrix", tuple(range(len(outputs))), tuple(range(len(inputs))))]
    pairs = options.pairs or tuple((name, name) for name in inputs if name in outputs)
    if not pairs and len(outputs) == len(inputs) == 1:
        pairs = ((inputs[0], outputs[0]),)
    missing = [f"{out} per {one}" for one, out in pairs if one not in inputs or out not in outputs]
    if missing or not pairs:
        there = f"inputs {', '.join(inputs)}; outputs {', '.join(outputs)}"
        lacking = missing[0] if missing else "output with the name of an input"
        remedy = "name `pairs` of input and output, or `matrix: full`"
        raise DataError(f"D637 the response has no {lacking} ({there})", where="pairs", remedy=remedy)
    return [
        Block(one if one == out else f"{out} by {one}", (outputs.index(out),), (inputs.index(one),))
        for one, out in pairs
    ]


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
    shown = _shown(frf, blocks, fits, ports)
    rows = [
        _rows(block, fit, transfers, index, ports) for index, (block, fit) in enumerate(zip(blocks, fits, strict=True))
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
        quality=_quality(fits, shown),
        tried=tuple(each for block, fit in zip(blocks, fits, strict=True) for each in _tried(block, fit)),
        shown=shown,
        remarks=tuple(text for block, fit in zip(blocks, fits, strict=True) for text in _remarks(block, fit, asked)),
    )


def measured_of(frf: Frf, block: Block, period: float | None) -> MeasuredResponse:
    """The response of a block, unknown where a line tells too little of an input."""
    variance = frf.element_variance()[0]
    chosen = np.ix_(np.arange(frf.frequency_hz.size), np.array(block.outputs), np.array(block.inputs))
    known = np.isfinite(variance) & (variance > 0)
    return MeasuredResponse(
        frf.frequency_hz,
        frf.response[0][chosen],
        np.where(known, variance, np.inf)[chosen],
        period,
        "none" if period is None else "zoh",
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


def held(frequency_hz: FloatArray, ports: ResponsePorts) -> ComplexArray:
    """What a hold adds to the models (n_freq,); one where they have it, or there is none."""
    if ports.hold == "none":
        return np.ones(frequency_hz.size, complex)
    return hold_factor(2 * np.pi * frequency_hz, 0.0, ports.sampling_period_s)


def _shown(frf: Frf, blocks: Sequence[Block], fits: Sequence[RationalFit], ports: ResponsePorts) -> Shown:
    hold = held(frf.frequency_hz, ports)[:, None]
    found = [fit.response_at(frf.frequency_hz) for fit in fits]
    flat = [each.response.reshape(len(hold), -1) * hold for each in found]
    deviations = [np.hypot(each.real_std, each.imaginary_std).reshape(len(hold), -1) * np.abs(hold) for each in found]
    rows, columns = (np.array(side) for side in zip(*(at for block in blocks for at in block.channels()), strict=True))
    return Shown(
        frequency_hz=frf.frequency_hz,
        measured=frf.known_response[0][:, rows, columns],
        measured_std=np.sqrt(frf.element_variance()[0][:, rows, columns]),
        model=np.concatenate(flat, axis=1),
        model_std=np.concatenate(deviations, axis=1),
    )


def relative_errors(shown: Shown) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Relative errors (n_channel,), and what noise and parameters explain of them, over lines that noise leaves."""
    size = np.abs(shown.measured)
    with np.errstate(invalid="ignore", divide="ignore"):
        told = shown.known & (size > 0) & (shown.measured_std < _LOUD * size)
        told = np.where(told.any(axis=0), told, shown.known & (size > 0))
        parts = np.abs(shown.measured - shown.model), shown.measured_std, shown.model_std
        ratios = [np.where(told, part / size, np.nan) for part in parts]
    error, noise, parameters = (np.sqrt(np.nanmean(ratio**2, axis=0)) for ratio in ratios)
    return error, noise, parameters


def _quality(fits: Sequence[RationalFit], shown: Shown) -> RationalQuality:
    error, noise, _ = relative_errors(shown)
    return RationalQuality(
        cost=np.array([fit.cost for fit in fits]),
        degrees_of_freedom=np.array([fit.degrees_of_freedom for fit in fits]),
        misfit_chance=np.array([fit.misfit_chance for fit in fits]),
        widened=np.array([fit.widened for fit in fits]),
        relative_error=error,
        relative_noise=noise,
    )


def _tried(block: Block, fit: RationalFit) -> Iterator[TriedRational]:
    for index, one in enumerate(fit.tried):
        zeros = ", ".join(map(str, dict.fromkeys(one.zeros)))
        yield TriedRational(
            block.name, one.poles, zeros, one.integrators, one.delay_s, one.cost, one.score, chosen=index == 0
        )


def _rows(block: Block, fit: RationalFit, transfers: RationalTransfers, index: int, ports: ResponsePorts) -> list[Row]:
    """Poles, gains, zeros and the delay; each element has errors of its own beside those of the poles."""
    shared, alone = fit.spread.shared.shape[1], fit.spread.alone.shape
    size = shared + alone[0] * alone[1]

    def placed(moves: ComplexArray | FloatArray, element: int) -> ComplexArray | FloatArray:
        whole = np.zeros(size, moves.dtype)
        whole[: min(shared, moves.size)] = moves[:shared]
        begin = shared + element * alone[1]
        whole[begin : begin + moves.size - shared] = moves[shared:]
        return whole

    discrete, period = fit.time == "discrete", fit.sampling_period_s or 0.0
    rows = _root_rows(block.name, "pole", [(root, placed(root.moves, 0)) for root in fit.poles], discrete, period)
    channels = np.flatnonzero(transfers.block_of == index)
    for element, (channel, place) in enumerate(zip(channels.tolist(), np.ndindex(fit.gain.shape), strict=True)):
        name, gain = transfers.names[channel], float(fit.gain[place])
        unit = gain_unit(
            ports.output_units[transfers.outputs[channel]],
            ports.input_units[transfers.inputs[channel]],
            fit.integrators,
        )
        slope = gain_moves(fit.spread, element)[1]
        size_now = float(np.linalg.norm(slope))
        slope = slope * (float(fit.gain_std[place]) / size_now if size_now > 0 else 0.0)
        kind = "gain_per_second" if fit.integrators else "gain"
        rows.append(Row(f"{name}.{kind}", kind, unit, gain, abs(gain), np.asarray(placed(slope, element))))
        zeros = fit.zeros[place[0]][place[1]]
        rows += _root_rows(name, "zero", [(root, placed(root.moves, element)) for root in zeros], discrete, period)
    if fit.delay_std_s > 0:
        own = np.zeros(size)
        own[:shared] = fit.covariance_root[-1][:shared] if fit.covariance_root.shape[1] >= shared else 0.0
        scale = max(fit.delay_s, period, fit.delay_std_s)
        rows.append(Row(f"{block.name}.delay", "delay", "s", fit.delay_s, scale, own))
    return rows


def _root_rows(
    name: str, kind: str, roots: Sequence[tuple[Root, ComplexArray | FloatArray]], discrete: bool, period: float
) -> list[Row]:
    rows: list[Row] = []
    upper = [(root, moves) for root, moves in roots if root.place.imag >= 0]
    for number, (root, moves) in enumerate(upper, start=1):
        place, moved = root.place, np.asarray(moves, complex)
        if discrete:
            # z = exp(s T): ds = dz / (z T).
            moved, place = moved / (place * period), complex(np.log(place + 0j)) / period
        is_real = abs(place.imag) <= 1e-12 * abs(place)
        rows += root_rows(
            f"{name}.{kind}{number}", kind, complex(place.real, 0.0) if is_real else place, moved, is_real=is_real
        )
    return rows


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
