"""The figures of the study of fleets, from results that are made up."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from robid.errors import BackendError
from robid.studies.fleet import reprocessed
from robid.studies.fleet.reprocessed import count_found


def test_a_fault_is_found_that_failed_or_is_off_and_nobody_else_may_be():
    kinds = ["", "spring", "spring", "gap", "", "file", "", "gap"]
    failed = np.array([0, 0, 0, 1, 0, 1, 1, 0], bool)
    off = np.array([0, 1, 0, 0, 1, 1, 0, 0], bool)
    assert count_found(kinds, failed, off) == {
        "fleet.planted": 5,
        "fleet.found": 3,
        "fleet.sound": 3,
        "fleet.false_alarms": 2,
        "fleet.spring.found": 1,
        "fleet.spring.failed": 0,
        "fleet.gap.found": 1,
        "fleet.gap.failed": 1,
        "fleet.file.found": 1,
        "fleet.file.failed": 1,
    }


def test_the_rate_counts_rows_after_the_first_of_each_worker():
    assert reprocessed.rate_of([10, 12, 14, 16], 1) == pytest.approx(0.5)
    assert reprocessed.rate_of([10, 10, 12, 12, 14, 14], 2) == pytest.approx(1)
    with pytest.raises(BackendError, match="2 rows are too few to time 2 workers"):
        reprocessed.rate_of([1, 2], 2)


def test_efficiency_is_of_each_core_from_medians():
    rates = {
        ("serial", 1): [1, 50, 2, 1.5, 2],
        ("processes", 4): [7, 7.6, 100],
        ("dask", 4): [7.2, 0, 9],
        ("dask", 1): [2, 2, 2],
        ("dask", 2): [3.4, 3.4, 3.4],
    }
    found = reprocessed.efficiencies(rates, 4)
    assert found["fleet.serial_rows_per_second"] == 2
    assert found["fleet.efficiency_processes"] == pytest.approx(0.95)
    assert found["fleet.efficiency_dask"] == pytest.approx(0.9)
    assert found["fleet.two_workers"] == pytest.approx(1.7)


def test_no_backend_is_timed_twice():
    assert reprocessed.ways(2) == (("serial", 1), ("processes", 2), ("dask", 2), ("dask", 1))
    assert len(reprocessed.ways(4)) == 5


@pytest.fixture
def timing(tmp_path):
    return reprocessed.Timing(Path("manifest.csv"), Path("logs.yaml"), tmp_path / "speed", (("serial", 1),), 2, "key")


def test_times_are_those_at_which_rows_are_told(timing, monkeypatch):
    program = (
        "import json, sys, time\n"
        "for row in range(3): print(json.dumps({'id': row, 'outcome': 'made'}), flush=True); time.sleep(0.1)\n"
        "print(json.dumps({'outcome': 'made'}))\n"
        "sys.exit(5)"
    )
    start, asked = subprocess.Popen, []

    def popen(command, **options):
        asked.append(command)
        return start([sys.executable, "-c", program], **options)

    monkeypatch.setattr(reprocessed.subprocess, "Popen", popen)
    finished = reprocessed.finish_times(timing, ("processes", 3))
    assert np.diff(finished) == pytest.approx([0.1, 0.1], abs=0.08)
    assert list(timing.folder.iterdir()) == []
    assert "--stream" in asked[0]
    assert asked[0][asked[0].index("--backend") + 1 : asked[0].index("--pages")] == ["processes", "--workers", "3"]


def test_a_command_that_fails_is_told_with_its_last_words(timing, monkeypatch):
    start = subprocess.Popen
    program = "import sys; sys.exit('no such scheduler')"
    monkeypatch.setattr(
        reprocessed.subprocess, "Popen", lambda _, **options: start([sys.executable, "-c", program], **options)
    )
    with pytest.raises(BackendError, match="--backend dask` ended with code 1: no such scheduler"):
        reprocessed.finish_times(timing, ("dask", 1))


def test_a_stopped_measurement_goes_on_with_the_runs_that_are_left(timing, monkeypatch):
    done = []

    def stopped(_, way):
        if len(done) == 1:
            raise KeyboardInterrupt
        done.append(way)
        return [0, 1, 2]

    monkeypatch.setattr(reprocessed, "finish_times", stopped)
    with pytest.raises(KeyboardInterrupt):
        reprocessed.time_all(timing)
    monkeypatch.setattr(reprocessed, "finish_times", lambda *_: [0, 2, 4])
    assert reprocessed.time_all(timing).datasets["rate"].values.tolist() == [[1], [0.5]]
    assert not timing.folder.exists()


_GROWTH = """
import numpy as np
from robid.studies.fleet import reprocessed

before = reprocessed.resident_mib()
held = np.ones(200 * 2**17)
print(None if before is None else reprocessed.resident_mib() - before)
"""


def test_memory_is_that_of_this_process():
    # A fresh process: in one that has run other tests the system may take pages back between the two readings.
    printed = subprocess.run([sys.executable, "-c", _GROWTH], capture_output=True, text=True, check=True).stdout
    if printed.strip() == "None":
        pytest.skip("there is no /proc")
    assert float(printed) == pytest.approx(200, rel=0.1)
