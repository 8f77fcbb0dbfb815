"""The design artifact: the configurations to measure.

Schema history:
    1.0: first version.
"""

from __future__ import annotations

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.mapping import Column, from_datasets, to_datasets
from robid.design.information import ConfigurationDesign

DESIGN = Kind("design", "1.0", "robid design-configs")

_TABLE = {
    "weights": Column("1", ("candidate",), "Relaxed D-optimal weights"),
    "chosen": Column("1", ("configuration",), "Indices of the chosen candidates"),
    "information": Column("1", ("candidate", "parameter", "parameter"), "Information about the log-parameters"),
    "predicted_relative_std": Column("1", ("parameter",), "Relative standard deviation that the choice promises"),
    "parameter_names": Column("1", ("parameter",)),
    "configurations": Column("rad", ("candidate", "joint"), "Arm-side joint angles of the candidates"),
}


def design_to_artifact(design: ConfigurationDesign, provenance: Provenance) -> Artifact:
    """Turns a design into an artifact."""
    return Artifact(DESIGN, *to_datasets(design, _TABLE), provenance)


def design_from_artifact(artifact: Artifact) -> ConfigurationDesign:
    """The inverse of `design_to_artifact`."""
    return from_datasets(ConfigurationDesign, artifact)
