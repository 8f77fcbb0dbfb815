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
from robid.artifacts.mapping import Column, from_datasets, to_datasets

if TYPE_CHECKING:
    from robid.design.excitation.excitation import CampaignExcitation

EXCITATION = Kind("excitation", "1.3", "robid design-excitation")


def excitation_to_artifact(content: CampaignExcitation, provenance: Provenance) -> Artifact:
    """Turns a campaign's excitation into an artifact."""
    from robid.design.excitation.excitation import UNITS

    unit = UNITS[content.excitation.kind]
    block = ("realization", "experiment")
    table = {
        "configurations": Column("rad", ("configuration", "joint"), "Arm-side joint angles"),
        "excitation/reference": Column(unit, (*block, "sample", "motor"), "Injected signal, one period", compact=True),
        "excitation/excited_lines": Column("1", ("frequency",), "Excited DFT lines"),
        "excitation/detection_lines": Column("1", ("detection",), "DFT lines left out to detect distortion"),
        "excitation/spectrum": Column(unit, (*block, "frequency", "motor"), "Complex amplitudes of the excited lines"),
        "excitation/rms": Column(unit, ("motor",), "RMS of each motor's signal"),
        "excitation/crest_factor": Column("1", (*block, "motor"), "Peak over RMS"),
        "excitation/channels": Column("1", ("motor",), "What each column is where it is no motor"),
    }
    if content.excitation.travel is not None:
        about = "Position reference of the motors beneath the excitation, from the configuration"
        table["excitation/travel"] = Column("rad", ("sample", "motor"), about, compact=True)
    if content.excitation.plan is not None:
        table |= _plan_columns()
    return Artifact(EXCITATION, *to_datasets(content, table), provenance)


def excitation_from_artifact(artifact: Artifact) -> CampaignExcitation:
    """The inverse of `excitation_to_artifact`, up to the rounding of the reference to float32."""
    from robid.design.excitation.excitation import CampaignExcitation

    return from_datasets(CampaignExcitation, artifact)


def _plan_columns() -> dict[str, Column]:
    columns = {
        "admissible_scale": Column(
            "1", ("configuration", "motor"), "Factor on all RMS at which the first limit is met"
        ),
        "speed_crest": Column("1", ("configuration", "motor"), "Largest crest factor of the motor speed"),
        "snr_db": Column(
            "dB", ("configuration", "frequency", "output", "input"), "Predicted signal-to-noise ratio of the response"
        ),
    }
    columns["condition"] = Column("1", ("realization",), "Condition number of a trajectory's regressor")
    for quantity, unit in (("speed", "rad/s"), ("torque", "N m"), ("excursion", "rad")):
        columns[f"{quantity}_rms"] = Column(unit, ("configuration", "motor"), f"Predicted RMS of the {quantity}")
        columns[f"{quantity}_peak"] = Column(unit, ("configuration", "motor"), f"Predicted peak of the {quantity}")
        columns[f"{quantity}_limit"] = Column(unit, ("motor",), f"Limit of the {quantity}")
    return {f"excitation/plan/{name}": column for name, column in columns.items()}
