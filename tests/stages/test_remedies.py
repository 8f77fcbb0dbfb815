"""Remedies about period and clock, followed as a machine would: two rounds end in a response."""

import copy
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.io import loadmat, savemat

CONFIGS = Path(__file__).parents[2] / "configs"
ROUNDS = 2
SETTING = re.compile(r"(?:[Ss]et|,|and) (?!or)([a-z_][\w.]*) to ([\w.+-]*\w)")
BENCH = {
    "schema_version": 1,
    "name": "log",
    "robot": "robots/motor_bench.yaml",
    "execution": {"backend": "serial"},
    "campaigns": {
        "log": {
            "configurations": {"list_deg": [[0]]},
            "excitation": {
                **{"period_s": 1, "low_hz": 11, "high_hz": 250, "count": 240},
                **{"spacing": "linear", "grid": "full", "detection_share": 0},
            },
            "periods": 18,
            "source": {
                "acquire": {
                    **{"file": "log.mat", "format": "mat", "sampling_period_s": 4.0e-4, "drop_periods": 1},
                    "time": {"variable": "time", "unit": "us"},
                    "inputs": [{"name": "drive", "variable": "iq_adx", "unit": "A", "normalised": True}],
                    "outputs": [
                        {"name": "drive", "variable": "theta_mx"},
                        {"name": "drive.arm", "variable": "theta_my", "sign": -1},
                    ],
                }
            },
            "estimate": {"compensation": "none"},
        }
    },
}


def place_of(settings, name):
    """Section and key of a setting, as messages call it."""
    campaign = settings["campaigns"]["log"]
    acquire = campaign["source"]["acquire"]
    section, _, key = name.rpartition(".")
    if section:
        return {"excitation": campaign["excitation"], "time": acquire.get("time")}[section], key
    return (campaign if key == "periods" else acquire), key


def follow(settings, message):
    """Applies the first remedy of a message, and says what it changed."""
    remedy = message.partition("remedy: ")[2]
    first = re.split(r"\. Or|, or |; the period", remedy)[0]
    changed = SETTING.findall(first)
    if not changed:
        told = r"(?:Use a period of|lengthen the period to) ([\d.e-]+) s"
        changed = [("excitation.period_s", value) for value in re.findall(told, message)]
        told = r"Use a sampling period of ([\d.e-]+) s"
        changed = [("sampling_period_s", value) for value in re.findall(told, message)] or changed
    assert changed, f"nothing can be followed in: {message}"
    for name, value in changed:
        section, key = place_of(settings, name)
        section[key] = json.loads(value) if re.fullmatch(r"[\d.]+(e-?\d+)?", value) else value
    return changed


def run_to_the_end(shop, settings):
    """Runs until a response is there; returns the messages on the way."""
    messages = []
    for _ in range(ROUNDS + 1):
        (shop.folder / "log.yaml").write_text(json.dumps(settings))
        for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
            answer = shop.robid(stage, "log.yaml", "--force")
            if answer.code:
                break  # the later stages have nothing to read
        if answer.code == 0:
            return messages
        assert answer.code in (2, 4), answer.err
        assert answer.flat not in messages, f"the same again: {answer.flat}"
        messages.append(answer.flat)
        follow(settings, answer.flat)
    pytest.fail(f"not done after {ROUNDS} rounds:\n" + "\n".join(messages))


@pytest.fixture
def bench(workshop, tmp_path, monkeypatch, data_folder):
    """A folder for logs of the motor bench, its columns and its settings."""
    shop = workshop(tmp_path, monkeypatch)
    (tmp_path / "robots").mkdir()
    shutil.copy(CONFIGS / "robots" / "motor_bench.yaml", tmp_path / "robots")
    raw = loadmat(data_folder("motor_bench") / "MultisineTypeA.mat")
    shop.columns = {name: raw[name].ravel().astype(float) for name in ("time", "iq_adx", "theta_mx", "theta_my")}
    shop.settings = copy.deepcopy(BENCH)
    return shop


def write_log(shop, columns):
    savemat(shop.folder / "log.mat", {name: values[:, None] for name, values in columns.items()})


def stated(settings, **changes):
    """Settings otherwise stated; `time: None` leaves a section out."""
    for name, value in changes.items():
        section, key = place_of(settings, name.replace("__", "."))
        if value is None:
            del section[key]
        else:
            section[key] = value


