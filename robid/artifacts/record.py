"""The record artifact.

Schema history:
    1.0: first version.
    1.1: `accelerations`; trackers and accelerometers among the outputs.
    1.2: `truth_sha256`.
    2.0: each channel has its quantity, unit and side: `input_channels`, `output_channels`, `reference_channels`.
        `inputs`, `outputs`, `output_offset`, `input_hold` and `input_relative_std` were `torque`, `position`,
        `position_offset_rad`, `torque_hold` and `torque_relative_std`. A record may be one shot: without excited
        lines, and without configurations. `joint_units`, where joints are prismatic.
    2.1: `segments`: an arbitrary signal, one shot with lines.
    2.2: each channel has `sampled`: what its samples are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.mapping import Column, from_datasets, position_units, to_datasets
from robid.signals.quantities import units_text

if TYPE_CHECKING:
    from robid.signals.record import Record

RECORD = Kind("record", "2.2", "robid simulate-or-acquire")


def record_to_artifact(record: Record, provenance: Provenance) -> Artifact:
    """Turns a record into an artifact; its samples are stored compactly."""
    samples = ("configuration", "realization", "experiment", "period", "sample")
    outputs = units_text(record.output_channels)
    table = {
        "configurations": Column(position_units(record.joint_units), ("configuration", "joint"), "Arm-side joints"),
        "joint_units": Column("1", ("joint",), "Units of the joints' positions"),
        "inputs": Column(
            units_text(record.input_channels), (*samples, "input"), "Inputs, by their channels", compact=True
        ),
        "outputs": Column(outputs, (*samples, "output"), "Outputs less their offset, by their channels", compact=True),
        "reference": Column(
            units_text(record.reference_channels),
            ("configuration", "realization", "experiment", "sample", "reference"),
            "One period of the injected signal",
            compact=True,
        ),
        "excited_lines": Column("1", ("frequency",), "Excited DFT lines of one period; none for one shot"),
        "detection_lines": Column("1", ("detection",), "DFT lines left out to detect distortion"),
        "input_channels": Column("1", ("input",), "What each input is"),
        "output_channels": Column("1", ("output",), "What each output is"),
        "reference_channels": Column("1", ("reference",), "What each column of the reference is"),
        "output_offset": Column(outputs, ("configuration", "output"), "Offset subtracted from the outputs"),
        "input_relative_std": Column("1", ("input",), "Standard deviation of the input scale's relative error"),
        "notes": Column("1", ("note",)),
    }
    return Artifact(RECORD, *to_datasets(record, table), provenance)


def record_from_artifact(artifact: Artifact) -> Record:
    """The inverse of `record_to_artifact`, up to the rounding of the samples to float32."""
    from robid.signals.record import Record

    return from_datasets(Record, artifact)
