"""Puts together what an external fit found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robid.arrays import FloatArray
from robid.models.conclusions import Row
from robid.models.external.fit.checks import Block, ChannelFinding, is_own, pair_name
from robid.models.external.fit.choice import Choice
from robid.models.external.fit.coupling import CouplingMap
from robid.models.external.fit.data import Agreement, Shot, agreements
from robid.models.external.fit.etfe import Etfe, Excitation, OwnChannel, show_excitation
from robid.models.external.fit.graphs import Fitted, frequency_responses, root_loci, step_responses
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.output_error import BlockFit
from robid.models.external.fit.parameters import (
    Findings,
    Integrators,
    block_parameters,
    estimate_of,
    find_findings,
    gain_unit,
)
from robid.models.external.fit.recordings import Recordings, width_rule
from robid.models.external.fit.solution import ExternalSolution, FitQuality, Ports, Traces, Transfers, Tried
from robid.results.estimate import Estimate

_REMEDIES = {
    "iteration_limit": "fix the number of poles, or excite a wider band",
    "stalled": "ask for fewer poles: the data do not determine all of them",
}


@dataclass(frozen=True)
class FittedBlock:
    """A block with what it was fitted to and what came of it."""

    block: Block
    shots: tuple[Shot, ...]
    choice: Choice
    fit: BlockFit  # the covariance of its coefficients holds what differs between recordings
    integrators: Integrators
    recordings: Recordings

    @property
    def measured(self) -> list[FloatArray]:
        """Outputs (n_sample, n_out) of each shot, less their mean where an offset was estimated along."""
        found = [shot.outputs[:, list(self.block.outputs)] for shot in self.shots]
        return [each - each.mean(axis=0) if shot.offset else each for shot, each in zip(self.shots, found, strict=True)]

    @property
    def fitted(self) -> Fitted:
        """The model with its uncertainty."""
        return Fitted(self.fit.model, self.fit.covariance_root, self.integrators.count)


def make_solution(
    found: Sequence[FittedBlock],
    ports: Ports,
    options: ExternalOptions,
    etfe: Etfe,
    coupling: CouplingMap,
    findings: Sequence[ChannelFinding],
) -> ExternalSolution:
    """Puts together what an external fit found."""
    transfers = _transfers(found, ports, options)
    every = [
        agreements(
            _output_names(one.block, ports),
            one.shots,
            one.block.outputs,
            one.measured,
            one.fit.residuals,
            one.block.inputs,
        )
        for one in found
    ]
    quality = _quality(found, ports, etfe, every)
    parameters = [
        block_parameters(
            one.block.name,
            *channel_texts(one.block, ports, one.integrators),
            one.fit.model,
            one.fit.covariance_root,
            one.integrators,
        )
        for one in found
    ]
    told = [_findings(one, options) for one in found]
    fitted = [one.fitted for one in found]
    # What tells something of any block; one line alone has no band.
    lowest_hz = float(np.nanmin(np.append(quality.lowest_hz, 0.01 / ports.sampling_period_s)))
    return ExternalSolution(
        estimate=_estimate(found, parameters, told, options),
        ports=ports,
        transfers=transfers,
        quality=quality,
        agreements=tuple(each for own in every for each in own),
        tried=_tried(found),
        etfe=etfe,
        coupling=coupling,
        responses=frequency_responses(fitted, lowest_hz),
        steps=step_responses(fitted),
        loci=root_loci(fitted),
        traces=_traces(found),
        findings=tuple(findings),
        remarks=tuple(text for each in zip(found, told, parameters, strict=True) for text in _remarks(*each)),
        excitation=_excitation(found, transfers, ports),
        between_std=np.concatenate([one.recordings.between_std for one in found]),
        recordings=np.array([len(one.recordings.names) for one in found]),
    )


def _estimate(
    found: Sequence[FittedBlock],
    parameters: Sequence[Sequence[Row]],
    told: Sequence[Sequence[Findings]],
    options: ExternalOptions,
) -> Estimate:
    ended = [one.fit.status for one in found]
    status = next((status for status in ("stalled", "iteration_limit") if status in ended), "converged")
    undetermined = [
        f"{one.block.name}: {sentence}"
        for one, those in zip(found, told, strict=True)
        for sentence in dict.fromkeys(text for each in those for text in (*each.undetermined, *each.cancelling))
    ]
    freedom = [one.recordings.freedom(rows) for one, rows in zip(found, parameters, strict=True)]
    return estimate_of(
        parameters,
        options,
        undetermined,
        status,
        _REMEDIES.get(status, ""),
        rule=width_rule([one.recordings for one in found]),
        degrees_of_freedom=np.concatenate(freedom),
    )


def channel_texts(block: Block, ports: Ports, integrators: Integrators) -> tuple[list[str], list[str]]:
    """Returns names and units of gain of a block's channels, output by output."""
    pairs = [(output, command) for output in block.outputs for command in block.inputs]
    # A single channel has its block's name, those of a matrix that of output and command.
    names = [block.name if block.is_single else pair_name(ports.inputs[one], ports.outputs[out]) for out, one in pairs]
    units = [gain_unit(ports.output_units[out], ports.input_units[one], integrators.count) for out, one in pairs]
    return names, units


