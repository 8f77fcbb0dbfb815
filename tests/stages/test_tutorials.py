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


MARK = "# <--"
THREE = """\
<robot name="three"><link name="world"/>{links}{joints}</robot>
"""
LINK = """<link name="l{n}"><inertial><origin xyz="0.2 0 0"/><mass value="6"/>
<inertia ixx="0.05" iyy="0.2" izz="0.2" ixy="0" ixz="0" iyz="0"/></inertial></link>"""
JOINT = """<joint name="j{n}" type="revolute"><parent link="{parent}"/><child link="l{n}"/><origin xyz="0.4 0 0.1"/>
<axis xyz="0 {y} {z}"/><limit lower="-1" upper="0.8" effort="200" velocity="3"/></joint>"""


def test_the_tutorial_of_an_own_arm_needs_its_marked_lines_alone(tmp_path, monkeypatch):
    mpl.use("Agg")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    parents = ("world", "l1", "l2")
    joints = [JOINT.format(n=n, parent=parent, y=n % 2, z=1 - n % 2) for n, parent in enumerate(parents, 1)]
    links = [LINK.format(n=n) for n in (1, 2, 3)]
    Path("three.urdf").write_text(THREE.format(links="".join(links), joints="".join(joints)), encoding="utf-8")
    path = next(one for one in TUTORIALS if one.stem == "own_arm")
    code = [cell.source for cell in jupytext.read(path).cells if cell.cell_type == "code"]
    marked = [at for at, source in enumerate(code) if MARK in source]
    assert len(marked) == 1
    assert sum(line.count(MARK) for line in code[marked[0]].splitlines()) <= 2
    code[marked[0]] = code[marked[0]].replace('"two_joints.urdf"', '"three.urdf"')
    space = {"__name__": "__main__"}
    for number, source in enumerate(code, 1):
        if '"run"' in source or "run.fits" in source or source.startswith("assert"):
            continue  # a fit takes minutes, and is not what depends on the robot
        own = source.replace("arm.with_fit(fit)", "arm")
        exec(compile(own, f"{path.name}, cell {number}", "exec"), space)
    assert space["arm"].joints == ("j1", "j2", "j3")
    assert space["design"].configurations.shape == (60, 3)
    sys.modules["matplotlib.pyplot"].close("all")
