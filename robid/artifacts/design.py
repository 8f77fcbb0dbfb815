"""The design artifact: the configurations to measure.

Schema history:
    1.0: first version.
    1.1: criterion, slopes, counts, gain, rounding loss; the gap is relative. Files of 1.0 lack them and are refused.
    1.2: `cost_s`, `stability`.
    1.3: `joint_units`, where joints are prismatic.
    1.4: `between_relative_std`, what parameters may differ by between configurations; `information` is without it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.mapping import from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.design.configurations.information import ConfigurationDesign

DESIGN = Kind("design", "1.4", "robid design-configs")


def design_to_artifact(design: ConfigurationDesign, provenance: Provenance) -> Artifact:
    """Turns a design into an artifact."""
    return Artifact(DESIGN, *to_datasets(design), provenance)


def design_from_artifact(artifact: Artifact) -> ConfigurationDesign:
    """The inverse of `design_to_artifact`."""
    from robid.design.configurations.information import ConfigurationDesign

    return from_datasets(ConfigurationDesign, artifact)
