"""A log whose torque was clipped: what is said last of its response."""

import json

import numpy as np
import pytest

FILE = """schema_version: 1
name: clipped
campaigns:
  log:
    excitation: {period_s: 1, low_hz: 2, high_hz: 100, lines: all, grid: full}
    periods: 3
    source:
      acquire:
        file: clipped.csv
        sampling_period_s: 0.001
        inputs: [{name: drive, variable: torque, unit: N m, hold: band_limited}]
        outputs: [{name: drive, variable: angle, unit: rad}]
    estimate: {compensation: none}
execution: {backend: serial}
"""


@pytest.fixture
def clip(shop):
    """Runs the log of a drive of pure inertia, its torque clipped at some deviations."""
    lines = np.arange(2, 101)
    spectrum = np.zeros(501, complex)
    spectrum[lines] = np.exp(2j * np.pi * np.random.default_rng(3).random(len(lines)))
    torque = np.fft.irfft(spectrum, 1000)
    scale = torque.std()
    frequency = np.maximum(np.arange(501), 1)
    angle = np.fft.irfft(-spectrum / (0.01 * (2 * np.pi * frequency) ** 2), 1000) / scale
    noise = 1e-7 * np.random.default_rng(4).standard_normal(3000)

    def run(limit):
        table = np.stack([np.tile(np.clip(torque / scale, -limit, limit), 3), np.tile(angle, 3) + noise], axis=1)
        np.savetxt(shop.folder / "clipped.csv", table, delimiter=",", header="torque,angle", comments="")
        (shop.folder / "clipped.yaml").write_text(FILE)
        return shop.robid("run", "clipped.yaml")

    return run


def test_what_is_said_last_says_not_to_trust_it(clip, shop):
    answer = clip(1.5)
    measured, _, verdict, _ = answer.out.rstrip().splitlines()[-4:]
    assert "do not trust it: a signal saturates for" in measured
    assert "known to" not in measured
    assert "known" not in verdict
    assert "Do not trust log: a signal saturates for" in verdict
    summary = json.loads((shop.folder / "runs" / "clipped" / "summary.json").read_text())
    assert 0.08 < summary["campaigns.log.response.saturated_share"] < 0.2
    again = shop.robid("run", "clipped.yaml", "--json")
    assert json.loads(again.out)["verdict"]["level"] == "bad"


def test_a_sound_log_is_known(clip):
    answer = clip(10)
    assert "known to" in answer.out
    assert "trust" not in answer.out + answer.err
