"""Logs of common tools that were read wrongly, or not at all."""

import numpy as np
import pytest
from ruamel.yaml import YAML

from robid.artifacts.kinds import FRF, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.logs.formats.load import load_variables


def proposal(case, log, *options):
    """What is proposed of a log, below `acquire`."""
    answer = case.robid("inspect", log, "--propose", "p.yaml", *options)
    assert answer.code == 0, answer.err
    return YAML(typ="safe").load(case.folder / "p.yaml")["campaigns"]["log"]


def response_of_proposal(case):
    """The response of the proposal as it is written."""
    for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
        answer = case.robid(stage, "p.yaml", "--run-dir", "run", "--force")
        assert answer.code == 0, answer.err
    return frf_from_artifact(read_artifact(case.folder / "run/log/frf.h5", FRF))


@pytest.mark.parametrize("log", ["twincat.csv", "twincat_eof.csv"])
def test_an_export_of_twincat_has_names_and_times(case, log):
    one = case("twincat")
    found = load_variables(one.folder / log)
    assert {"ActTorque", "ActPosMotor", "ActPosLoad"} < set(found)
    np.testing.assert_array_equal(found["ActPosMotor.time"], np.arange(6000))
    told = proposal(one, log)
    acquire = told["source"]["acquire"]
    assert acquire["time"]["unit"] == "ms"
    assert acquire["sampling_period_s"] == 0.001
    assert [each["variable"] for each in acquire["inputs"]] == ["ActTorque"]
    assert {each["variable"] for each in acquire["outputs"]} == {"ActPosMotor", "ActPosLoad"}
    if log == "twincat.csv":
        assert response_of_proposal(one).frequency_hz[-1] == pytest.approx(250, rel=0.01)


@pytest.mark.parametrize(
    ("log", "time", "step_s"), [("dspace.mat", "rec1_001.X{1}.Data", 0.001), ("lab250.lvm", "X_Value", 0.00025)]
)
def test_recordings_of_controldesk_and_labview_have_their_time(case, log, time, step_s):
    one = case("dspace_lvm")
    told = proposal(one, log)
    acquire = told["source"]["acquire"]
    assert acquire["time"] == {"variable": time, "unit": "s"}
    assert acquire["sampling_period_s"] == step_s
    assert len(acquire["outputs"]) == 1
    assert response_of_proposal(one).frequency_hz[-1] == pytest.approx(250, rel=0.01)


def test_a_channel_may_be_a_row(case):
    one = case("rows_not_columns")
    told = proposal(one, "robot.mat")
    assert told["source"]["acquire"]["inputs"][0]["variable"] == "u_train(1,:)"
    # Nothing says what it is; a person does.
    said = (one.folder / "p.yaml").read_text().replace("unit: V", "unit: N m")
    (one.folder / "p.yaml").write_text(said)
    rows = response_of_proposal(one)
    listed = one.robid("inspect", "tofile.mat")
    assert listed.code == 0
    for row in (2, 3, 4):
        assert f"ans({row},:)" in listed.out
    assert "time `ans(1,:)`" in " ".join(listed.out.split())
    told = (one.folder / "p.yaml").read_text()
    names = {"robot.mat": "tofile.mat", "time_train": '"ans(1,:)"', "u_train(1,:)": "ans(2,:)"}
    for name, other in (names | {"y_train(1,:)": "ans(3,:)", "y_train(2,:)": "ans(4,:)"}).items():
        told = told.replace(name, other)
    (one.folder / "p.yaml").write_text(told)
    np.testing.assert_array_equal(response_of_proposal(one).response, rows.response)


def test_a_head_in_the_middle_is_passed_over(case):
    one = case("rows_not_columns")
    told = proposal(one, "rehead.csv")
    assert told["source"]["acquire"]["sampling_period_s"] == 0.001
    assert told["periods"] + told["source"]["acquire"]["drop_periods"] == 6
    found = load_variables(one.folder / "rehead.csv")
    np.testing.assert_allclose(found["time"], 0.001 * np.arange(6000), atol=1e-9)


def test_dates_in_german_and_american_order_are_times(case):
    one = case("invented_numbers")
    told = proposal(one, "de.csv")
    assert told["source"]["acquire"]["time"] == {"variable": "timestamp", "unit": "s"}
    assert told["source"]["acquire"]["sampling_period_s"] == 0.00025
    assert response_of_proposal(one).frequency_hz[-1] == pytest.approx(250, rel=0.01)
    for head in ("us_head.csv", "hms_head.csv"):
        np.testing.assert_allclose(load_variables(one.folder / head)["timestamp"], [0, 0.00025, 0.0005], atol=1e-12)
