"""The frequency response artifact.

Schema history:
    1.0: first version.
    1.1: `coefficient_offset`, `uncompensated_response`, the torque laws; coherence, levels at the silent lines.
    1.2: `torque_amplitude`, `realization_error`.
    1.3: `mean_torque`, `mean_position`, `motion_rms`, `compensation`, `line_correlation`,
        `freedom_share`.
    2.0: each input and output has its quantity, unit and side: `input_channels`, `output_channels`; a response need not
        be one from torque to acceleration. `input_hold`, `input_amplitude`, `mean_input` and `mean_output` were
        `torque_hold`, `torque_amplitude`, `mean_torque` and `mean_position`. `joint_units`, where joints
        are prismatic.
    2.1: `dropped`.
    2.2: `saturated_inputs`, `saturated_outputs`.
    2.3: each channel has `sampled`: what its samples are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.mapping import from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.frf.frf import Frf

FRF = Kind("frf", "2.3", "robid estimate-frf")


def frf_to_artifact(frf: Frf, provenance: Provenance) -> Artifact:
    """Turns a frequency response into an artifact."""
    return Artifact(FRF, *to_datasets(frf), provenance)


def frf_from_artifact(artifact: Artifact) -> Frf:
    """The inverse of `frf_to_artifact`."""
    from robid.frf.frf import Frf

    return from_datasets(Frf, artifact)
