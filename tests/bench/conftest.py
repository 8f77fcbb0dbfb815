"""Speed as ratios of two tasks timed in turn in one run; `make bench` collects `bench_*.py`, no other target does."""

import json
import time
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

_OUTPUT = Path(__file__).parents[2] / "runs/bench/bench.json"
_RATIOS = pytest.StashKey[dict[str, float]]()
_LINES = pytest.StashKey[list[str]]()


@pytest.fixture(autouse=True)
def one_thread():
    """Libraries count on one thread, as in our workers."""
    with threadpool_limits(1):
        yield


@pytest.fixture
def keep(request):
    """Notes a figure for the file and the summary."""

    def note(key, value, remark=""):
        request.config.stash.setdefault(_RATIOS, {})[key] = value
        request.config.stash.setdefault(_LINES, []).append(f"{key} = {value:.3g}  {remark}".rstrip())

    return note


@pytest.fixture
def compare(benchmark, keep):
    """Times ours and a reference in turn and notes how many times as fast as the reference ours is."""

    def measure(key, ours, reference, rounds):
        seconds = []

        def time_reference():
            begun = time.perf_counter()
            reference()
            seconds.append(time.perf_counter() - begun)

        benchmark.pedantic(ours, setup=time_reference, rounds=rounds, warmup_rounds=1)
        own, other = np.array(benchmark.stats.stats.data), np.array(seconds[1:])
        low, high = np.quantile(other / own, [0.25, 0.75])
        spread = f"(quartiles {low:.3g} to {high:.3g}, {rounds} rounds;"
        times = f"ours {1e3 * np.median(own):.3g} ms, reference {1e3 * np.median(other):.3g} ms)"
        keep(key, float(np.median(other) / np.median(own)), f"{spread} {times}")

    return measure


def pytest_sessionfinish(session):
    ratios = session.config.stash.get(_RATIOS, {})
    if ratios:
        _OUTPUT.parent.mkdir(parents=True, exist_ok=True)
        _OUTPUT.write_text(json.dumps(dict(sorted(ratios.items())), indent=2) + "\n", encoding="utf-8")


def pytest_terminal_summary(terminalreporter, config):
    lines = config.stash.get(_LINES, [])
    if lines:
        terminalreporter.section("ratios: time of the reference over ours")
        for line in [*sorted(lines), "written to runs/bench/bench.json"]:
            terminalreporter.write_line(line)
