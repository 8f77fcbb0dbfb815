"""The branch over many seeds."""

from __future__ import annotations

from dataclasses import dataclass

from robid.pipeline import Run
from robid.settings.robot_parts import plain_settings, require_controller, robot_settings
from robid.stages.configurations import configurations_of
from robid.studies.janot2009.branch.motion import Branch
from robid.studies.janot2009.branch.rig import make_rig, record_branch
from robid.studies.janot2009.section import study_of
from robid.studies.janot2009.seeded.chunks import Chunk, chunk_tasks, judge_chunk
from robid.studies.tasks import Content, Task


@dataclass(frozen=True)
class BranchChunk:
    """Some seeds of the branch."""

    branch: Branch
    chunk: Chunk


def branch_tasks(run: Run) -> list[Task]:
    """Returns the tasks of the branch; none where the study leaves it out."""
    case = study_of(run.loaded).branch
    if case is None:
        return []
    campaign = run.loaded.experiment.campaigns[case.campaign]
    decides = {
        **robot_settings(run.loaded, "mechanics", "rigid", "range", "motor_limits", "friction", "controller"),
        "configurations": plain_settings(campaign.configurations),
        "payload_kg": campaign.payload_kg,
    }
    middle = configurations_of(run.loaded, campaign, {})[0]
    robot = run.loaded.robot.to_robot(campaign.payload_kg)
    branch = Branch(case, robot, require_controller(run.loaded), middle)
    return chunk_tasks(case, "branch", decides, lambda chunk: BranchChunk(branch, chunk))


def identify_branch(one: BranchChunk) -> Content:
    """Simulates and identifies some seeds of the branch."""
    rig = make_rig(one.branch)
    return judge_chunk(rig.machine, record_branch(rig, one.chunk.seeds), one.branch.case)
