"""Logs whose signals have clocks of their own, in rows or in topics: the proposal is that of one clock, and it runs."""

import numpy as np
import pytest

from answers import ask
from robid.logs.inspection.findings import inspect_log

STEP, PERIOD, PERIODS = 1e-3, 500, 8
LINES = np.arange(3, 80)
PHASES = np.random.default_rng(1).uniform(0, 2 * np.pi, len(LINES))


def torque_at(time_s):
    return np.cos(2 * np.pi * np.outer(time_s / 0.5, LINES) + PHASES).sum(axis=1)


def motion_at(time_s):
    """A rigid inertia's answer."""
    return -(np.cos(2 * np.pi * np.outer(time_s / 0.5, LINES) + PHASES) / (2 * np.pi * LINES / 0.5) ** 2).sum(axis=1)


def write_rows(file, lag_s, slower=1):
    """A table as PlotJuggler exports it, each row of one topic."""
    moments = STEP * np.arange(PERIOD * PERIODS)
    rows = [(one, f"{value:.9g},") for one, value in zip(moments, torque_at(moments), strict=True)]
    late = moments[::slower] + lag_s
    rows += [(one, f",{value:.9g}") for one, value in zip(late, motion_at(late), strict=True)]
    lines = [f"{1_700_000_000 + moment:.6f},{cells}" for moment, cells in sorted(rows)]
    file.write_text("\n".join(["__time,/drive/effort,/drive/position", *lines]) + "\n")


@pytest.mark.parametrize("lag_s", [0.31e-3, 0.1e-3, 0.77e-3])
def test_a_table_with_rows_of_several_topics_is_seen_at_one_clock(tmp_path, monkeypatch, lag_s):
    monkeypatch.chdir(tmp_path)
    write_rows(tmp_path / "log.csv", lag_s)
    found = inspect_log([tmp_path / "log.csv"])
    assert found.step_s == STEP
    assert not found.sampling.gaps
    assert found.shared.whole == PERIOD
    assert not any(one.quality.missing for one in found.signals)
    assert ask("inspect", "log.csv", "--propose", "p.yaml").code == 0
    answer = ask("run", "p.yaml", "--backend", "serial")
    assert answer.code == 0, answer.err


def test_values_that_are_missing_here_and_there_are_no_rows_of_others(tmp_path):
    moments = STEP * np.arange(PERIOD * PERIODS)
    table = np.stack([moments, torque_at(moments), motion_at(moments)], axis=1)
    table[[500, 900, 1301], 2] = np.nan
    np.savetxt(tmp_path / "log.csv", table, delimiter=",", header="time [s],torque [Nm],angle [rad]", comments="")
    found = inspect_log([tmp_path / "log.csv"])
    assert found.n_sample == len(table)
    assert not found.contents.notes
