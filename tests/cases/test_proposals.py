"""What `robid inspect` proposes for logs that it once read wrongly: it runs, or stops at what a person must say."""

import re

import numpy as np
import pytest

from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.store import read_artifact
from robid.models.known import load_experiment


def propose(folder, *log, options=()):
    """Inspects a log and proposes an experiment file; returns what was found and the file's text."""
    answer = folder.robid("inspect", *log, "--propose", "own.yaml", "--json", *options)
    assert answer.code == 0, answer.err
    return answer.json, (folder.folder / "own.yaml").read_text()


def acquired(folder):
    return load_experiment(folder.folder / "own.yaml").experiment.campaigns["log"].source.acquire


def remarks_of(found, name):
    return next(one for one in found["signals"] if one["name"] == name)["remarks"]


@pytest.mark.parametrize(
    ("log", "step"),
    [("x_delay.csv", 1e-3), ("x_jitter.csv", 1e-3), ("const_stamp_and_time.csv", 1e-3), ("bag_zero_stamps", 1e-3)],
)
def test_what_never_changes_is_no_clock(case, log, step):
    folder = case("constant_time_column")
    found, _ = propose(folder, log)
    assert found["sampling"]["step_s"] == pytest.approx(step, rel=1e-6)
    assert found["sampling"]["variable"] in ("time [s]", "/joint_states.log_time")
    assert folder.robid("design-excitation", "own.yaml").code == 0
    assert folder.robid("simulate-or-acquire", "own.yaml").code == 0


def test_where_nothing_but_a_constant_is_a_time_the_run_stops_and_asks(case):
    folder = case("constant_time_column")
    found, _ = propose(folder, "const_stamp.csv")
    assert found["sampling"]["step_s"] is None
    answer = folder.robid("run", "own.yaml")
    assert answer.code == 2
    assert "sampling_period_s" in answer.err


@pytest.mark.parametrize(("log", "step"), [("lab250.lvm", 2.5e-4), ("dspace.mat", 1e-3)])
def test_an_even_ramp_is_time_and_no_output(case, log, step):
    folder = case("dspace_lvm")
    found, _ = propose(folder, log)
    assert found["sampling"]["step_s"] == pytest.approx(step)
    acquire = acquired(folder)
    assert acquire.sampling_period_s == pytest.approx(step)
    assert len(acquire.outputs) == 1
    assert acquire.outputs[0].variable in ("Motor angle", "rec1_001.Y{2}.Data")


@pytest.mark.parametrize("log", ["hop_deg.csv", "wrap_deg.csv"])
def test_wrapped_angles_are_proposed_unwrapped_and_give_the_response(case, log):
    folder = case("angle_wraps")
    propose(folder, log)
    acquire = acquired(folder)
    assert [one.unwraps for one in acquire.outputs] == [True, True]
    for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
        answer = folder.robid(stage, "own.yaml")
        assert answer.code == 0, answer.err
    found = frf_from_artifact(read_artifact(folder.folder / "runs/own/log/frf.h5", FRF))
    # Below the antiresonance motor and load move as one inertia, whose acceleration per torque is the same all over.
    response = found.response[0, :, :, 0]
    known = found.error_radius(0.95)[0, :, :, 0] / np.abs(response)
    assert np.median(known[:, 0]) < 0.05
    low = response[:8]
    assert np.allclose(low[:, 0] / low[:, 1], 1, rtol=0.04)
    assert np.ptp(low[:, 0].real) < 0.05 * np.abs(low[:, 0]).mean()


def test_numbers_that_no_log_states_are_asked_for(case):
    folder = case("invented_numbers")
    _, text = propose(folder, "cnt.csv")
    assert "counts_per_turn:" not in text
    answer = folder.robid("run", "own.yaml")
    assert answer.code == 2
    assert "counts_per_turn" in answer.err
    assert "data sheet" in answer.err
    filled = text.replace("unit: counts}", f"unit: counts, counts_per_turn: {2**20}}}")
    assert filled != text
    (folder.folder / "own.yaml").write_text(filled)
    assert folder.robid("run", "own.yaml").code == 0


def test_a_sampling_period_that_no_log_states_is_asked_for(case):
    folder = case("invented_numbers")
    rows = (folder.folder / "de.csv").read_text().splitlines()
    bare = "\n".join(row.partition(";")[2] for row in rows)
    (folder.folder / "bare.csv").write_text(bare)
    _, text = propose(folder, "bare.csv")
    assert not re.search(r"^ *(sampling_period_s|excitation):", text, re.MULTILINE)
    answer = folder.robid("run", "own.yaml")
    assert answer.code == 2
    assert "sampling_period_s: S381" in answer.err
    (folder.folder / "own.yaml").unlink()
    _, text = propose(folder, "bare.csv", options=("--sampling-period", "2.5e-4"))  # as its comment says
    assert folder.robid("run", "own.yaml").code == 0
    assert acquired(folder).sampling_period_s == 2.5e-4


@pytest.mark.parametrize("log", ["rehead.csv", "tofile.mat"])
def test_reasons_are_told_where_nothing_is_left(case, log):
    folder = case("rows_not_columns")
    answer = folder.robid("inspect", log)
    assert answer.code in (0, 4)
    if answer.code:
        assert re.search(r"line 3002|shape \(4, 6000\)", answer.err), answer.err


def test_an_exact_derivative_has_the_factor_one(case):
    folder = case("inspect_proposals")
    found, _ = propose(folder, "m1.csv")
    for joint in (1, 2):
        told = " ".join(remarks_of(found, f"act_vel_deg_per_s_{joint}"))
        assert "1.000 times (the same unit) the derivative" in told
    assert [one["unit"] for one in found["signals"]] == [""] * len(found["signals"])
    assert {one.unit for one in acquired(folder).outputs} == {"deg"}
    assert {one.unit for one in acquired(folder).inputs} == {"N m"}


def test_a_jittered_clock_is_resampled_all_over_the_log(case):
    folder = case("inspect_proposals")
    propose(folder, "m2.csv")
    acquire = acquired(folder)
    assert (acquire.resample, acquire.is_cut) == ("time", False)
    answer = folder.robid("simulate-or-acquire", "own.yaml")
    assert answer.code == 0, answer.err
    record = record_from_artifact(read_artifact(folder.folder / "runs/own/log/record.h5", RECORD))
    length = record.sampling_period_s * record.inputs.shape[-2]
    assert length == pytest.approx(8.81, rel=2e-3)
    # The log is noiseless: an angle of 0.24 Hz, and its torque.
    table = np.loadtxt(folder.folder / "m2.csv", delimiter=",", skiprows=1)
    time = table[0, 0] + record.sampling_period_s * np.arange(record.inputs.shape[-2])
    wanted = np.interp(time, table[:, 0], table[:, 1])
    given = (record.outputs[0, 0, 0] + record.output_offset[0]).reshape(-1, 2)[:, 0]
    assert np.abs(np.abs(given) - np.abs(wanted)).max() < 1e-4


def test_the_collocated_motion_is_the_motors(case):
    folder = case("inspect_proposals")
    _, text = propose(folder, "side_fine.csv")
    places = re.findall(r"\{name: (drive\S*), variable: (enc\d_mm)", text)
    assert places == [("drive", "enc1_mm"), ("drive.arm", "enc2_mm")]
    answer = folder.robid("run", "own.yaml")
    assert answer.code == 2  # what a volt of the amplifier stands for is not in the log
    assert "inputs[1].unit" in answer.err
    (folder.folder / "own.yaml").write_text(text.replace("unit: V", "unit: N, scale: 1"))
    assert folder.robid("run", "own.yaml").code == 0
