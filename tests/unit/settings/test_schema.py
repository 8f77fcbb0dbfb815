from functools import partial
from typing import Any

import pytest

from robid.models.known import experiment_schema
from robid.settings.load import robot_schema
from robid.studies.settings.study import Study

SCHEMAS = {"experiment": partial(experiment_schema, study=Study), "robot": robot_schema}


def _objects(schema: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {**schema["$defs"], "root": schema}


@pytest.mark.parametrize("kind", SCHEMAS)
def test_every_model_and_field_is_described(kind):
    schema = SCHEMAS[kind]()
    silent = []
    for model, node in _objects(schema).items():
        if "description" not in node:
            silent.append(model)
        for name, field in node["properties"].items():
            target = schema["$defs"].get(field.get("$ref", "").rpartition("/")[2], {})
            if not (field.get("description") or target.get("description")):
                silent.append(f"{model}.{name}")
    assert silent == []


@pytest.mark.parametrize("kind", SCHEMAS)
def test_unknown_keys_are_refused_everywhere(kind):
    for model, node in _objects(SCHEMAS[kind]()).items():
        assert node["additionalProperties"] is False, model


def test_constraints_and_file_names_of_fields_reach_the_schema():
    schema = experiment_schema()["$defs"]
    assert schema["MultisineOptions"]["properties"]["period_s"]["exclusiveMinimum"] == 0
    assert schema["ElasticFit"]["properties"]["confidence"]["exclusiveMaximum"] == 1
    assert "from" in schema["ElasticFit"]["required"]
    assert {"from", "list_deg", "list", "random", "grid_deg", "grid", "mirror", "join"} == set(
        schema["Configurations"]["properties"]
    )
    assert schema["Configurations"]["maxProperties"] == 1
