"""The families that there are, known to the stages by this list alone, and experiment files with fits of them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from robid.models.elastic.family import ELASTIC
from robid.models.external.family import EXTERNAL
from robid.models.family import Family
from robid.models.lpv.family import LPV
from robid.models.rigid.family import RIGID
from robid.models.transmission.family import TRANSMISSION
from robid.settings.checks.experiment import Studies
from robid.settings.load import (
    LoadedExperiment,
    RobotReader,
    experiment_schema_of,
    load_experiment_of,
    load_row_of,
    read_robot,
)
from robid.settings.placeholders import Row
from robid.settings.problems import SettingsProblem
from robid.settings.yaml import Document

FAMILIES: Mapping[str, Family] = {family.name: family for family in (ELASTIC, RIGID, EXTERNAL, LPV, TRANSMISSION)}


def load_experiment(
    path: Path, families: Mapping[str, Family] | None = None, studies: Studies | None = None
) -> LoadedExperiment:
    """Loads an experiment file and the robot file it names, and checks both; all families are known when None.

    Raises:
        SettingsError: With every problem of both files, each with its line and field.
    """
    return load_experiment_of(FAMILIES if families is None else families, path, studies)


def load_row(
    document: Document, row: Row, read: RobotReader = read_robot
) -> tuple[LoadedExperiment | None, list[SettingsProblem]]:
    """Checks the experiment that a row of a manifest makes of an experiment file, see `load_row_of`."""
    return load_row_of(FAMILIES, document, row, read)


def experiment_schema(families: Mapping[str, Family] | None = None, study: Any = Any) -> dict[str, Any]:  # noqa: ANN401
    """Returns the JSON schema of the experiment file whose fits are of these families, with this type of study."""
    return experiment_schema_of(FAMILIES if families is None else families, study)
