"""How transfer functions of responses lie in their files, and what they are written as."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.arrays import FloatArray
from robid.models.encode import Content, Files, encode_csv, encode_json, encode_mat, origin_of, parameter_records
from robid.models.external.of_responses.solution import RationalSolution, RationalValidation
from robid.models.family import ExportTask

FILES = Files("external", RationalSolution, RationalValidation)
model_of, solution_from_artifact = FILES.model_of, FILES.solution_of
validation_of, validation_from_artifact = FILES.validation_of, FILES.validated_in

_COLUMNS = ("name", "kind", "unit", "estimate", "lower", "upper", "relative_std", "identifiable")


def _channels(solution: RationalSolution) -> Iterator[Content]:
    own, ports = solution.transfers, solution.ports
    for channel, name in enumerate(own.names):
        block = int(own.block_of[channel])
        yield {
            "name": name,
            "block": own.blocks[block],
            "input": ports.inputs[own.inputs[channel]],
            "input_unit": ports.input_units[own.inputs[channel]],
            "output": ports.outputs[own.outputs[channel]],
            "output_unit": ports.output_units[own.outputs[channel]],
            "numerator": _trimmed(own.numerator[channel]).tolist(),
            "denominator": _trimmed(own.denominator[block]).tolist(),
            "delay_s": float(own.delay_s[block]),
            "integrators": int(own.integrators[block]),
        }


def _trimmed(polynomial: FloatArray) -> FloatArray:
    found = np.trim_zeros(polynomial, "f")
    return found if found.size else np.zeros(1)


def _described(task: ExportTask, solution: RationalSolution) -> Content:
    words = {"continuous": "in s [rad/s]", "discrete": "in z"}
    return {
        **origin_of(task, solution.estimate.status),
        "time": solution.transfers.time,
        "polynomials": f"{words[solution.transfers.time]}, highest power first; the delay comes on top",
        "sampling_period_s": solution.ports.sampling_period_s,
        "hold_in_data": solution.ports.hold,
    }


def write_json(task: ExportTask) -> bytes:
    """Writes transfer functions and parameters as JSON."""
    solution = solution_from_artifact(task.model)
    found = solution.estimate
    parts = {"confidence": found.confidence, "parameters": parameter_records(found, _COLUMNS)}
    return encode_json({**_described(task, solution), "channels": list(_channels(solution)), **parts})


def write_csv(task: ExportTask) -> bytes:
    """Writes a row for each coefficient of each channel."""
    solution, rows = solution_from_artifact(task.model), list[tuple[object, ...]]()
    for one in _channels(solution):
        for word in ("numerator", "denominator"):
            for index, value in enumerate(one[word]):
                power = len(one[word]) - 1 - index
                rows.append((one["name"], one["input"], one["output"], word, power, value, one["delay_s"]))
    return encode_csv(("channel", "input", "output", "polynomial", "power", "value", "delay_s"), rows)


def write_mat(task: ExportTask) -> bytes:
    """Writes transfer functions as a MAT file: one row of coefficients a channel."""
    solution = solution_from_artifact(task.model)
    own, channels = solution.transfers, list(_channels(solution))
    texts = {
        key: tuple(one[key] for one in channels) for key in ("name", "input", "output", "input_unit", "output_unit")
    }
    below = own.denominator[own.block_of]
    arrays = {"numerator": own.numerator, "denominator": below, "delay_s": own.delay_s[own.block_of]}
    return encode_mat({**_described(task, solution), **texts, **arrays})


def write_control(task: ExportTask) -> bytes:
    """Writes a script that makes the transfer functions with python-control, their delays beside them."""
    solution = solution_from_artifact(task.model)
    step = f", {solution.ports.sampling_period_s!r}" if solution.transfers.time == "discrete" else ""
    lines = [
        f'"""Transfer functions of fit {task.data.name}, experiment {task.data.loaded.experiment.name}, by robid."""',
        "",
        "import control",
        "",
        "# The delay of each channel comes on top [s].",
        "delay_s = {",
        *(f"    {one['name']!r}: {one['delay_s']!r}," for one in _channels(solution)),
        "}",
        "channels = {",
        *(
            f"    {one['name']!r}: control.tf({one['numerator']!r}, {one['denominator']!r}{step}),"
            for one in _channels(solution)
        ),
        "}",
        "",
    ]
    return "\n".join(lines).encode()
