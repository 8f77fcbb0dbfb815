"""The page of the Python interface says every field of what it returns, and every option of what it offers."""

import dataclasses
import importlib.util
import sys

import pytest

import robid
from settings_tables import ROOT


@pytest.fixture(scope="module")
def reference():
    spec = importlib.util.spec_from_file_location("site_reference", ROOT / "docs/site/reference.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


CLASSES = [name for name in robid.__all__ if dataclasses.is_dataclass(getattr(robid, name))]


@pytest.mark.parametrize("name", CLASSES)
def test_every_field_of_a_class_is_on_the_page_with_what_it_means(reference, name):
    rows = {row.split("|")[1].strip(" `"): row for row in reference.fields(getattr(robid, name)).splitlines()[2:]}
    assert list(rows) == [field.name for field in dataclasses.fields(getattr(robid, name))]
    assert [field for field, row in rows.items() if not row.split("|")[-2].strip()] == []
    page = reference.python()
    assert reference.fields(getattr(robid, name)) in page


def test_every_option_is_on_the_page_with_its_description(reference):
    page = reference.python()
    for kind in (kind for kinds in reference.OPTIONS.values() for kind in kinds.values()):
        table = reference.options_table(kind)
        assert table in page
        for field in dataclasses.fields(kind):
            row = next(line for line in table.splitlines() if line.startswith(f"| `{field.name}` |"))
            assert row.endswith(f" {field.metadata['description'].replace('|', chr(92) + '|')} |")


def test_comments_above_a_field_and_behind_it_are_both_read(reference):
    found = reference.comments(reference.Frf)
    assert "odd nonlinear" not in found["frequency_hz"]
    assert found["sampling_period_s"] == "Sampling period of the experiment [s]"
    assert found["coefficient_offset"] == "None for no distance"
