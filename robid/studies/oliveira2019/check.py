"""What must hold within the settings of the study of external dynamics."""

from __future__ import annotations

from collections.abc import Iterator

from robid.settings.experiment import Experiment
from robid.settings.problems import suggest
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath
from robid.studies.settings.oliveira2019 import CartesianCase, OliveiraStudy, PlantsCase

_PLANTS: FieldPath = ("study", "plants")


def check_oliveira2019(experiment: Experiment, _robot: RobotFile | None) -> Iterator[tuple[FieldPath, str]]:
    """Yields the field and the message of everything that is wrong with a study of external dynamics."""
    study = experiment.study
    if not isinstance(study, OliveiraStudy):
        return
    if study.plants is not None:
        yield from _check_plants(study.plants)
    if study.arm is not None:
        yield from _check_arm(experiment, study.arm)


def _check_plants(case: PlantsCase) -> Iterator[tuple[FieldPath, str]]:
    low, high = case.band_hz
    if not 0 < low < high:
        yield (*_PLANTS, "band_hz"), "must rise from a frequency above 0"
    elif high > max(case.fit_hz):
        yield (*_PLANTS, "band_hz"), f"ends beyond the fastest chirp that is fitted, {max(case.fit_hz):g} Hz"
    if case.validation_hz in case.fit_hz:
        yield (*_PLANTS, "validation_hz"), f"{case.validation_hz:g} Hz is fitted; validate on another chirp"
    if len(set(case.fit_hz)) < len(case.fit_hz):
        yield (*_PLANTS, "fit_hz"), "a frequency is there twice"
    if case.delay_samples > case.max_delay_samples:
        message = f"the true delay of {case.delay_samples} samples would not be searched"
        yield (*_PLANTS, "max_delay_samples"), message


def _check_arm(experiment: Experiment, case: CartesianCase) -> Iterator[tuple[FieldPath, str]]:
    field = ("study", "arm")
    fit, homes = experiment.fits.get(case.fit), experiment.campaigns.get(case.homes)
    if fit is None:
        yield (*field, "fit"), f"there is no fit `{case.fit}`; {suggest(case.fit, experiment.fits)}"
    elif fit.family != "external":
        yield (*field, "fit"), f"fit `{case.fit}` is of the family `{fit.family}`, not `external`"
    elif fit.validate_on is None:
        yield (*field, "fit"), f"fit `{case.fit}` names no campaign in `validate_on`"
    if homes is None:
        yield (*field, "homes"), f"there is no campaign `{case.homes}`; {suggest(case.homes, experiment.campaigns)}"
    elif not homes.moves_poses or homes.source is None or homes.source.simulate is None:
        yield (*field, "homes"), f"campaign `{case.homes}` does not simulate pose commands"
