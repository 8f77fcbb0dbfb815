"""The tutorials run from their first cell to their last, in an empty folder; each ends in an assertion of its own."""

import os
import sys
from pathlib import Path

import jupytext
import matplotlib as mpl
import pytest

TUTORIALS = sorted((Path(__file__).parents[2] / "docs" / "tutorials").glob("*.py"))


@pytest.mark.parametrize("path", TUTORIALS, ids=lambda path: path.stem)
def test_a_tutorial_runs_cell_by_cell(path, tmp_path, monkeypatch):
    mpl.use("Agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    cells = jupytext.read(path).cells
    assert cells[0].cell_type == "markdown"
    code = [cell.source for cell in cells if cell.cell_type == "code"]
    assert "assert " in code[-1]
    space = {"__name__": "__main__"}
    try:
        for number, source in enumerate(code, 1):
            exec(compile(source, f"{path.name}, cell {number}", "exec"), space)
    finally:
        sys.modules["matplotlib.pyplot"].close("all")
