"""What must hold between the study of fleets and its campaign."""

from __future__ import annotations

from collections.abc import Iterator

from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.campaign_check import campaign_problem
from robid.studies.settings.fleet import FleetStudy

KINDS = ("spring", "sign", "dead", "gap", "payload", "file")
"""Kinds of faults: a softened spring, a wrong sign, a dead channel, lost samples, a wrong payload, a damaged file."""


def check_fleet(experiment: Experiment, _robot: RobotFile | None) -> Iterator[tuple[FieldPath, str]]:
    """Yields the field and the message of everything that is wrong with a study of fleets."""
    study = experiment.study
    if not isinstance(study, FleetStudy):
        return
    message = campaign_problem(experiment, study.campaign)
    if message:
        yield ("study", "campaign"), message
    faulty = len(KINDS) * study.faults.each
    if faulty > study.robots:
        yield ("study", "faults", "each"), f"makes {faulty} robots with a fault, of {study.robots}"
    elif study.speed is not None and study.speed.rows > study.robots - faulty:
        yield ("study", "speed", "rows"), f"must be of sound robots, of which there are {study.robots - faulty}"
    fewest, most = study.faults.lost_samples
    if not 0 < fewest <= most:
        yield ("study", "faults", "lost_samples"), "must rise from a number above 0"
