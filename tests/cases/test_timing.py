"""Clocks of logs: rates beneath coarse stamps, channels with clocks of their own, channels that are sums."""

import h5py
import numpy as np
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


def test_topics_in_rows_of_their_own_are_brought_to_one_clock(case):
    here = case("plotjuggler")
    text = (here.folder / "r_pj.csv.yaml").read_text().replace("0.00031", "0.001")
    lines = [line for line in text.splitlines() if not line.strip().startswith(("from_s", "to_s", "one_shot"))]
    excitation = "    excitation: {period_s: 1, low_hz: 2, high_hz: 250, lines: all, grid: full}\n    periods: 3"
    at = next(i for i, line in enumerate(lines) if line == "    source:")
    lines.insert(at, excitation)
    lines.insert(lines.index("        file: pj.csv"), "        drop_periods: 2")
    (here.folder / "own.yaml").write_text("\n".join(lines) + "\n")
    answer = here.robid("run", "own.yaml", "--backend", "serial")
    assert answer.code == 0, answer.err
    table = np.genfromtxt(here.folder / "pj.csv", delimiter=",", skip_header=1)
    filled = np.isfinite(table[:, 1])
    motion, torque = (np.fft.rfft(x[2000:5000].reshape(3, 1000).mean(0)) for x in (table[filled, 1], table[~filled, 2]))
    frequency = np.arange(2, 251)
    wanted = -((2 * np.pi * frequency) ** 2) * (motion / torque)[2:251] * np.exp(2j * np.pi * frequency * 0.31e-3)
    with h5py.File(here.folder / "runs/r_pj/log/frf.h5") as file:
        found = file["response"][0, :, 0, 0] * file["element_scale"][...].ravel()[0]
    # Joined row by row the phase would be off by 0.49 rad at the highest line.
    assert abs(np.angle(found / wanted)[-30:].mean()) < 0.02


def test_rows_of_topics_without_a_time_are_told_and_no_warning_is(case):
    here = case("plotjuggler")
    text = (here.folder / "r_pj.csv.yaml").read_text().replace("0.00031", "0.001")
    kept = [line for line in text.splitlines() if not line.strip().startswith(("from_s", "to_s", "time:"))]
    (here.folder / "own.yaml").write_text("\n".join(kept) + "\n")
    answer = here.robid("run", "own.yaml", "--backend", "serial")
    assert answer.code == 4
    assert "State `time`" in answer.flat
    assert "Warning" not in answer.err


def test_a_joint_that_is_logged_as_a_sum_is_stated_as_the_difference(case):
    here = case("fanuc_sum")
    text = (here.folder / "e.yaml").read_text()
    # Motor angles: the ratios of the two joints weigh in.
    (here.folder / "e.yaml").write_text(text.replace("variable: q3}", "variable: q3 - 130/150*q2}"))
    answer = here.robid("run", "e.yaml", "--backend", "serial", "--json")
    assert answer.code == 0, answer.err
    found = {(one["name"], one["kind"]): one["estimate"] for one in answer.json["parameters"]["arm"]}
    inertia = next(value for (name, kind), value in found.items() if name == "J3" and "inertia" in kind)
    assert inertia == pytest.approx(8e-4, rel=0.01)


def test_what_is_proposed_for_topics_in_rows_of_their_own_runs(case):
    here = case("plotjuggler")
    answer = here.robid("inspect", "pj.csv", "--propose", "p.yaml")
    assert answer.code == 0, answer.err
    assert "Warning" not in answer.err
    acquire = acquire_of(here.folder / "p.yaml")
    assert acquire["sampling_period_s"] == 1e-3
    assert "from_s" not in acquire
    answer = here.robid("run", "p.yaml", "--backend", "serial")
    assert answer.code == 0, answer.err


def test_angles_that_wrap_are_said_to(case):
    here = case("angle_wraps")
    for name in ("p_hop_deg", "p_wrap_deg"):
        answer = here.robid("run", f"{name}.yaml", "--backend", "serial")
        assert answer.code == 4
        assert answer.flat.count("`unwrap: true`") == 2
        text = (here.folder / f"{name}.yaml").read_text().replace("unit: deg}", "unit: deg, unwrap: true}")
        (here.folder / f"{name}.yaml").write_text(text)
        assert here.robid("run", f"{name}.yaml", "--backend", "serial").code == 0
