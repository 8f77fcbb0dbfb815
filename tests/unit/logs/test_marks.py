"""Numbers that recorders write where a value is missing are refused; peaks, steps and pulses are not."""

from pathlib import Path

import numpy as np
import pytest

from robid.logs.columns import check_values
from robid.logs.mapping import LogMapping
from robid.signals.log_channels import InputChannel, OutputChannel

N_SAMPLE = 4000
MAPPING = LogMapping(
    file=Path("log.csv"),
    sampling_period_s=1e-3,
    inputs=(InputChannel("drive", "u"),),
    outputs=(OutputChannel("drive", "q"),),
)
NOISE = np.random.default_rng(2).normal(size=N_SAMPLE)
WAVE = np.sin(np.arange(N_SAMPLE) / 50)


@pytest.mark.parametrize("mark", [-9999.0, 999.0, -32768.0, 1e9])
@pytest.mark.parametrize("count", [2, 3, 150])
def test_a_mark_of_missing_values_is_refused(mark, count):
    values = 3 * WAVE + 0.1 * NOISE
    at = np.sort(np.random.default_rng(count).choice(N_SAMPLE, count, replace=False))
    values[at] = mark
    (problem,) = check_values(MAPPING, {MAPPING.outputs[0].column: values})
    assert f"sample {at[0]}" in problem.where
    assert "NaN" in problem.remedy


def _pulses(height, width):
    values = 0.01 * NOISE
    for begin in range(100, N_SAMPLE, 500):
        values[begin : begin + width] += height * np.hanning(width + 2)[1:-1]
    return values


@pytest.mark.parametrize(
    "values",
    [
        WAVE,
        np.where(np.arange(N_SAMPLE) % 500 < 10, 1.0, 0.0),  # a command of two levels
        np.repeat(np.random.default_rng(3).normal(size=20), 200),  # one of a few levels
        _pulses(50.0, 9),  # blows of a hammer
        np.clip(_pulses(50.0, 9), -30, 30),  # the same, clipped
        np.clip(100 * WAVE, -5, 5),
        np.round(20 * WAVE) / 20,
        np.concatenate([0.001 * NOISE[:2000], 5 * WAVE[2000:]]),  # rest, then motion
    ],
)
def test_what_was_measured_is_no_mark(values):
    assert check_values(MAPPING, {MAPPING.outputs[0].column: values}) == []
