"""Real logs whose signal nobody here designed: responses against the figures that come with the recordings."""

from pathlib import Path

import numpy as np
import pytest

from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.cli import run_command

CONFIGS = Path(__file__).parents[2] / "configs"
MASS_KG = 95.1089  # published, by inverse-dynamics least squares
GEAR = {"joint_1": 32, "joint_4": -48}
ROTOR_KGM2 = {"joint_1": 0.362, "joint_4": 0.0313}  # published, on the joint's side; the arm adds to it
LISTED = """schema_version: 1
name: listed
robot: {robot}
campaigns:
  estimation:
    configurations: {{list_deg: [[0]]}}
    excitation: {{period_s: 1, {lines}}}
    periods: 19
    source:
      acquire:
        file: ${{ROBID_DATA}}/motor_bench/MultisineTypeA.mat
        format: mat
        sampling_period_s: 4.0e-4
        drop_periods: 1
        inputs:
          - {{name: drive, variable: iq_adx, unit: A, torque_constant_nm_a: 1, normalised: true, hold: band_limited}}
        outputs:
          - {{name: drive, variable: theta_mx}}
          - {{name: drive.arm, variable: theta_my, sign: -1}}
    estimate: {{compensation: none}}
fits:
  two_mass:
    family: elastic
    from: estimation
    free: [stiffness, damping, viscous, motor_inertia, link_inertia, delay]
    starts: 4
execution: {{backend: serial}}
"""


@pytest.fixture
def responses(data_folder, tmp_path, monkeypatch):
    """Runs an experiment in a folder of its own and returns its responses by campaign."""

    def run(folder, experiment, code=0):
        monkeypatch.setenv("ROBID_DATA", str(data_folder(folder).parent))
        monkeypatch.chdir(tmp_path)
        assert run_command(["run", str(experiment)]) == code
        found = sorted(tmp_path.glob("runs/*/*/frf.h5"))
        return {path.parent.name: frf_from_artifact(read_artifact(path, FRF)) for path in found}

    return run


def test_a_carriage_has_the_mass_that_was_published(responses):
    found = responses("emps", CONFIGS / "emps_response.yaml")
    for name, tolerance in (("arbitrary", 0.05), ("instrument", 0.05), ("periodic", 0.12)):
        frf = found[name]
        response, kept = frf.response[0, :, 0, 0], np.isfinite(frf.element_variance()[0, :, 0, 0])
        used = kept & (frf.frequency_hz < 20)  # a resonance follows
        assert np.median(1 / np.abs(response[used])) == pytest.approx(MASS_KG, rel=tolerance), name
        assert np.median(np.abs(np.angle(response[used], deg=True))) < 15, name
    assert found["instrument"].frequency_hz.tolist() == list(range(3, 31))
    radius = found["arbitrary"].error_radius(0.95) / np.abs(found["arbitrary"].response)
    assert np.median(radius) < 0.05


def test_single_axes_of_a_robot_carry_their_rotor_at_least(responses):
    found = responses("tx40", CONFIGS / "tx40_responses.yaml")
    for name, rotor in ROTOR_KGM2.items():
        frf = found[name]
        telling = (frf.coherence[0, :, 0] > 0.9) & np.isfinite(frf.element_variance()[0, :, 0, 0])
        assert telling.sum() >= 6
        inertia = GEAR[name] ** 2 * (1 / frf.response[0, telling, 0, 0]).real
        assert inertia.min() > rotor, name
        assert np.median(inertia) < 6 * rotor, name
    assert found["joint_4"].dropped.sum() > 0
    assert any("coherence is below 0.9" in note for note in found["joint_4"].notes)


# 240 lines were played, from 11 to 250: all, found, or some whose numbers are stated.
CHOSEN = [*range(11, 53), *range(53, 57), *range(60, 90, 2), 100, 120, 140, 160, 180, 200, 220, 240, 250]


@pytest.mark.parametrize(
    ("lines", "count"),
    [
        ("low_hz: 2, high_hz: 400, grid: full, lines: found", 240),
        ("low_hz: 11, high_hz: 250, grid: full, lines: all", 240),
        (f"lines: {CHOSEN}", len(CHOSEN)),
    ],
)
def test_a_drive_is_that_of_its_reference_whichever_way_its_lines_are_said(responses, tmp_path, capsys, lines, count):
    file = tmp_path / "listed.yaml"
    file.write_text(LISTED.format(robot=CONFIGS / "robots/motor_bench.yaml", lines=lines))
    frf = responses("motor_bench", file, 5)["estimation"]
    assert len(frf.lines) == count
    assert not frf.dropped.any()
    told = capsys.readouterr()
    assert ("Lines found to be excited: 11-250" in told.out + told.err) == ("found" in lines)
    summary = (tmp_path / "runs/listed/summary.json").read_text()
    assert '"fits.two_mass.parameters.coupling.stiffness.estimate": 54' in summary  # published: 546.4 per A
