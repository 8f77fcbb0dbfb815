"""Remedies about gaps, clocks and wraps of logs, followed as a machine would: none leads back to an earlier message."""

import copy
import json
import re

import numpy as np
import pytest

from answers import ask
from robid.artifacts.kinds import RECORD, record_from_artifact
from robid.artifacts.store import read_artifact

STEP, PERIOD, PERIODS = 1e-3, 500, 6
LINES = np.arange(3, 60)
PHASES = np.random.default_rng(1).uniform(0, 2 * np.pi, (2, len(LINES)))
ROUNDS = 3
SETTING = re.compile(r"(?:[Ss]et|,|and) (?!or)([a-z_][\w.]*) to (\w[\w.+-]*\w|\w)")
ACQUIRE = {
    **{"file": "log.csv", "sampling_period_s": STEP, "time": {"variable": "t", "unit": "s"}},
    "inputs": [{"name": "motor", "variable": "u", "unit": "N m"}],
    "outputs": [{"name": "motor", "variable": "q", "unit": "rad"}],
}
KINDS = {
    "periodic": {
        "excitation": {"period_s": 0.5, "low_hz": 6, "high_hz": 118, "lines": "all", "grid": "full"},
        "periods": 5,
    },
    "arbitrary": {"excitation": {"signal": "arbitrary", "low_hz": 6, "high_hz": 118, "resolution_hz": 4}},
    "shot": {},
}


def log(rate=1.0, period_s=0.5, drop=(), jitter=0.0, told=1.0):
    """A log whose true steps are `rate` times the stated ones."""
    time = rate * STEP * np.arange(PERIOD * PERIODS)
    time += jitter * STEP * np.random.default_rng(2).uniform(-1, 1, len(time))
    angle = 2 * np.pi * np.outer(time / period_s, LINES)
    torque, motion = (np.cos(angle + phase).sum(axis=1) for phase in PHASES)
    columns = {"t": told * time, "u": torque, "q": motion}
    return {name: np.delete(values, np.array(drop, int)) for name, values in columns.items()}


def settings_of(kind, n_log, **changes):
    acquire = {**copy.deepcopy(ACQUIRE), **changes.pop("acquire", {})}
    campaign = {**copy.deepcopy(KINDS[kind]), "source": {"acquire": acquire}, "estimate": {"compensation": "none"}}
    if kind == "shot":
        acquire["one_shot"] = True
        del campaign["estimate"]
    if n_log > 1:
        acquire["file"], campaign["realizations"] = "log_{realization}.csv", n_log
    campaign |= changes
    return {"schema_version": 1, "name": "x", "campaigns": {"log": campaign}, "execution": {"backend": "serial"}}


def follow(settings, message):
    """Applies the first remedy of a message, and says what it changed."""
    campaign = settings["campaigns"]["log"]
    acquire = campaign["source"]["acquire"]
    remedy = re.split(r"\. Or|, or |; the period", message.partition("remedy: ")[2])[0]
    changed = SETTING.findall(remedy)
    assert changed, f"nothing can be followed in: {message}"
    for name, value in changed:
        section, _, key = name.rpartition(".")
        place = campaign["excitation"] if section else campaign if key == "periods" else acquire
        place[key] = json.loads(value) if re.fullmatch(r"[\d.]+(e-?\d+)?", value) else value
    return changed


def run_to_the_end(folder, settings, rounds=ROUNDS):
    """Imports until a record is there; returns the messages on the way."""
    messages = []
    one_shot = "excitation" not in settings["campaigns"]["log"]
    for _ in range(rounds + 1):
        (folder / "x.yaml").write_text(json.dumps(settings))
        for stage in ("simulate-or-acquire",) if one_shot else ("design-excitation", "simulate-or-acquire"):
            answer = ask(stage, "x.yaml", "--force")
            if answer.code:
                break
        if answer.code == 0:
            return messages
        assert answer.code == 4, answer.err
        assert answer.flat not in messages, f"the same again: {answer.flat}"
        messages.append(answer.flat)
        follow(settings, answer.flat)
    pytest.fail(f"not done after {rounds} rounds:\n" + "\n".join(messages))


