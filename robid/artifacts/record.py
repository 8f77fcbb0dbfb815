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
from robid.artifacts.mapping import from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.signals.record import Record

RECORD = Kind("record", "2.2", "robid simulate-or-acquire")


def record_to_artifact(record: Record, provenance: Provenance) -> Artifact:
    """Turns a record into an artifact; its samples are stored compactly."""
    return Artifact(RECORD, *to_datasets(record), provenance)


def record_from_artifact(artifact: Artifact) -> Record:
    """The inverse of `record_to_artifact`, up to the rounding of the samples to float32."""
    from robid.signals.record import Record

    return from_datasets(Record, artifact)
