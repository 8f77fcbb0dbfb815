"""The external fit: shots in, transfer functions with all that is known of them out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.models.conclusions import Row
from robid.models.external.fit.checks import (
    Block,
    ChannelFinding,
    blocks_of,
    is_own,
    mixed_findings,
    shots_for,
    signal_findings,
    unsteady_findings,
    usable_blocks,
)
from robid.models.external.fit.choice import choose_structure
from robid.models.external.fit.coupling import Pairs, map_coupling
from robid.models.external.fit.data import Shot, refuse_unlike
from robid.models.external.fit.etfe import estimate_etfe, floors
from robid.models.external.fit.options import CouplingOptions, ExternalOptions
from robid.models.external.fit.output_error import BlockFit, fit_block
from robid.models.external.fit.parameters import block_parameters, integrators_of
from robid.models.external.fit.recordings import pool_recordings
from robid.models.external.fit.result import FittedBlock, channel_texts, make_solution
from robid.models.external.fit.solution import ExternalSolution, Ports
from robid.models.external.fit.transfer import Hold, TransferMatrix
from robid.signals.quantities import Channel, channel_names

_NO_BETTER = 0.1  # of the criterion, of which 10 are strong evidence


def fit_external(
    shots: Sequence[Shot],
    inputs: Sequence[Channel],
    outputs: Sequence[Channel],
    hold: str,
    options: ExternalOptions,
    choose_on: Sequence[Shot] = (),
) -> ExternalSolution:
    """Fits transfer functions from commands to outputs; shots to choose on only decide the order.

    Raises:
        DataError: If a channel cannot be fitted, or the records are not alike.
    """
    refuse_unlike([*shots, *choose_on])
    ports = ports_of(shots, inputs, outputs, hold, options.coupling)
    blocks = blocks_of(inputs, outputs, options)
    kept, findings = usable_blocks(blocks, shots, ports.floor, ports.outputs, options)
    etfe = estimate_etfe(shots, ports.floor, options.confidence)
    pairs = Pairs(
        ports.inputs, ports.outputs, ports.input_resolution, ports.output_resolution, own_pairs(blocks, ports)
    )
    coupling = map_coupling(shots, ports.floor, etfe, pairs, options.coupling)
    fitted = [_fitted(block, shots, ports, options, choose_on) for block in kept]
    told: list[ChannelFinding] = [*findings]
    for one in fitted:
        told += signal_findings(one.block, one.shots, ports.outputs)
        told += unsteady_findings(one.block, one.shots, ports.outputs)
        told += mixed_findings(one.block, one.shots, ports.floor, etfe)
    return make_solution(fitted, ports, options, etfe, coupling, told)


def ports_of(
    shots: Sequence[Shot], inputs: Sequence[Channel], outputs: Sequence[Channel], hold: str, options: CouplingOptions
) -> Ports:
    """Describes the commands and outputs of shots."""
    resolution = resolutions(inputs, options)
    return Ports(
        inputs=channel_names(inputs),
        input_units=tuple(channel.unit for channel in inputs),
        outputs=channel_names(outputs),
        output_units=tuple(channel.unit for channel in outputs),
        input_resolution=resolution,
        output_resolution=resolutions(outputs, options),
        floor=floors(shots, resolution),
        sampling_period_s=shots[0].sampling_period_s,
        hold=hold,
    )


def resolutions(channels: Sequence[Channel], options: CouplingOptions) -> FloatArray:
    """Returns the resolution (n_channel,) of each channel, that of a rotation for what turns, in its unit."""
    turning = [channel.unit.startswith("rad") for channel in channels]
    return np.where(turning, options.resolution_rad, options.resolution_m)


def own_pairs(blocks: Sequence[Block], ports: Ports) -> BoolArray:
    """Tells which pairs (n_out, n_in) are one channel and no coupling.

    They are single channels that are fitted, and those of one name; a command that no output has the name of goes with
    all that is fitted to it.
    """
    own = np.array([[is_own(one, other) for one in ports.inputs] for other in ports.outputs], bool)
    for block in blocks:
        if block.is_single:
            own[block.outputs[0], block.inputs[0]] = True
        for one in block.inputs:
            if not any(is_own(ports.inputs[one], other) for other in ports.outputs):
                own[list(block.outputs), one] = True
    return own


def _fitted(
    block: Block, shots: Sequence[Shot], ports: Ports, options: ExternalOptions, choose_on: Sequence[Shot]
) -> FittedBlock:
    used = shots_for(block, shots, ports.floor)
    held_back = shots_for(block, choose_on, ports.floor)
    hold: Hold = "zoh" if ports.hold == "zoh" else "foh"
    choice = choose_structure(used, block.inputs, block.outputs, options, held_back, hold=hold)
    names = tuple(ports.inputs[index] for index in block.inputs), tuple(ports.outputs[index] for index in block.outputs)
    fit = fit_block(used, block.inputs, block.outputs, choice.structure, choice.best.model, names=names)
    if fit.status == "stalled":
        again = fit_block(used, block.inputs, block.outputs, choice.structure, fit.model, names=names)
        fit = settled(fit, again)
    longest_s = max(len(shot.outputs) * shot.sampling_period_s for shot in used)
    integrators = integrators_of(fit.model, fit.covariance_root, longest_s, options.confidence)
    texts, every = channel_texts(block, ports, integrators), np.eye(len(fit.parameters))

    def parameters_of(model: TransferMatrix) -> list[Row]:
        return block_parameters(block.name, *texts, model, every, integrators)

    fit, recordings = pool_recordings(used, block.inputs, block.outputs, fit, parameters_of)
    # What differs between recordings moves all that follows from the coefficients, responses and predictions too.
    root = np.concatenate([recordings.noise_root, recordings.root], axis=1)
    return FittedBlock(block, used, choice, replace(fit, covariance_root=root), integrators, recordings)


def settled(fit: BlockFit, again: BlockFit) -> BlockFit:
    """Judges a fit that stalled by one that began where it ended.

    A pole that samples hardly tell, or one at its limit, stalls the search in the best place that there is: that has
    converged as far as data can tell.
    """
    better = again if again.bic < fit.bic else fit
    return replace(better, status="converged") if fit.bic - better.bic < _NO_BETTER else better
