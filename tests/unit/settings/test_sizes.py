"""Every count has a bound, and what the settings ask for is held against it before anything is laid out."""

import re
import time
import tracemalloc
from pathlib import Path
from typing import Any

import pytest

from robid.errors import SettingsError
from robid.models.known import experiment_schema, load_experiment
from robid.settings.checks.sizes import MOST_CONFIGURATIONS
from robid.settings.load import robot_schema

_STAGES = Path(__file__).parents[2] / "stages"
_NOT_COUNTED = {"seed", "draw_seed", "first_seed"}


def _unbounded(name: str, field: dict[str, Any]) -> bool:
    members = [field, *field.get("anyOf", ())]
    whole = [one for one in members if one.get("type") == "integer"]
    return name not in _NOT_COUNTED and any("maximum" not in one and "enum" not in one for one in whole)


@pytest.mark.parametrize("schema", [experiment_schema(), robot_schema()], ids=["experiment", "robot"])
def test_every_count_of_the_schema_has_a_bound(schema):
    sections = {"file": schema, **schema["$defs"]}
    keys = {section: node.get("properties", {}) for section, node in sections.items()}
    fields = [(section, name, one) for section, node in keys.items() for name, one in node.items()]
    assert len(fields) > 100
    assert [(section, name) for section, name, one in fields if _unbounded(name, one)] == []


def _changed(folder: Path, changes: dict[str, str]) -> Path:
    """The small experiment with other values, each in the first place where its key stands."""
    for name in ("small.yaml", "arm.yaml"):
        (folder / name).write_text((_STAGES / name).read_text(encoding="utf-8"), encoding="utf-8")
    text = (folder / "small.yaml").read_text(encoding="utf-8")
    for key, value in changes.items():
        text, count = re.subn(rf"\b{key}: [^,}}\n]+", f"{key}: {value}", text, count=1)
        assert count == 1, key
    (folder / "changed.yaml").write_text(text, encoding="utf-8")
    return folder / "changed.yaml"


@pytest.mark.parametrize(
    ("changes", "code", "setting"),
    [
        ({"period_s": "1.0e+9"}, "S383", "excitation.period_s"),
        ({"period_s": "1.0e+5"}, "S595", "excitation.period_s"),
        ({"high_hz": "1.0e+12"}, "Nyquist", "excitation"),
        ({"low_hz": "1.0e+300"}, "S027", "excitation"),
        ({"count": "1000000000"}, "S383", "configurations.random.count"),
        ({"phase_iterations": "1000000000"}, "S383", "excitation.phase_iterations"),
        ({"periods": "1000000"}, "S383", "periods"),
        ({"realizations": "1000000000"}, "S383", "realizations"),
        ({"starts": "1000000000000"}, "S383", "starts"),
        ({"starts": "1.0e+12"}, "S383", "starts"),
    ],
)
def test_what_is_too_much_is_refused_at_once_with_its_setting(tmp_path, changes, code, setting):
    path = _changed(tmp_path, changes)
    tracemalloc.start()
    begun = time.monotonic()
    try:
        with pytest.raises(SettingsError) as caught:
            load_experiment(path)
    finally:
        largest = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert time.monotonic() - begun < 10.0
    assert largest < 150e6
    first = str(caught.value).splitlines()[0]
    assert code in first
    assert f".{setting}: " in first


@pytest.mark.parametrize(
    ("choice", "setting"),
    [
        ("{grid_deg: [" + ", ".join([str([*range(300)])] * 2) + "]}", "configurations.grid_deg"),
        ("{random: {count: 1000000000}}", "configurations.random.count"),
        (
            "{join: [{list_deg: [[0, 0]]}" + ", {random: {count: 9999}}" * 3 + "]}",
            "configurations.join[2].random.count",
        ),
    ],
    ids=["grid", "random", "joined"],
)
def test_configurations_are_counted_before_any_is_made(tmp_path, choice, setting):
    path = _changed(tmp_path, {})
    text = path.read_text(encoding="utf-8").replace("{list_deg: [[20, 30]]}", choice)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(SettingsError, match=re.escape(f"campaigns.validation.{setting}: ")) as caught:
        load_experiment(path)
    assert f"{MOST_CONFIGURATIONS:,}" in str(caught.value) or "S383" in str(caught.value)


@pytest.mark.parametrize("name", ["{configuration:099999999d}", "{configuration.real}", "{configuration!r}", "{0}"])
def test_a_path_has_numbers_of_a_usual_width(tmp_path, name):
    lines = (_STAGES / "bench.yaml").read_text(encoding="utf-8").replace("log.mat", f"'{name}.mat'")
    (tmp_path / "bench.yaml").write_text(lines, encoding="utf-8")
    robot = (_STAGES / "bench_robot.yaml").read_text(encoding="utf-8")
    (tmp_path / "bench_robot.yaml").write_text(robot, encoding="utf-8")
    with pytest.raises(SettingsError, match="S234"):
        load_experiment(tmp_path / "bench.yaml")


def test_thousands_of_wrong_values_are_told_in_some_lines(tmp_path):
    path = _changed(tmp_path, {"name": "\n".join(["small", *(f"wrong_{number}: 1" for number in range(5_000))])})
    begun = time.monotonic()
    with pytest.raises(SettingsError) as caught:
        load_experiment(path)
    assert time.monotonic() - begun < 10.0
    assert 50 < len(str(caught.value).splitlines()) < 200
