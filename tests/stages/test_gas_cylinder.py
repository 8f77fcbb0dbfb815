"""A robot with a gas cylinder goes through the chain: simulated, its pressure identified, exported."""

import shutil
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from robid.settings.load import load_robot

HERE = Path(__file__).parent
CYLINDER = {
    "carrier_point_m": [-0.3, 0.1, 0.0], "link_point_m": [0.15, 0.0, 0.0], "free_length_m": 0.15,
    "area_m2": 2e-4, "rest_pressure_pa": 3e6, "rest_volume_m3": 2e-4, "exponent": 1.3,
}  # fmt: skip


@pytest.fixture
def swing(shop):
    """A folder with an arm that a gas cylinder carries."""
    shop.experiment, shop.runs = "trajectory.yaml", shop.folder / "runs" / "trajectory"
    yaml = YAML()
    for name in ("trajectory.yaml", "rigid_arm.yaml"):
        shutil.copy(HERE / name, shop.folder)
    content = yaml.load((shop.folder / "rigid_arm.yaml").read_text())
    content["joints"][0]["counterbalance"] = CYLINDER
    yaml.dump(content, shop.folder / "rigid_arm.yaml")
    text = (shop.folder / "trajectory.yaml").read_text()
    fit = "fits: {arm: {family: rigid, from: exciting, filters: {position_cut_hz: 10}, instruments: none}}\n"
    (shop.folder / "trajectory.yaml").write_text(text.replace("execution:", f"{fit}execution:"))
    return shop


def test_a_cylinder_is_simulated_and_its_pressure_identified(swing):
    answer = swing.robid("run", "trajectory.yaml", "--json")
    assert answer.code == 0, answer.err
    rows = {row["kind"]: row for row in answer.json["parameters"]["arm"] if row["name"] == "lift"}
    found = rows["counterbalance_pressure"]
    assert found["unit"] == "Pa"
    assert found["lower"] < CYLINDER["rest_pressure_pa"] < found["upper"]
    # Half of it is the torque constants'.
    assert found["upper"] / found["lower"] < 1.4
    answer = swing.robid("export", "trajectory.yaml", "--format", "robot", "--output", "found.yaml")
    assert answer.code == 0, answer.err
    written = load_robot(swing.folder / "found.yaml").joints[0].counterbalance
    assert written.rest_pressure_pa == pytest.approx(found["estimate"], rel=1e-6)
    assert written.exponent == CYLINDER["exponent"]


def test_another_pressure_is_another_simulation(swing):
    assert swing.robid("simulate-or-acquire", "trajectory.yaml").code == 3
    for stage in ("design-excitation", "simulate-or-acquire"):
        assert swing.robid(stage, "trajectory.yaml").code == 0
    swing.change("3000000.0", "2500000.0", "rigid_arm.yaml")
    assert swing.states()["exciting/record.h5"][0] == "stale"
