"""JSON schemas of the settings files, for editors."""

from __future__ import annotations

from typing import Any

from robid.settings.experiment import Experiment
from robid.settings.robot import RobotFile

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


def experiment_schema() -> dict[str, Any]:
    """Returns the JSON schema of the experiment file."""
    return {"$schema": _DIALECT, **Experiment.model_json_schema(by_alias=True)}


def robot_schema() -> dict[str, Any]:
    """Returns the JSON schema of the robot file."""
    return {"$schema": _DIALECT, **RobotFile.model_json_schema(by_alias=True)}
