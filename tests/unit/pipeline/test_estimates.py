"""What stages need: by hand from the settings of a small experiment, and refused where the machine has less."""

import json
import re
import shutil
from pathlib import Path

import pytest

from robid.cli import run_command
from robid.models.known import load_experiment
from robid.pipeline import estimates
from robid.pipeline.estimates import estimate, memory_of_machine, size_text

_STAGES = Path(__file__).parents[2] / "stages"
_SAMPLING_S = 1e-3


@pytest.fixture
def folder(tmp_path, monkeypatch):
    for name in ("small.yaml", "arm.yaml"):
        shutil.copy(_STAGES / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _with(folder: Path, key: str, value: str) -> Path:
    text, count = re.subn(
        rf"\b{key}: [^,}}\n]+", f"{key}: {value}", (folder / "small.yaml").read_text(encoding="utf-8")
    )
    assert count
    (folder / "changed.yaml").write_text(text, encoding="utf-8")
    return folder / "changed.yaml"


def test_a_record_needs_its_samples_on_the_disk(folder):
    loaded = load_experiment(folder / "small.yaml")
    period_s = loaded.robot.controller.sampling_period_s
    samples = 2 * 2 * 2 * round(0.5 / period_s)  # realizations, experiments, periods, samples of a period
    channels = 2 + 2  # torques and angles
    found = estimate(loaded, "simulate-or-acquire", "validation", 1)
    assert found.disk_bytes == 8 * samples * channels
    assert found.memory_bytes >= 2 * 8 * samples * channels


@pytest.mark.parametrize("key", ["period_s", "periods", "realizations"])
def test_what_drives_an_estimate_is_named_and_proportional_to_it(folder, key):
    before = estimate(load_experiment(folder / "small.yaml"), "simulate-or-acquire", "validation", 1)
    value = {"period_s": 500, "periods": 2000, "realizations": 2000}[key]
    after = estimate(load_experiment(_with(folder, key, str(value))), "simulate-or-acquire", "validation", 1)
    assert after.memory_bytes == pytest.approx(1000 * before.memory_bytes)
    assert re.fullmatch(rf"campaigns\.validation\.(excitation\.)?{key}: {value}", after.driver)


def test_tasks_that_run_at_a_time_need_memory_each(folder):
    loaded = load_experiment(folder / "small.yaml")
    one, two, four = (estimate(loaded, "simulate-or-acquire", "estimation", workers) for workers in (1, 2, 4))
    assert two.memory_bytes == pytest.approx(2 * one.memory_bytes)
    assert four.memory_bytes == pytest.approx(two.memory_bytes), "there are two configurations"
    assert one.seconds > 1.5 * two.seconds


@pytest.mark.parametrize(
    "command", [("status",), ("run",), ("run", "--dry-run"), ("design-excitation", "--campaign", "validation")]
)
def test_what_the_machine_does_not_have_is_refused_before_it_begins(folder, command, monkeypatch, capsys):
    _with(folder, "period_s", "500")
    monkeypatch.setattr(estimates, "memory_of_machine", lambda: 160e6)
    name, *options = command
    assert run_command([name, "changed.yaml", *options]) == 2
    told = capsys.readouterr().err
    assert "S598" in told
    assert "excitation.period_s" in told
    assert not (folder / "runs/small/validation").exists()


def test_a_dry_run_says_what_each_stage_needs_and_writes_nothing(folder, capsys):
    _with(folder, "periods", "2000")
    assert run_command(["run", "changed.yaml", "--dry-run", "--json"]) == 0
    nodes = json.loads(capsys.readouterr().out)["nodes"]
    record = next(node for node in nodes if node["output"] == "estimation/record.h5")
    assert record["memory_bytes"] > 1e8
    assert record["driver"] == "campaigns.estimation.periods: 2000"
    assert run_command(["run", "changed.yaml", "--dry-run"]) == 0
    shown = capsys.readouterr().out
    assert size_text(record["memory_bytes"]) in shown
    assert not (folder / "runs").exists()


def test_the_machine_has_the_memory_that_the_system_says():
    text = Path("/proc/meminfo").read_text(encoding="ascii")
    total = 1024 * int(re.search(r"MemTotal: +(\d+) kB", text)[1])
    assert 1e8 < memory_of_machine() <= 1.01 * total