def at(columns, moments, time=None):
    """The log as it would be at other moments [samples], with its own time or another one."""
    index = np.arange(len(columns["time"]), dtype=float)
    found = {name: make_interp_spline(index, values, k=7)(moments) for name, values in columns.items()}
    return {**found, "time": np.interp(moments, index, columns["time"]) if time is None else time}


def slow(rate):
    return lambda c: at(c, np.arange(0, 49999, rate), 400.0 * np.arange(len(np.arange(0, 49999, rate))))


def jittered(columns):
    moments = np.arange(1, 49990) + np.random.default_rng(1).uniform(-0.2, 0.2, 49989)
    return at(columns, moments)


def kept(*parts):
    return lambda c: {name: np.concatenate([values[part] for part in parts]) for name, values in c.items()}


WRONG = {
    "twice too long, all its lines": ({"excitation__period_s": 2, "excitation__count": 479, "periods": 9}, None),
    "twice too long, odd lines": (
        {"excitation__period_s": 2, "excitation__grid": "odd", "excitation__count": 239, "periods": 9},
        None,
    ),
    "half as long": ({"excitation__period_s": 0.5, "excitation__low_hz": 12, "excitation__count": 120}, None),
    "one sample too long": ({"excitation__period_s": 1.0004}, None),
    "one sample too short": ({"excitation__period_s": 0.9996}, None),
    "a fraction of a sample": ({"excitation__period_s": 1.00017}, None),
    "too many periods": ({"periods": 30}, None),
    "D180": ({"sampling_period_s": 5.0e-4}, None),
    "a sampling period 0.1 % off": ({"sampling_period_s": 4.004e-4}, None),
    "a clock that is 0.1 % fast and a generator too": (
        {},
        lambda c: {**slow(1.001)(c), "time": 0.999 * slow(1.001)(c)["time"]},
    ),
    "another sampling period, no time": ({"sampling_period_s": 5.0e-4, "time": None}, None),
    "half the sampling period, no time": ({"sampling_period_s": 2.0e-4, "time": None}, None),
    "time in another unit": ({"time__unit": "ms"}, None),
    "a clock that is 1 % slow": ({}, lambda c: {**c, "time": 1.01 * c["time"]}),
    "a clock that is 0.1 % slow": ({}, lambda c: {**c, "time": 1.001 * c["time"]}),
    "a clock that is 10 ppm slow": ({}, lambda c: {**c, "time": (1 + 1e-5) * c["time"]}),
    "a log at 1 % slower steps, its time true": ({}, lambda c: at(c, np.arange(0, 49999, 1.01))),
    "a generator that is 1 % slow": ({}, slow(0.99)),
    "a generator that is 0.1 % fast": ({}, slow(1.001)),
    "a generator that is 100 ppm fast, no time": ({"time": None}, slow(1.0001)),
    "instants that jitter": ({}, jittered),
    "stamps rounded to 0.15 ms": ({}, lambda c: {**c, "time": 150 * np.round(c["time"] / 150)}),
    "a gap within a period": ({}, kept(slice(0, 5200), slice(6111, None))),
    "every second period left out": ({"periods": 9}, kept(*(slice(k, k + 2500) for k in range(0, 50000, 5000)))),
}


@pytest.mark.parametrize("case", WRONG)
def test_remedies_lead_to_a_response(bench, case):
    changes, change = WRONG[case]
    write_log(bench, change(bench.columns) if change else bench.columns)
    stated(bench.settings, **changes)
    messages = run_to_the_end(bench, bench.settings)
    fine = {"a clock that is 10 ppm slow", "every second period left out", "stamps rounded to 0.15 ms"}
    assert bool(messages) == (case not in fine), messages
    assert len(messages) == 1 or "0.1 %" not in case
    excitation = bench.settings["campaigns"]["log"]["excitation"]
    acquire = bench.settings["campaigns"]["log"]["source"]["acquire"]
    if "sampling" not in case and acquire.get("resample") is None:
        # No period is proposed but the real one, of 2500 samples.
        assert excitation["period_s"] / acquire["sampling_period_s"] == pytest.approx(2500, rel=1e-6)
