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
from robid.artifacts.mapping import Column, from_datasets, position_units, to_datasets

if TYPE_CHECKING:
    from robid.design.configurations.information import ConfigurationDesign

DESIGN = Kind("design", "1.4", "robid design-configs")

_TABLE = {
    "weights": Column("1", ("candidate",), "Optimal weights: shares of the experiments, or of the cost"),
    "slopes": Column("1", ("candidate",), "What more weight brings; 1 for candidates that have weight"),
    "chosen": Column("1", ("configuration",), "Indices of the chosen candidates"),
    "counts": Column("1", ("candidate",), "Experiments in each candidate"),
    "gain": Column("1", ("candidate",), "What one experiment more adds to log det of the information"),
    "information": Column("1", ("candidate", "parameter", "parameter"), "Information about the log-parameters"),
    "predicted_relative_std": Column("1", ("parameter",), "Relative standard deviation that the choice promises"),
    "between_relative_std": Column("1", ("parameter",), "Deviation between configurations that was allowed for"),
    "parameter_names": Column("1", ("parameter",)),
    "cost_s": Column("s", ("candidate",), "Time of one visit: experiments and way"),
    "stability/kept": Column("1", ("trial",), "Share of the choice that other data or parameters choose too"),
    "stability/efficiency": Column("1", ("trial",), "Efficiency of that choice by what it did not use"),
    "stability/chosen_often": Column("1", ("candidate",), "Share of the trials that choose each candidate"),
    "joint_units": Column("1", ("joint",), "Units of the joints' positions"),
}


def design_to_artifact(design: ConfigurationDesign, provenance: Provenance) -> Artifact:
    """Turns a design into an artifact."""
    positions = Column(position_units(design.joint_units), ("candidate", "joint"), "The candidates' arm-side joints")
    return Artifact(DESIGN, *to_datasets(design, _TABLE | {"configurations": positions}), provenance)


def design_from_artifact(artifact: Artifact) -> ConfigurationDesign:
    """The inverse of `design_to_artifact`."""
    from robid.design.configurations.information import ConfigurationDesign

    return from_datasets(ConfigurationDesign, artifact)
