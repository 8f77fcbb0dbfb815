"""What must hold between the study of robust regression and the experiment around it."""

from __future__ import annotations

from collections.abc import Iterator

from robid.settings.experiment import Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.janot2009.haptic.device import Bench
from robid.studies.settings.study import BranchCase, JanotStudy, SeededCase

_FEWEST_ROWS = 100
_Found = Iterator[tuple[FieldPath, str]]


def check_janot2009(experiment: Experiment, robot: RobotFile | None) -> _Found:
    """Yields the field and the message of everything that is wrong with a study of robust regression."""
    study = experiment.study
    if not isinstance(study, JanotStudy):
        return
    if study.haptic is not None:
        yield from _check_case(("study", "haptic"), study.haptic, Bench.sampling_period_s)
    if study.branch is None:
        return
    yield from _check_middle(experiment, study.branch)
    if robot is None:
        return
    if robot.controller is None:
        yield ("study", "branch"), "the robot file has no `controller`, in whose loop the branch is recorded"
    else:
        yield from _check_case(("study", "branch"), study.branch, robot.controller.sampling_period_s)


def _check_case(field: FieldPath, case: SeededCase, sampling_period_s: float) -> _Found:
    if case.bad_cut_hz <= case.good_cut_hz:
        yield (*field, "bad_cut_hz"), "the filters that do not suit must pass more than those that do"
    if case.bad_cut_hz >= 0.25 / sampling_period_s:
        yield (*field, "bad_cut_hz"), f"must lie below {0.25 / sampling_period_s:g} Hz, a quarter of the sampling rate"
    if 2 * case.good_cut_hz * case.duration_s < _FEWEST_ROWS:
        message = f"filters at {case.good_cut_hz:g} Hz leave fewer than {_FEWEST_ROWS} rows of each joint"
        yield (*field, "duration_s"), message


def _check_middle(experiment: Experiment, case: BranchCase) -> _Found:
    campaign = experiment.campaigns.get(case.campaign)
    if campaign is None:
        message = f"there is no campaign `{case.campaign}`; {suggest(case.campaign, experiment.campaigns)}"
        yield ("study", "branch", "campaign"), message
    elif campaign.configurations is None or campaign.configurations.list_rows is None:
        yield ("study", "branch", "campaign"), f"campaign `{case.campaign}` does not list its configurations"
