"""What a command imports before it computes anything."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

_ROOT = Path(__file__).parents[2]
_REPORT = "import json, sys; print(json.dumps(sorted(sys.modules)))"
_SCIENCE = ("results", "design", "simulate", "robot", "frf", "clusters", "signals", "models/*/fit", "models/*/judge")
HEAVY = ("scipy", "mujoco", "nlopt", "plotly", "jinja2", "matplotlib", "distributed", "dask")


def modules_after(code):
    """Names of all modules in a process of its own that ran some code."""
    done = subprocess.run(
        [sys.executable, "-c", f"{code}\n{_REPORT}"], cwd=_ROOT, capture_output=True, text=True, check=True
    )
    return set(json.loads(done.stdout.splitlines()[-1]))


def command(*arguments):
    return f"from robid.cli import run_command\nassert run_command({list(arguments)!r}) == 0"


def test_the_command_line_imports_nothing_heavy():
    found = modules_after("import robid.cli")
    assert "robid.pipeline.graph" in found
    assert found.isdisjoint({*HEAVY, "ruamel.yaml", "rich", "robid.settings.experiment"})


@pytest.mark.parametrize("experiment", ["configs/kr300.yaml", "tests/stages/bench.yaml"])
def test_status_imports_nothing_that_only_computing_needs(tmp_path, experiment):
    found = modules_after(command("status", experiment, "--run-dir", str(tmp_path)))
    assert "robid.settings.experiment" in found
    assert found.isdisjoint(HEAVY)


def test_explain_reads_no_settings_of_experiments():
    assert modules_after(command("explain", "S007")).isdisjoint({*HEAVY, "rich", "robid.settings.experiment"})


def test_no_package_of_science_comes_with_the_settings_and_the_families():
    found = modules_after("import robid.models.known")
    assert found.isdisjoint(
        {
            "robid.robot.model",
            "robid.models.elastic.fit.fitting",
            "robid.design.excitation.excitation",
            "robid.frf.estimate",
        }
    )


@pytest.mark.parametrize("module", ["models.elastic.fitting", "pipeline.report"])
def test_what_is_heavy_is_named_as_it_is_imported(module):
    """The names are right: what a family or a stage does needs some of them."""
    assert not modules_after(f"import robid.{module}").isdisjoint(HEAVY)


def test_science_loads_no_settings_files_or_pages():
    files = sorted(file for folder in _SCIENCE for file in (_ROOT / "robid").glob(f"{folder}/**/*.py"))
    names = [".".join(file.relative_to(_ROOT).with_suffix("").parts).removesuffix(".__init__") for file in files]
    assert len(names) > 100
    found = modules_after("\n".join(f"import {name}" for name in names))
    assert found.isdisjoint({"pydantic", "h5py", "typer", "rich", "ruamel.yaml", "plotly", "yaml", "robid.settings"})
