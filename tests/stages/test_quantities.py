"""Logs of other quantities, one shots and files of schema 1.x, through the command line."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat

from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.store import read_artifact

N_SAMPLE, STEP_S, LINES, GAIN = 500, 1e-3, np.arange(10, 81), 0.9
INPUTS = "inputs: [{name: drive, variable: current, unit: A, torque_constant_nm_a: 1, normalised: true}]"
COMMAND = "inputs: [{name: drive, variable: told, unit: rpm}]"


@pytest.fixture
def bench(shop):
    """A bench whose log has a speed reference, of which the motor's speed is `GAIN`."""
    for name in ("bench.yaml", "bench_robot.yaml"):
        shutil.copy(Path(__file__).parent / name, shop.folder)
    shop.runs, shop.experiment = shop.folder / "runs" / "bench", "bench.yaml"
    shop.change(INPUTS, COMMAND, "bench.yaml")
    spectrum = np.zeros(N_SAMPLE // 2 + 1, complex)
    spectrum[LINES] = np.exp(2j * np.pi * np.random.default_rng(3).uniform(size=LINES.size))
    turned = np.zeros_like(spectrum)
    turned[LINES] = GAIN * spectrum[LINES] / (2j * np.pi * LINES / (N_SAMPLE * STEP_S))
    told, motor = (np.tile(np.fft.irfft(one, N_SAMPLE), 5) for one in (spectrum, turned))
    time = np.arange(told.size) * STEP_S
    columns = {"time": 1e3 * time, "told": told * 30 / np.pi, "motor": motor, "load": -np.degrees(2 * motor)}
    savemat(shop.folder / "log.mat", {name: values[:, None] for name, values in columns.items()})
    return shop


def test_a_response_from_a_command_is_no_elastic_models(bench):
    answer = bench.robid("run", "bench.yaml")
    assert answer.code == 4, answer.err
    assert (
        "An elastic model needs responses from motor torque or current to acceleration; this one is from motor speed"
        " reference (drive) to motor angle (drive), arm angle (drive.arm)"
    ) in answer.flat
    frf = frf_from_artifact(read_artifact(bench.runs / "log" / "frf.h5", FRF))
    exact = GAIN / (2j * np.pi * frf.frequency_hz)
    np.testing.assert_allclose(frf.response[0, :, :, 0], np.stack([exact, 2 * exact], axis=1), rtol=1e-5)
    shown = bench.robid("inspect", str(bench.runs / "log" / "frf.h5"))
    assert "output_channels: motor angle of drive [rad], arm angle of drive.arm [rad]" in shown.out


def test_friction_is_left_alone_where_no_torque_was_logged(bench):
    bench.change("    estimate: {compensation: none}\n", "", "bench.yaml")
    assert bench.robid("design-excitation", "bench.yaml").code == 0
    assert bench.robid("simulate-or-acquire", "bench.yaml").code == 0
    assert bench.robid("estimate-frf", "bench.yaml").code == 0
    frf = frf_from_artifact(read_artifact(bench.runs / "log" / "frf.h5", FRF))
    assert frf.compensation == "none"
    assert [note for note in frf.notes if note.startswith("No friction was subtracted")]
    bench.change("    periods: 4\n", "    periods: 4\n    estimate: {compensation: nominal}\n", "bench.yaml")
    told = "estimate.compensation: S221 friction is subtracted from motor torques, not from a speed reference"
    bench.refuse(2, told, command=("estimate-frf", "bench.yaml", "--force"))


def test_one_shot_is_imported_and_no_more(bench):
    bench.change("        drop_periods: 1\n", "        one_shot: true\n", "bench.yaml")
    text = (bench.folder / "bench.yaml").read_text()
    bench.refuse(2, "fits.two_mass.from: S195 campaign `log` is one shot", command=("run", "bench.yaml"))
    (bench.folder / "bench.yaml").write_text(text[: text.index("fits:")])
    answer = bench.robid("run", "bench.yaml")
    assert answer.code == 0, answer.err
    assert list(bench.contents()) == ["log/record.h5"]
    record = record_from_artifact(read_artifact(bench.runs / "log" / "record.h5", RECORD))
    assert record.is_one_shot
    assert record.inputs.shape == (1, 1, 1, 1, 5 * N_SAMPLE, 1)
    assert set(bench.states().values()) == {("fresh", "")}
    bench.refuse(2, "estimate-frf", command=("estimate-frf", "bench.yaml", "--campaign", "log"))


def test_one_shot_needs_no_configurations_but_periods_do(bench):
    bench.change("configurations: {list_deg: [[0]]}", "payload_kg: null", "bench.yaml")
    told = "campaigns.log.configurations: S178"
    bench.refuse(2, told, command=("run", "bench.yaml"))
    bench.change("        drop_periods: 1\n", "        one_shot: true\n", "bench.yaml")
    text = (bench.folder / "bench.yaml").read_text()
    text = text[: text.index("fits:")]
    (bench.folder / "bench.yaml").write_text(f"{text}designs: {{some: {{campaign: log, count: 1}}}}\n")
    told = "designs.some.campaign: S159 campaign `log` is one shot without configurations to choose from"
    bench.refuse(2, told, command=("run", "bench.yaml"))
    (bench.folder / "bench.yaml").write_text(text)
    answer = bench.robid("run", "bench.yaml")
    assert answer.code == 0, answer.err
    assert record_from_artifact(read_artifact(bench.runs / "log" / "record.h5", RECORD)).configurations is None


def test_every_log_of_a_recording_counts_for_staleness(bench):
    bench.change("        drop_periods: 1\n", "        one_shot: true\n", "bench.yaml")
    bench.change("variable: told", "variable: second, file: 'told_{realization}.mat'", "bench.yaml")
    text = (bench.folder / "bench.yaml").read_text()
    (bench.folder / "bench.yaml").write_text(text[: text.index("fits:")])
    missing = bench.robid("run", "bench.yaml")
    assert missing.code == 4
    assert "told_1.mat" in missing.flat
    told = np.linspace(0, 1, 5 * N_SAMPLE)[:, None]
    savemat(bench.folder / "told_1.mat", {"second": told})
    assert bench.robid("run", "bench.yaml").code == 0
    assert set(bench.states().values()) == {("fresh", "")}
    savemat(bench.folder / "told_1.mat", {"second": 2 * told})
    assert {state for state, _ in bench.states().values()} == {"stale"}
    bench.change("realizations: 1", "realizations: 2", "bench.yaml")
    bench.change("told_{realization}.mat", "told_1.mat", "bench.yaml")
    bench.refuse(
        2, "inputs[1].file: S235 there is one log for each of 2 realizations", command=("status", "bench.yaml")
    )


@pytest.mark.parametrize(
    ("old", "new", "texts"),
    [
        ("list_deg: [[0]]", "list_deg: [[0], [5]]", ("configurations", "S212")),
        ("one_shot: true", "one_shot: true\n        drop_periods: 1", ("drop_periods: S213",)),
    ],
)
def test_what_one_shot_cannot_have_is_told(bench, old, new, texts):
    bench.change("        drop_periods: 1\n", "        one_shot: true\n", "bench.yaml")
    bench.change(old, new, "bench.yaml")
    bench.refuse(2, *texts, command=("status", "bench.yaml"))


@pytest.mark.parametrize(
    ("name", "made_by", "reader"),
    [("record", "simulate-or-acquire", "estimate-frf"), ("frf", "estimate-frf", "fit")],
)
def test_files_of_schema_1_are_refused_and_can_be_made_again(bench, name, made_by, reader):
    bench.robid("run", "bench.yaml")
    path = bench.runs / "log" / f"{name}.h5"
    with h5py.File(path, "r+") as file:
        file.attrs["schema_version"] = np.bytes_("1.2")
    again = (made_by, "bench.yaml", "--campaign", "log", "--force")
    told = (
        f"log/{name}.h5",
        "has schema version 1.2; this robid reads 2.x",
        f"robid {' '.join(again)}",
    )
    bench.refuse(3, *told, command=(reader, "bench.yaml"))
    assert bench.robid(*again).code == 0
    read_artifact(path, {"record": RECORD, "frf": FRF}[name])