def write_logs(folder, logs):
    for index, columns in enumerate(logs):
        name = "log.csv" if len(logs) == 1 else f"log_{index + 1}.csv"
        table = np.stack(list(columns.values()), axis=1)
        np.savetxt(folder / name, table, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")


GAP = tuple(range(1210, 1240))
MANY = (*range(400, 410), *range(800, 820), *GAP, *range(1650, 1660), *range(2000, 2040), *range(2400, 2411))
LOGS = {
    "a gap": [{"drop": GAP}],
    "single rows": [{"drop": (300, 801, 1500, 2404)}],
    "single rows and a gap": [{"drop": (300, 801, *GAP, 1500, 2404)}],
    "gaps in every period": [{"drop": MANY}],
    "a gap and another clock": [{"rate": 1.01, "drop": GAP}],
    "a gap and instants that jitter": [{"drop": GAP, "jitter": 0.15}],
    "gaps in two logs": [{"drop": GAP}, {"drop": tuple(range(600, 640))}],
    "a clock 5.2 % slow": [{"rate": 1.052}],
    "a clock 7 % fast": [{"rate": 0.93}],
    "two clocks": [{"rate": 1.01}, {"rate": 0.99}],
    "the second clock is another": [{}, {"rate": 1.002}],
    "both have the same other clock": [{"rate": 1.01}, {"rate": 1.01}],
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("case", LOGS)
def test_remedies_lead_to_a_record(tmp_path, monkeypatch, case, kind):
    monkeypatch.chdir(tmp_path)
    write_logs(tmp_path, [log(**one) for one in LOGS[case]])
    assert run_to_the_end(tmp_path, settings_of(kind, len(LOGS[case])))


@pytest.mark.parametrize(
    ("case", "acquire", "changes"),
    [
        ([{"rate": 1.052}], {"resample": "time"}, {}),
        ([{"rate": 0.93}], {"resample": "time"}, {}),
        ([{"period_s": 0.47}], {"resample": "period"}, {}),
        ([{"drop": (1210, 1211, 1212)}], {"resample": "period", "time": None}, {}),
        ([{"rate": 1.01, "drop": GAP}], {"resample": "time"}, {}),
        ([{"drop": GAP}], {"take": "last"}, {"periods": 4}),
        ([{"drop": tuple(range(2710, 2733))}], {"drop_periods": 1}, {}),
        ([{}, {"period_s": 0.505}], {}, {}),
        ([{"period_s": 0.5025}, {"period_s": 0.505}], {"time": None}, {}),
    ],
)
def test_remedies_about_periods_and_what_was_resampled_lead_to_a_record(tmp_path, monkeypatch, case, acquire, changes):
    monkeypatch.chdir(tmp_path)
    write_logs(tmp_path, [log(**one) for one in case])
    settings = settings_of("periodic", len(case), acquire=acquire, **changes)
    stated = settings["campaigns"]["log"]["source"]["acquire"]
    if stated["time"] is None:
        del stated["time"]
    assert run_to_the_end(tmp_path, settings)


@pytest.mark.parametrize("stated_s", [0.499, 0.501, 0.6])
@pytest.mark.parametrize("lost", [range(500, 1000), range(1000, 2000), range(1210, 1710)])
def test_a_wrong_period_shows_where_whole_ones_are_lost(tmp_path, monkeypatch, stated_s, lost):
    monkeypatch.chdir(tmp_path)
    write_logs(tmp_path, [log(drop=tuple(lost))])
    settings = settings_of("periodic", 1, periods=3)
    settings["campaigns"]["log"]["excitation"]["period_s"] = stated_s
    messages = run_to_the_end(tmp_path, settings)
    assert "every 500 samples" in messages[0]
    assert settings["campaigns"]["log"]["excitation"]["period_s"] == 0.5


def test_a_log_too_slow_for_resampling_is_not_called_fast(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_logs(tmp_path, [log(rate=1.052)])
    settings = settings_of("periodic", 1, acquire={"resample": "time"})
    (message,) = run_to_the_end(tmp_path, settings)
    assert "fast" not in message
    assert "0.001052 s" in message


@pytest.mark.parametrize("kind", KINDS)
def test_clocks_too_far_apart_are_sent_to_campaigns_of_their_own(tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    write_logs(tmp_path, [log(), log(rate=1.3)])
    settings = settings_of(kind, 2)
    (tmp_path / "x.yaml").write_text(json.dumps(settings))
    if kind != "shot":
        assert ask("design-excitation", "x.yaml", "--force").code == 0
    answer = ask("simulate-or-acquire", "x.yaml", "--force")
    assert answer.code == 4
    assert "campaign of its own" in answer.flat
    assert "log_2.csv" in answer.flat


def test_a_remedy_for_several_logs_keeps_the_time_true(tmp_path, monkeypatch):
    """Where all logs have one other clock it is set; resampling them to the wrong one would be slower only."""
    monkeypatch.chdir(tmp_path)
    write_logs(tmp_path, [log(rate=1.01), log(rate=1.01)])
    settings = settings_of("shot", 2)
    run_to_the_end(tmp_path, settings)
    acquire = settings["campaigns"]["log"]["source"]["acquire"]
    assert acquire["sampling_period_s"] == pytest.approx(1.01e-3)
    assert "resample" not in acquire


@pytest.mark.parametrize(
    ("unit", "low", "size", "said"),
    [
        ("deg", 0.0, 360.0, "`unwrap: true`"),
        ("rad", -np.pi, 2 * np.pi, "`unwrap: true`"),
        ("counts", 0.0, 65536.0, "`unwrap: 65536`"),
        ("counts", -32768.0, 65536.0, "`unwrap: 65536`"),
    ],
)
def test_an_angle_that_wraps_is_said_to_and_goes_on_once_it_is_stated(tmp_path, monkeypatch, unit, low, size, said):
    monkeypatch.chdir(tmp_path)
    columns = log()
    motion = columns["q"] / np.ptp(columns["q"]) * 0.2 * size + 2 * size * np.sin(2 * np.pi * columns["t"])
    wrapped = np.mod(motion - low, size) + low
    columns["q"] = np.round(wrapped) if unit == "counts" else wrapped
    write_logs(tmp_path, [columns])
    settings = settings_of("shot", 1)
    output = settings["campaigns"]["log"]["source"]["acquire"]["outputs"][0]
    output |= {"unit": unit, **({"counts_per_turn": 10000} if unit == "counts" else {})}
    (tmp_path / "x.yaml").write_text(json.dumps(settings))
    answer = ask("simulate-or-acquire", "x.yaml", "--force")
    assert answer.code == 4
    assert said in answer.flat
    output["unwrap"] = True if "true" in said else 65536
    (tmp_path / "x.yaml").write_text(json.dumps(settings))
    assert ask("simulate-or-acquire", "x.yaml", "--force").code == 0


@pytest.mark.parametrize("bits", [8, 16, 32])
def test_torques_that_lost_their_signs_are_told_and_come_back_once_that_is_stated(tmp_path, monkeypatch, bits):
    monkeypatch.chdir(tmp_path)
    columns = log()
    meant = np.round(columns["u"] / np.abs(columns["u"]).max() * min(2.0**bits / 4, 3000))
    columns["u"] = meant % 2.0**bits
    write_logs(tmp_path, [columns])
    settings = settings_of("shot", 1)
    acquire = settings["campaigns"]["log"]["source"]["acquire"]
    (tmp_path / "x.yaml").write_text(json.dumps(settings))
    answer = ask("simulate-or-acquire", "x.yaml", "--force")
    assert answer.code == 4
    assert f"`unwrap: {2**bits}`" in answer.flat
    acquire["inputs"][0]["unwrap"] = 2**bits
    (tmp_path / "x.yaml").write_text(json.dumps(settings))
    assert ask("simulate-or-acquire", "x.yaml", "--force").code == 0
    record = record_from_artifact(read_artifact(tmp_path / "runs" / "x" / "log" / "record.h5", RECORD))
    torque = record.inputs.ravel()
    np.testing.assert_array_equal(torque, meant[: len(torque)])


def test_of_torques_that_lost_their_signs_nothing_else_is_told(tmp_path, monkeypatch):
    """Their periods seem to move apart, which is no loss of samples."""
    monkeypatch.chdir(tmp_path)
    columns = log()
    columns["u"] = np.round(100 * columns["u"]) % 65536
    write_logs(tmp_path, [columns])
    (tmp_path / "x.yaml").write_text(json.dumps(settings_of("periodic", 1)))
    assert ask("design-excitation", "x.yaml", "--force").code == 0
    answer = ask("simulate-or-acquire", "x.yaml", "--force")
    assert answer.code == 4
    assert "D657" in answer.flat
    assert re.findall(r"\bD\d{3}\b", answer.flat) == ["D657"]


@pytest.mark.parametrize("high", [1, 255, 65535])
def test_a_command_that_switches_is_not_said_to_have_lost_its_signs(tmp_path, monkeypatch, high):
    monkeypatch.chdir(tmp_path)
    columns = log()
    columns["u"] = high * (columns["u"] > 0) + np.arange(len(columns["u"])) // 3 % 2 * (1 - 2 * (columns["u"] > 0))
    columns["u"] = np.clip(columns["u"], 0, high)
    write_logs(tmp_path, [columns])
    (tmp_path / "x.yaml").write_text(json.dumps(settings_of("shot", 1)))
    assert ask("simulate-or-acquire", "x.yaml", "--force").code == 0


@pytest.mark.parametrize("scale", [1.0, 350.0])
def test_an_angle_that_only_moves_much_is_not_said_to_wrap(tmp_path, monkeypatch, scale):
    monkeypatch.chdir(tmp_path)
    columns = log()
    columns["q"] = scale * np.sign(np.sin(2 * np.pi * columns["t"])) * 0.5 + 1e-3 * columns["q"]
    write_logs(tmp_path, [columns])
    settings = settings_of("shot", 1)
    settings["campaigns"]["log"]["source"]["acquire"]["outputs"][0]["unit"] = "deg"
    (tmp_path / "x.yaml").write_text(json.dumps(settings))
    assert ask("simulate-or-acquire", "x.yaml", "--force").code == 0
