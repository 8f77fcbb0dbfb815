"""The table of parameter kinds: complete, and the only one."""

import re
from dataclasses import fields
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import robid
from exact_systems import springs_everywhere
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.parameters import (
    ELASTIC,
    LOGARITHMIC,
    PARAMETER_KINDS,
    RESPONSE_NUISANCE,
    ElasticKind,
    LogarithmicKind,
    ResponseNuisance,
    element_names,
    element_units,
    kind_of_name,
    name_of,
    owner_of,
)
from robid.robot.response import ElasticParameters, nominal_parameters


def test_kinds_are_those_of_the_model_and_of_the_settings():
    # Nuisances are estimated one by one, by their names.
    assert {*ELASTIC, "doubt"} == {field.name for field in fields(ElasticParameters)}
    assert get_args(ElasticKind) == ELASTIC
    assert get_args(LogarithmicKind) == LOGARITHMIC
    assert get_args(ResponseNuisance) == RESPONSE_NUISANCE


@pytest.mark.parametrize("kind", ELASTIC)
def test_every_element_has_a_unit_and_a_name_that_tells_its_kind(kind):
    robot = springs_everywhere()
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.zeros((1, 2))))
    count = getattr(nominal_parameters(robot, linear, 0.0), kind).size
    names = element_names(robot, kind)
    assert len(names) == len(element_units(robot, kind)) == count
    for name in filter(None, names):
        assert kind_of_name(name) == kind
        assert name_of(owner_of(name, kind), kind) == name


def test_no_other_module_lists_kinds_with_units_or_titles():
    told = [text for kind in PARAMETER_KINDS.values() for text in (kind.unit, kind.linear_unit, kind.title)]
    entry = re.compile(rf'"({"|".join(PARAMETER_KINDS)})": "({"|".join(map(re.escape, told))})"')
    folder = Path(robid.__file__).parent
    assert entry.search('{"stiffness": "N m/rad"}')
    assert [path.name for path in folder.rglob("*.py") if entry.search(path.read_text())] == []
