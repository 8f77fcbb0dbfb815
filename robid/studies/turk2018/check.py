"""What must hold within the settings of the study of position-dependent dynamics."""

from __future__ import annotations

from collections.abc import Iterator

from robid.settings.experiment import Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.settings.turk2018 import TurkStudy
from robid.studies.turk2018.moving.check import check_travel

_Found = Iterator[tuple[FieldPath, str]]


def check_turk2018(experiment: Experiment, robot: RobotFile | None) -> _Found:
    """Yields the field and the message of everything that is wrong with a study of position-dependent dynamics."""
    study = experiment.study
    if not isinstance(study, TurkStudy):
        return
    if study.local is not None:
        field = ("study", "local", "fit")
        yield from _check_fit(experiment, study.local.fit, field)
        fit = experiment.fits.get(study.local.fit)
        if fit is not None and fit.family == "lpv" and fit.validate_on is None:
            yield field, f"fit `{study.local.fit}` names no campaign in `validate_on`"
    if study.travel is not None:
        yield from _check_fit(experiment, study.travel.fit, ("study", "global", "fit"))
        if study.travel.uncompensated is not None:
            yield from _check_fit(experiment, study.travel.uncompensated, ("study", "global", "uncompensated"))
        yield from check_travel(experiment, study.travel, robot)


def _check_fit(experiment: Experiment, name: str, field: FieldPath) -> _Found:
    fit = experiment.fits.get(name)
    if fit is None:
        yield field, f"there is no fit `{name}`; {suggest(name, experiment.fits)}"
    elif fit.family != "lpv":
        yield field, f"fit `{name}` is of the family `{fit.family}`, not `lpv`"
