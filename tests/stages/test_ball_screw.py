"""A ball screw through the chain: resonances that move with the slide, a travelling slide, an exported model."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest
from ruamel.yaml import YAML

from robid.artifacts.kinds import (
    EXCITATION,
    FRF,
    RECORD,
    excitation_from_artifact,
    frf_from_artifact,
    record_from_artifact,
)
from robid.artifacts.store import read_artifact
from robid.cli import run_command
from robid.settings.load import load_robot

CONFIGS = Path(__file__).parents[2] / "configs"
PLACES = [-0.35, 0.4]
FIXED = ["coupling.stiffness", "coupling.damping"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The example in two places, with short periods, few lines and no friction; an elastic fit in place of its own."""
    folder = tmp_path_factory.mktemp("screw")
    data = YAML(typ="safe").load((CONFIGS / "ballscrew.yaml").read_text())
    data["robot"] = str(CONFIGS / data["robot"])
    del data["campaigns"]["choosing"]
    for campaign in data["campaigns"].values():
        campaign["excitation"] |= {"period_s": 1.024, "low_hz": 12, "count": 100}
        campaign |= {"realizations": 2, "periods": 2}
        campaign["source"]["simulate"]["imperfections"] |= {"friction": "none", "ripple": False}
    data["campaigns"]["global"] |= {"realizations": 1}
    data["campaigns"]["global"]["excitation"]["travel"]["amplitude_m"] = 0.2
    data["campaigns"]["local"]["configurations"] = {"list": [[place] for place in PLACES]}
    data["fits"] = {
        "elastic": {"family": "elastic", "from": "local", "validate_on": "left_out", "starts": 1, "fixed": FIXED}
    }
    data["execution"] = {"backend": "serial"}
    YAML().dump(data, folder / "screw.yaml")
    assert run_command(["run", str(folder / "screw.yaml"), "--run-dir", str(folder / "run")]) in (0, 5)
    return folder


def read(folder, name, kind, convert):
    return convert(read_artifact(folder / "run" / name, kind))


def test_resonances_move_with_the_slide(folder):
    frf = read(folder, "local/frf.h5", FRF, frf_from_artifact)
    size = np.abs(frf.response[..., 0, 0])
    quiet, loud = frf.frequency_hz[size.argmin(axis=1)], frf.frequency_hz[size.argmax(axis=1)]
    assert (quiet[0], loud[0]) > (1.2 * quiet[1], 1.2 * loud[1])
    assert frf.output_names == ("slide", "slide.arm")


def test_a_travelling_slide_is_in_the_record_alone(folder):
    assert not (folder / "run/global/frf.h5").exists()
    excitation = read(folder, "global/excitation.h5", EXCITATION, excitation_from_artifact).excitation
    record = read(folder, "global/record.h5", RECORD, record_from_artifact)
    told = excitation.travel[:, 0] / load_robot(CONFIGS / "robots/ballscrew.yaml").to_robot().gear_ratio[0]
    assert np.abs(told).max() == pytest.approx(0.2, rel=1e-6)
    place = record.outputs[0, 0, 0, :, :, 1]
    spectrum = 2 * np.fft.rfft(place, axis=1) / place.shape[1]
    assert 0.1 < np.abs(spectrum[:, 1]).max() < 0.25
    np.testing.assert_allclose(spectrum[0, 1], spectrum[1, 1], rtol=0.05)
    # The torque that is recorded holds the excitation, the motion at its lines is that of the slide.
    lines = np.abs(np.fft.rfft(record.inputs[0, 0, 0, 0, :, 0])[excitation.excited_lines])
    asked = np.abs(np.fft.rfft(excitation.reference[0, 0, :, 0])[excitation.excited_lines])
    assert 0.3 < np.median(lines / asked) < 1.5


def test_a_travel_is_exported_beside_its_excitation(folder, tmp_path):
    command = ["export", str(folder / "screw.yaml"), "--run-dir", str(folder / "run"), "--campaign", "global"]
    assert run_command([*command, "--format", "csv", "--output", str(tmp_path / "tables")]) == 0
    text = (tmp_path / "tables/excitation_r1_e1.csv").read_text()
    assert "Add each motor's travel to its angle reference meanwhile" in text
    header = next(line for line in text.splitlines() if "time [s]" in line)
    assert "slide travel [rad]" in header
    travel = read(folder, "global/excitation.h5", EXCITATION, excitation_from_artifact).excitation.travel
    rows = [line for line in text.splitlines() if line[:1].isdigit()]
    assert float(rows[7].split(",")[-1]) == pytest.approx(float(travel[7, 0]), rel=1e-6)


def test_the_law_is_scaled_by_the_fit(folder):
    summary = json.loads((folder / "run/summary.json").read_text())
    start = "fits.elastic.parameters.screw.stiffness"
    assert summary[f"{start}.estimate"] == pytest.approx(summary[f"{start}.truth"], rel=0.1)


def test_the_exported_model_has_the_stiffness_of_its_first_keyframe(folder):
    command = ["export", str(folder / "screw.yaml"), "--run-dir", str(folder / "run"), "--format", "mjcf"]
    assert run_command([*command, "--no-friction"]) == 0
    path = folder / "run/fits/elastic/export/model.xml"
    assert "Stiffness of gear_slide, screw depends on a joint's position; here it is that of" in path.read_text()
    model = mujoco.MjModel.from_xml_path(str(path))
    summary = json.loads((folder / "run/summary.json").read_text())
    for name, slope, row in (("gear_slide", 0.7175, model.tendon_stiffness[0]), ("screw", 1.818, None)):
        value = model.joint("q_e_screw").stiffness[0] if row is None else row
        wanted = summary[f"fits.elastic.parameters.{name}.stiffness.estimate"] / (1 + slope * PLACES[0])
        assert value == pytest.approx(wanted, rel=1e-6)
    assert model.joint("q_e_coupling").stiffness[0] > 0


def test_the_plan_counts_the_travel(folder):
    plan = read(folder, "global/excitation.h5", EXCITATION, excitation_from_artifact).excitation.plan
    ratio = load_robot(CONFIGS / "robots/ballscrew.yaml").to_robot().gear_ratio[0]
    assert plan.speed_peak[0, 0] > 0.5 * 2 * np.pi / 1.024 * 0.2 * ratio
    assert plan.excursion_peak[0, 0] < 0.01