def _excitation(found: Sequence[FittedBlock], transfers: Transfers, ports: Ports) -> Excitation:
    """What each command did, in all shots, with the output of its name, or else its first."""
    shots = list({shot.name: shot for one in found for shot in one.shots}.values())
    channels = {}
    for channel in range(len(transfers.names)):
        command, output = int(transfers.inputs[channel]), int(transfers.outputs[channel])
        if command not in channels or is_own(ports.inputs[command], ports.outputs[output]):
            channels[command] = OwnChannel(transfers.names[channel], command, output)
    resolutions = ports.input_resolution, ports.output_resolution
    return show_excitation(shots, list(channels.values()), ports.floor, *resolutions)


def _transfers(found: Sequence[FittedBlock], ports: Ports, options: ExternalOptions) -> Transfers:
    places = [
        (index, output, command)
        for index, one in enumerate(found)
        for output in one.block.outputs
        for command in one.block.inputs
    ]
    names = [name for one in found for name in channel_texts(one.block, ports, one.integrators)[0]]
    models = [one.fit.model for one in found]
    n_power = max(len(model.denominator) for model in models)
    numerators = [each for model in models for each in model.numerator.reshape(-1, model.numerator.shape[2])]
    roots = [one.fit.covariance_root for one in found]
    shape = [max(sizes) for sizes in zip(*(root.shape for root in roots), strict=True)]
    block_of, outputs, inputs = np.array(places).T
    return Transfers(
        blocks=tuple(one.block.name for one in found),
        poles=np.array([len(model.denominator) - 1 for model in models]),
        zeros=np.array([model.numerator.shape[2] - 1 for model in models]),
        delay_samples=np.array([model.delay_samples for model in models]),
        delay_estimated=np.full(len(found), options.delay_samples is None),
        moving_average=options.moving_average,
        denominator=np.array([np.pad(one.denominator, (n_power - len(one.denominator), 0)) for one in models]),
        covariance_root=np.array(
            [np.pad(root, [(0, n - own) for n, own in zip(shape, root.shape, strict=True)]) for root in roots]
        ),
        names=tuple(names),
        block_of=block_of,
        inputs=inputs,
        outputs=outputs,
        numerator=np.array([np.pad(each, (n_power - len(each), 0)) for each in numerators]),
    )


