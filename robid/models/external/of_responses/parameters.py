"""Parameters of transfer functions of a response: poles, gains, zeros and delays, with what moves them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.conclusions import Row, root_rows
from robid.models.external.fit.parameters import Root, gain_unit
from robid.models.external.of_responses.blocks import Block
from robid.models.external.of_responses.solution import RationalTransfers, ResponsePorts
from robid.models.external.response.result import RationalFit
from robid.models.external.response.uncertainty import gain_moves


def rows_of(
    block: Block, fit: RationalFit, transfers: RationalTransfers, index: int, ports: ResponsePorts
) -> list[Row]:
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
