"""JSON schemas of the settings files, for editors."""

from __future__ import annotations

from typing import Any

from robid.settings.experiment import experiment_type
from robid.settings.fits import Families
from robid.settings.robot import RobotFile

_DIALECT = "https://json-schema.org/draft/2020-12/schema"


def experiment_schema_of(families: Families, study: Any = Any) -> dict[str, Any]:  # noqa: ANN401
    """Returns the JSON schema of the experiment file whose fits are of these families, with this type of study."""
    return {"$schema": _DIALECT, **experiment_type(families, study).model_json_schema(by_alias=True)}


def robot_schema() -> dict[str, Any]:
    """Returns the JSON schema of the robot file."""
    return {"$schema": _DIALECT, **RobotFile.model_json_schema(by_alias=True)}