def _quality(
    found: Sequence[FittedBlock], ports: Ports, etfe: Etfe, every: Sequence[Sequence[Agreement]]
) -> FitQuality:
    # Frequencies at which a command of a block was excited.
    known = (np.isfinite(etfe.radius[:, :, list(one.block.inputs)]).any(axis=(1, 2)) for one in found)
    bands = [etfe.frequency_hz[own][[0, -1]] if own.any() else np.full(2, np.nan) for own in known]
    names = [_output_names(one.block, ports) for one in found]
    worst = [
        min(each.nrmse for each in own if each.output == name)
        for own, those in zip(every, names, strict=True)
        for name in those
    ]
    return FitQuality(
        status=tuple(one.fit.status for one in found),
        reason=tuple(one.choice.reason for one in found),
        fpe=np.array([_final_prediction_error(one) for one in found]),
        whiteness_p=np.array([float(one.fit.whiteness.min()) for one in found]),
        n_sample=np.array([sum(len(shot.outputs) for shot in one.shots) for one in found]),
        n_parameter=np.array([one.fit.n_free for one in found]),
        lowest_hz=np.array([band[0] for band in bands]),
        highest_hz=np.array([band[1] for band in bands]),
        output_names=tuple(name for those in names for name in those),
        first_output=np.cumsum([0, *(len(those) for those in names)])[:-1],
        nrmse=np.array(worst),
    )


def _output_names(block: Block, ports: Ports) -> list[str]:
    return [block.name] if block.is_single else [ports.outputs[index] for index in block.outputs]


def _final_prediction_error(one: FittedBlock) -> float:
    """Akaike's final prediction error: determinant of the residuals' covariance, outputs scaled to their size.

    Source:
        Oliveira et al. (2019), Table 2.
    """
    measured, left = np.concatenate(one.measured), np.concatenate(one.fit.residuals)
    scaled = left / np.maximum(measured.std(axis=0), np.finfo(float).tiny)
    ratio = one.fit.n_free / len(left)
    return float(np.linalg.det(scaled.T @ scaled / len(left)) * (1 + ratio) / max(1 - ratio, 1e-3))


def _tried(found: Sequence[FittedBlock]) -> tuple[Tried, ...]:
    return tuple(
        Tried(
            block=one.block.name,
            poles=each.structure.poles,
            zeros=each.structure.zeros,
            delay_samples=each.structure.delay_samples,
            bic=each.bic,
            nrmse=each.nrmse,
            whiteness_p=each.whiteness,
            chosen=each.structure == one.fit.structure,
        )
        for one in found
        for each in one.choice.tried
    )


def _traces(found: Sequence[FittedBlock]) -> Traces:
    """Measured and simulated outputs of all shots, block by block."""
    names = list(dict.fromkeys(shot.name for one in found for shot in one.shots))
    rows, first = [], 0
    for one in found:
        for shot, measured, left in zip(one.shots, one.measured, one.fit.residuals, strict=True):
            time_s = np.arange(len(measured)) * shot.sampling_period_s
            for place in range(measured.shape[1]):
                labels = np.full((2, len(measured)), [[first + place], [names.index(shot.name)]])
                rows.append((*labels, time_s, measured[:, place], measured[:, place] - left[:, place]))
        first += len(one.block.outputs)
    output, shots, time, measured, simulated = (np.concatenate(each) for each in zip(*rows, strict=True))
    return Traces(output.astype(int), shots.astype(int), tuple(names), time, measured, simulated)


def _remarks(one: FittedBlock, found: Sequence[Findings], rows: Sequence[Row]) -> list[str]:
    told = [
        sentence
        for each in found
        for sentence, sure in zip(each.non_minimum_phase, each.significant, strict=True)
        if sure
    ]
    if one.fit.reflected:
        told.append("poles in the right half plane were met on the way and kept in the left one (`stable`)")
    told += [one.integrators.sentence] if one.integrators.count else []
    told += [one.recordings.sentence([row.name for row in rows])]
    return [f"{one.block.name}: {sentence}" for sentence in dict.fromkeys([*told, *one.choice.messages])]


def _findings(one: FittedBlock, options: ExternalOptions) -> list[Findings]:
    return [
        find_findings(
            one.fit.model,
            one.fit.covariance_root,
            *place,
            confidence=options.confidence,
            largest_relative_std=options.identifiable_relative_std,
            integrators=one.integrators.count,
        )
        for place in np.ndindex(one.fit.model.numerator.shape[:2])
    ]
