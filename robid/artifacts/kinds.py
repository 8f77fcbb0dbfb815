"""The kinds of artifacts before a fit: excitation, record, frequency response, design; and the task of a study.

What lies in them their dataclasses declare, see `robid.arrays.Quantity`.

Schema history:
    excitation:
        1.0: first version.
        1.1: in the plan, crest factor of the motor speed, signal-to-noise ratio of the response, and duration.
        1.2: in the plan of a trajectory, condition number of its regressor.
        1.3: `channels` of what is no motor: commands of the tool's pose; position reference of a travel beneath the
            excitation.
    record:
        1.0: first version.
        1.1: `accelerations`; trackers and accelerometers among the outputs.
        1.2: `truth_sha256`.
        2.0: each channel has its quantity, unit and side: `input_channels`, `output_channels`, `reference_channels`.
            `inputs`, `outputs`, `output_offset`, `input_hold` and `input_relative_std` were `torque`, `position`,
            `position_offset_rad`, `torque_hold` and `torque_relative_std`. A record may be one shot: without excited
            lines, and without configurations. `joint_units`, where joints are prismatic.
        2.1: `segments`: an arbitrary signal, one shot with lines.
        2.2: each channel has `sampled`: what its samples are.
    frf:
        1.0: first version.
        1.1: `coefficient_offset`, `uncompensated_response`, the torque laws; coherence, levels at the silent lines.
        1.2: `torque_amplitude`, `realization_error`.
        1.3: `mean_torque`, `mean_position`, `motion_rms`, `compensation`, `line_correlation`,
            `freedom_share`.
        2.0: each input and output has its quantity, unit and side: `input_channels`, `output_channels`; a response need
            not be one from torque to acceleration. `input_hold`, `input_amplitude`, `mean_input` and `mean_output` were
            `torque_hold`, `torque_amplitude`, `mean_torque` and `mean_position`. `joint_units`, where joints
            are prismatic.
        2.1: `dropped`.
        2.2: `saturated_inputs`, `saturated_outputs`.
        2.3: each channel has `sampled`: what its samples are.
    design:
        1.0: first version.
        1.1: criterion, slopes, counts, gain, rounding loss; the gap is relative. Files of 1.0 are refused.
        1.2: `cost_s`, `stability`.
        1.3: `joint_units`, where joints are prismatic.
        1.4: `between_relative_std`, what parameters may differ by between configurations; `information` is without it.
    task:
        1.0: first version.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.mapping import from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.design.configurations.information import ConfigurationDesign
    from robid.design.excitation.excitation import CampaignExcitation
    from robid.frf.frf import Frf
    from robid.signals.record import Record

EXCITATION = Kind("excitation", "1.3", "robid design-excitation")
RECORD = Kind("record", "2.2", "robid simulate-or-acquire")
FRF = Kind("frf", "2.3", "robid estimate-frf")
DESIGN = Kind("design", "1.4", "robid design-configs")
TASK = Kind("task", "1.0", "robid study")


def excitation_to_artifact(content: CampaignExcitation, provenance: Provenance) -> Artifact:
    """Turns a campaign's excitation into an artifact."""
    return Artifact(EXCITATION, *to_datasets(content), provenance)


def excitation_from_artifact(artifact: Artifact) -> CampaignExcitation:
    """The inverse of `excitation_to_artifact`, up to the rounding of the reference to float32."""
    from robid.design.excitation.excitation import CampaignExcitation

    return from_datasets(CampaignExcitation, artifact)


def record_to_artifact(record: Record, provenance: Provenance) -> Artifact:
    """Turns a record into an artifact; its samples are stored compactly."""
    return Artifact(RECORD, *to_datasets(record), provenance)


def record_from_artifact(artifact: Artifact) -> Record:
    """The inverse of `record_to_artifact`, up to the rounding of the samples to float32."""
    from robid.signals.record import Record

    return from_datasets(Record, artifact)


def frf_to_artifact(frf: Frf, provenance: Provenance) -> Artifact:
    """Turns a frequency response into an artifact."""
    return Artifact(FRF, *to_datasets(frf), provenance)


def frf_from_artifact(artifact: Artifact) -> Frf:
    """The inverse of `frf_to_artifact`."""
    from robid.frf.frf import Frf

    return from_datasets(Frf, artifact)


def design_to_artifact(design: ConfigurationDesign, provenance: Provenance) -> Artifact:
    """Turns a design into an artifact."""
    return Artifact(DESIGN, *to_datasets(design), provenance)


def design_from_artifact(artifact: Artifact) -> ConfigurationDesign:
    """The inverse of `design_to_artifact`."""
    from robid.design.configurations.information import ConfigurationDesign

    return from_datasets(ConfigurationDesign, artifact)
