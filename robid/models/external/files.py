"""How transfer functions lie in their files, what they are written as, and reading them for python-control."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.errors import ArtifactError, SettingsError
from robid.models.encode import (
    Content,
    Files,
    encode_csv,
    encode_json,
    encode_mat,
    origin_of,
    parameter_arrays,
    parameter_records,
)
from robid.models.external.fit.solution import ExternalSolution
from robid.models.external.judge.validating import ExternalValidation
from robid.models.family import ExportTask

if TYPE_CHECKING:
    import control

FILES = Files("external", ExternalSolution, ExternalValidation)
model_of, solution_from_artifact = FILES.model_of, FILES.solution_of
validation_of, validation_from_artifact = FILES.validation_of, FILES.validated_in

_COLUMNS = ("name", "kind", "unit", "estimate", "lower", "upper", "relative_std", "identifiable")
_POWERS = ("channel", "input", "output", "polynomial", "power", "value", "std")
_TIMING = ("delay_samples", "sampling_period_s", "hold", "moving_average_samples")


def write_json(task: ExportTask) -> bytes:
    """Writes transfer functions, parameters and covariances as JSON."""
    solution = solution_from_artifact(task.model)
    ports, found = solution.ports, solution.estimate
    content: Content = {
        **origin_of(task, solution.estimate.status),
        "sampling_period_s": ports.sampling_period_s,
        "hold": ports.hold,
        "moving_average_samples": solution.transfers.moving_average,
        "polynomials": "in s [rad/s], highest power first; the delay and the moving average come on top",
        "blocks": [_block(solution, block) for block in range(len(solution.transfers.blocks))],
        "confidence": found.confidence,
        "parameters": parameter_records(found, _COLUMNS),
        "undetermined": list(found.undetermined),
        "decoupled_up_to_hz": solution.coupling.overall_hz,
    }
    return encode_json(content)


def _block(solution: ExternalSolution, block: int) -> Content:
    own, model = solution.transfers, solution.transfer(block)
    root = own.root_of(block)
    return {
        "name": own.blocks[block],
        "delay_samples": model.delay_samples,
        "delay_s": model.delay_samples * model.sampling_period_s,
        "denominator": model.denominator.tolist(),
        "channels": [
            {
                "name": own.names[channel],
                "input": solution.ports.inputs[own.inputs[channel]],
                "input_unit": solution.ports.input_units[own.inputs[channel]],
                "output": solution.ports.outputs[own.outputs[channel]],
                "output_unit": solution.ports.output_units[own.outputs[channel]],
                "numerator": numerator.tolist(),
            }
            for channel, numerator in zip(own.channels_of(block).tolist(), _numerators(solution, block), strict=True)
        ],
        "covariance_of": "numerators channel by channel, then the denominator without its first",
        "covariance": (root @ root.T).tolist(),
    }


def _numerators(solution: ExternalSolution, block: int) -> FloatArray:
    model = solution.transfer(block)
    return np.asarray(model.numerator.reshape(-1, model.numerator.shape[2]))


def _channels(solution: ExternalSolution) -> Iterator[tuple[int, FloatArray, FloatArray]]:
    """Yields index, numerator and denominator of each channel, block by block."""
    own = solution.transfers
    for block in range(len(own.blocks)):
        denominator = solution.transfer(block).denominator
        for channel, numerator in zip(own.channels_of(block).tolist(), _numerators(solution, block), strict=True):
            yield channel, numerator, denominator


def write_csv(task: ExportTask) -> bytes:
    """Writes a row for each coefficient of each channel."""
    solution, rows = solution_from_artifact(task.model), list[tuple[object, ...]]()
    own, ports = solution.transfers, solution.ports
    for block in range(len(own.blocks)):
        numerators, denominator = _numerators(solution, block), solution.transfer(block).denominator
        above, below = _deviations(solution, block)
        timing = own.delay_samples[block].item(), ports.sampling_period_s, ports.hold, own.moving_average
        for channel, numerator, own_std in zip(own.channels_of(block).tolist(), numerators, above, strict=True):
            who = own.names[channel], ports.inputs[own.inputs[channel]], ports.outputs[own.outputs[channel]]
            for word, values, std in (("numerator", numerator, own_std), ("denominator", denominator, below)):
                for index, (value, deviation) in enumerate(zip(values.tolist(), std.tolist(), strict=True)):
                    rows.append((*who, word, len(values) - 1 - index, value, deviation, *timing))
    return encode_csv((*_POWERS, *_TIMING), rows)


def _deviations(solution: ExternalSolution, block: int) -> tuple[FloatArray, FloatArray]:
    """Deviations of the numerators (n_channel, n_power) of a block, and of its denominator (n_power,)."""
    std = np.linalg.norm(solution.transfers.root_of(block), axis=1)
    numerators = _numerators(solution, block)
    return std[: numerators.size].reshape(numerators.shape), np.concatenate([[0.0], std[numerators.size :]])


def write_mat(task: ExportTask) -> bytes:
    """Writes polynomials with their deviations for MATLAB."""
    solution = solution_from_artifact(task.model)
    own, ports, found = solution.transfers, solution.ports, solution.estimate
    numerator_std, denominator_std = np.zeros_like(own.numerator), np.zeros_like(own.denominator)
    for block in range(len(own.blocks)):
        above, below = _deviations(solution, block)
        numerator_std[own.channels_of(block), -above.shape[1] :] = above
        denominator_std[block, -len(below) :] = below
    content: Content = {
        **origin_of(task, solution.estimate.status),
        "sampling_period_s": ports.sampling_period_s,
        "hold": ports.hold,
        "moving_average_samples": own.moving_average,
        "channels": own.names,
        "inputs": tuple(ports.inputs[index] for index in own.inputs),
        "outputs": tuple(ports.outputs[index] for index in own.outputs),
        "numerator": own.numerator,
        "denominator": own.denominator[own.block_of],
        "numerator_std": numerator_std,
        "denominator_std": denominator_std[own.block_of],
        "delay_samples": own.delay_samples[own.block_of],
        **parameter_arrays(found),
    }
    return encode_mat(content)


def write_control(task: ExportTask) -> bytes:
    """Writes a script that makes the transfer functions with python-control."""
    solution = solution_from_artifact(task.model)
    own, origin = solution.transfers, origin_of(task, solution.estimate.status)
    lines = [
        f'"""Transfer functions of {origin["robot"]}, experiment {origin["experiment"]}, fit {origin["fit"]}.',
        "",
        f"Identified by robid {origin['robid_version']}; how the fit ended: {origin['status']}.",
        "Needs python-control (`pip install control`). The functions come without delay and moving average.",
        '"""',
        "",
        "import control",
        "",
        f"SAMPLING_PERIOD_S = {solution.ports.sampling_period_s!r}",
        f"MOVING_AVERAGE_SAMPLES = {own.moving_average!r}",
        "DELAY_S = {",
        *(
            f"    {name!r}: {int(own.delay_samples[block]) * solution.ports.sampling_period_s!r},"
            for name, block in zip(own.names, own.block_of.tolist(), strict=True)
        ),
        "}",
        "TRANSFER_FUNCTIONS = {",
        *(
            f"    {own.names[channel]!r}: control.TransferFunction({numerator.tolist()!r}, {denominator.tolist()!r}),"
            for channel, numerator, denominator in _channels(solution)
        ),
        "}",
        "",
    ]
    return "\n".join(lines).encode()


def transfer_functions(path: str | Path, *, pade_order: int = 0) -> dict[str, control.TransferFunction]:
    """Reads the transfer functions of a fit as those of python-control.

    They come by the channel's name from the fit's `model.h5`, continuous, with a Padé approximation of the delay of the
    given order, 0 for none, and without the moving average of the commands.

    Raises:
        SettingsError: If python-control is not installed.
        ArtifactError: If the model is of another family.
    """
    try:
        import control
    except ImportError as error:
        message = "S068 python-control is not installed"
        raise SettingsError(message, remedy="install it with `pip install robid[control]`") from error
    artifact = read_artifact(Path(path), MODEL)
    if artifact.attributes["family"] != "external":
        message = f"S069 the model is of family {artifact.attributes['family']}"
        raise ArtifactError(message, where=str(path), remedy="name the model of an external fit")
    solution = solution_from_artifact(artifact)
    own, found = solution.transfers, {}
    for channel, numerator, denominator in _channels(solution):
        delay_s = int(own.delay_samples[own.block_of[channel]]) * solution.ports.sampling_period_s
        late = control.TransferFunction(*control.pade(delay_s, pade_order))
        found[own.names[channel]] = control.TransferFunction(numerator, denominator) * late
    return found
