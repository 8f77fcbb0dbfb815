"""Clocks of logs: rates beneath coarse stamps, channels with clocks of their own, channels that are sums."""

import pytest
from ruamel.yaml import YAML


def acquire_of(file):
    return YAML(typ="safe").load(file)["campaigns"]["log"]["source"]["acquire"]


def test_stamps_in_whole_seconds_tell_a_rate_of_one_kilohertz(case):
    here = case("coarse_stamps")
    answer = here.robid("inspect", "sec_a.csv", "--propose", "p.yaml")
    assert answer.code == 0, answer.err
    acquire = acquire_of(here.folder / "p.yaml")
    assert acquire["sampling_period_s"] == 1e-3
    assert YAML(typ="safe").load(here.folder / "p.yaml")["campaigns"]["log"]["excitation"]["period_s"] == 1
    answer = here.robid("run", "p.yaml", "--backend", "serial")
    assert answer.code == 0, answer.err


def test_a_sampling_period_that_coarse_stamps_contradict_is_refused_with_theirs(case):
    here = case("coarse_stamps")
    wrong = (here.folder / "sec_a.yaml").read_text()
    stated = wrong.replace(
        "sampling_period_s: 0.00109", "sampling_period_s: 0.00109\n        time: {variable: Timestamp}"
    )
    (here.folder / "wrong.yaml").write_text(stated)
    answer = here.robid("run", "wrong.yaml", "--backend", "serial")
    assert answer.code == 4
    assert "sampling_period_s to 0.001" in answer.flat
    assert "period_s to 1" in answer.flat


def test_the_motor_behind_coarse_stamps_has_its_inertia(case):
    here = case("coarse_stamps")
    text = (here.folder / "secfit.yaml").read_text()
    for wrong, right in (("0.00109", "0.001"), ("1.09,", "1,"), ("1.83486", "2"), ("229.358", "250")):
        text = text.replace(wrong, right)
    (here.folder / "right.yaml").write_text(text)
    answer = here.robid("run", "right.yaml", "--backend", "serial", "--json")
    inertia = {
        one["name"]: one["estimate"] for one in answer.json["parameters"]["two"] if one["kind"] == "motor_inertia"
    }
    assert inertia == {"drive": pytest.approx(4.8e-3, rel=0.01)}
