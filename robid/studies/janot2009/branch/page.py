"""The branch: what its seeds say."""

from __future__ import annotations

from collections.abc import Sequence

from robid.artifacts.artifact import Artifact
from robid.pipeline.graph import Run
from robid.report.section import Section
from robid.studies.janot2009.section import study_of
from robid.studies.janot2009.seeded.chunks import FILTERS, gather
from robid.studies.janot2009.seeded.figures import (
    VERDICTS,
    estimate_tables,
    joint_figures,
    verdict_figures,
    verdict_parts,
)
from robid.studies.part import PartFound


def conclude_branch(run: Run, results: Sequence[Artifact]) -> PartFound | None:
    """Turns the branch's seeds into figures, tables, and what is asked of them."""
    case = study_of(run.loaded).branch
    if case is None:
        return None
    found = {filters: gather(results, filters) for filters in FILTERS}
    joints = tuple(joint.name for joint in run.loaded.robot.joints)
    lead = (
        "The paper says of its medical interface that it saw there what it saw on one axis. Its geometry is not"
        " published: this branch has the same topology, an arm whose forearm a parallelogram drives. Least squares"
        " and Huber's estimator share what bias there is, so that their difference alone need not show it: the"
        " instruments and the residuals' correlation do."
    )
    parts = (*verdict_parts(found, case), joint_figures(found, case, joints), *estimate_tables(found, case))
    section = Section(f"Branch of a haptic interface over {case.seeds} seeds", lead, parts)
    asked = {f"branch.{filters}.verdict_share": each for filters, each in VERDICTS.items()}
    return PartFound(verdict_figures("branch", found), asked, (section,))
