"""design-configs: which of a campaign's configurations to measure."""

from __future__ import annotations

import numpy as np

from robid.artifacts.design import DESIGN, design_to_artifact
from robid.artifacts.store import write_artifact
from robid.design.candidates import candidate_information
from robid.design.information import ConfigurationDesign, design_configurations
from robid.design.lines import choose_lines
from robid.settings.experiment import Experiment
from robid.settings.load import LoadedExperiment
from robid.settings.slices import to_plain
from robid.stages.configurations import configurations_of, design_inputs
from robid.stages.slices import delay_s, line_settings, require_controller, robot_settings
from robid.stages.stage import Job, Plan, Stage, counted


def _owners(experiment: Experiment) -> tuple[str, ...]:
    return tuple(experiment.designs)


def _plan(loaded: LoadedExperiment, owner: str) -> Plan:
    design = loaded.experiment.designs[owner]
    campaign = loaded.experiment.campaigns[design.campaign]
    section = f"campaigns.{design.campaign}"
    settings = {
        f"designs.{owner}": to_plain(design),
        f"{section}.configurations": to_plain(campaign.configurations),
        f"{section}.payload_kg": campaign.payload_kg,
        f"{section}.excitation": line_settings(campaign),
        **robot_settings(loaded, "mechanics", "range", "timing"),
    }
    return Plan((f"designs/{owner}.h5",), settings, design_inputs(campaign))


def _run(job: Job) -> str:
    design = job.loaded.experiment.designs[job.owner]
    campaign = job.loaded.experiment.campaigns[design.campaign]
    robot = job.loaded.robot.to_robot(campaign.payload_kg)
    candidates = configurations_of(job.loaded, campaign, job.inputs)
    period = require_controller(job.loaded).sampling_period_s
    lines, _ = choose_lines(campaign.excitation, period)
    matrices, names = candidate_information(
        robot,
        candidates,
        lines / campaign.excitation.period_s,
        period,
        delay_s(job.loaded, campaign),
        design.assumed_relative_error,
    )
    chosen = design_configurations(matrices, candidates, names, design.options())
    write_artifact(job.output, design_to_artifact(chosen, job.provenance(STAGE.name)))
    return figures(chosen)


def figures(chosen: ConfigurationDesign) -> str:
    """Says what was chosen, in a phrase."""
    deviation = 100 * float(np.median(chosen.predicted_relative_std))
    return (
        f"{len(chosen.chosen)} of {counted(len(chosen.configurations), 'configuration')},"
        f" D-efficiency {100 * chosen.efficiency:.0f} %, predicted deviation {deviation:.2g} % (median)"
    )


STAGE = Stage(
    "design-configs",
    "Chooses the robot configurations to measure.",
    "design",
    DESIGN,
    _owners,
    _plan,
    _run,
)
