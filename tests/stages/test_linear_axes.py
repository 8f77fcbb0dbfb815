"""A gantry through the chain: linear axes and a rigid one in report, summary and exported model."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from ruamel.yaml import YAML

from robid.cli import run_command

CONFIGS = Path(__file__).parents[2] / "configs"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The example with two configurations, short periods and few lines."""
    folder = tmp_path_factory.mktemp("gantry")
    data = YAML(typ="safe").load((CONFIGS / "gantry.yaml").read_text())
    data["robot"] = str(CONFIGS / data["robot"])
    data["campaigns"]["estimation"]["configurations"] = {"list": [[1, -1.2, 0], [2, 1.2, -0.7]]}
    for campaign in data["campaigns"].values():
        campaign["excitation"] |= {"period_s": 2, "count": 30}
        campaign |= {"realizations": 2, "periods": 1}
    data["fits"]["elastic"]["starts"] = 1
    data["execution"] = {"backend": "serial"}
    YAML().dump(data, folder / "gantry.yaml")
    assert run_command(["run", str(folder / "gantry.yaml"), "--run-dir", str(folder / "run")]) == 0
    return folder


def test_springs_along_lines_come_back_in_their_unit(folder):
    summary = json.loads((folder / "run/summary.json").read_text())
    for spring in ("gear_x", "gear_y", "yaw"):
        start = f"fits.elastic.parameters.{spring}.stiffness"
        assert summary[f"{start}.estimate"] == pytest.approx(summary[f"{start}.truth"], rel=0.02)
    page = (folder / "run/report.html").read_text()
    assert "x [m]" in page
    assert "x [°]" not in page
    assert "MN/m" in page


def test_exported_model_slides(folder):
    command = [
        "export",
        str(folder / "gantry.yaml"),
        "--run-dir",
        str(folder / "run"),
        "--format",
        "mjcf",
        "--no-friction",
    ]
    assert run_command(command) == 0
    model = mujoco.MjModel.from_xml_path(str(folder / "run/fits/elastic/export/model.xml"))
    assert all(model.joint(f"q_a_{axis}").type[0] == mujoco.mjtJoint.mjJNT_SLIDE for axis in "xyz")
    names = [model.joint(index).name for index in range(model.njnt)]
    assert [name for name in names if name.startswith("q_m_")] == ["q_m_x", "q_m_y"]
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 1)
    mujoco.mj_forward(model, data)
    # At rest: the holding torque carries the ram, to twelve digits of positions on springs of 1e7 N/m.
    assert np.abs(data.qacc).max() < 1e-4
    assert np.abs(data.ctrl[2]) > 1.0
