"""The record artifact.

Schema history:
    1.0: first version.
    1.1: `accelerations`; trackers and accelerometers among the outputs.
    1.2: `truth_sha256`.
    1.3: `joint_units`, where joints are prismatic.
"""

from __future__ import annotations

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.mapping import Column, from_datasets, position_units, to_datasets
from robid.signals.record import Record

RECORD = Kind("record", "1.3", "robid simulate-or-acquire")

_REFERENCE_UNITS = {"speed_reference": "rad/s", "position_reference": "rad"}


def record_to_artifact(record: Record, provenance: Provenance) -> Artifact:
    """Turns a record into an artifact; its samples are stored compactly."""
    samples = ("configuration", "realization", "experiment", "period", "sample")
    reference_units = _REFERENCE_UNITS.get(record.reference_kind, record.torque_unit)
    table = {
        "configurations": Column(position_units(record.joint_units), ("configuration", "joint"), "Arm-side joints"),
        "joint_units": Column("1", ("joint",), "Units of the joints' positions"),
        "torque": Column(record.torque_unit, (*samples, "input"), "Motor torque, motor side", compact=True),
        "position": Column(
            "rad",
            (*samples, "output"),
            "Measured angles less their offset; trackers in m, accelerometers in m/s^2",
            compact=True,
        ),
        "reference": Column(
            reference_units,
            ("configuration", "realization", "experiment", "sample", "input"),
            "One period of the injected signal",
            compact=True,
        ),
        "excited_lines": Column("1", ("frequency",), "Excited DFT lines of one period"),
        "detection_lines": Column("1", ("detection",), "DFT lines left out to detect distortion"),
        "input_names": Column("1", ("input",)),
        "output_names": Column("1", ("output",)),
        "position_offset_rad": Column("rad", ("configuration", "output"), "Offset subtracted from the position"),
        "torque_relative_std": Column("1", ("input",), "Standard deviation of the torque scale's relative error"),
        "accelerations": Column("1", ("acceleration",), "Names of the outputs that are accelerations"),
        "notes": Column("1", ("note",)),
    }
    return Artifact(RECORD, *to_datasets(record, table), provenance)


def record_from_artifact(artifact: Artifact) -> Record:
    """The inverse of `record_to_artifact`, up to the rounding of the samples to float32."""
    return from_datasets(Record, artifact)
