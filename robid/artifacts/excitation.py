"""The excitation artifact: what each motor is told to do, in which configurations.

Schema history:
    1.0: first version.
    1.1: in the plan, crest factor of the motor speed, signal-to-noise ratio of the response, and duration.
    1.2: in the plan of a trajectory, condition number of its regressor.
    1.3: `channels` of what is no motor: commands of the tool's pose; position reference of a travel beneath the
        excitation.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.mapping import from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.design.excitation.excitation import CampaignExcitation

EXCITATION = Kind("excitation", "1.3", "robid design-excitation")


def excitation_to_artifact(content: CampaignExcitation, provenance: Provenance) -> Artifact:
    """Turns a campaign's excitation into an artifact."""
    return Artifact(EXCITATION, *to_datasets(content), provenance)


def excitation_from_artifact(artifact: Artifact) -> CampaignExcitation:
    """The inverse of `excitation_to_artifact`, up to the rounding of the reference to float32."""
    from robid.design.excitation.excitation import CampaignExcitation

    return from_datasets(CampaignExcitation, artifact)
