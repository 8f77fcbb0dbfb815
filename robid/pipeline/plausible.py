"""What the data of a campaign contradict, in sentences for terminal and report."""

from __future__ import annotations

from robid.errors import DataError, SettingsError
from robid.results.plausible.doubts import evidence_doubts
from robid.results.plausible.evidence import Evidence
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s


def contradictions(loaded: LoadedExperiment, campaign: str, evidence: Evidence) -> tuple[str, ...]:
    """Says what of a campaign's data contradicts the robot file, and what its data cannot tell.

    The robot file is read anew each time and nothing of this is stored: a corrected file makes no response stale.
    Where the robot cannot be built, there is nothing to compare with; the stages that need it say so.

    Args:
        loaded: The experiment.
        campaign: The campaign's name.
        evidence: What it shows.
    """
    if loaded.experiment.robot is None:
        return ()
    settings = loaded.experiment.campaigns[campaign]
    try:
        robot, declared_s = loaded.robot.to_robot(settings.payload_kg), delay_s(loaded, settings)
        doubts, notes = evidence_doubts(robot, evidence, declared_s)
    except (DataError, SettingsError):
        return ()
    return tuple(f"Campaign {campaign}: {told}." for told in (*(doubt.sentence for doubt in doubts), *notes))
