"""Speed as ratios of two tasks timed in turn in one run; `make bench` collects `bench_*.py`, no other target does.

`--baseline FILE` holds each ratio against one that was measured before: it fails where it is worse by a factor, twice.
`tests/bench/baseline.py` writes such a file, from several runs.
"""

import json
import platform
import time
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

_ROOT = Path(__file__).parents[2]
_OUTPUT = _ROOT / "runs/bench/bench.json"
_WORSE = 1.5
"""Factor in a ratio beyond which it is slower than it was: ten runs beside other load stayed within 1.35."""

_RATIOS = pytest.StashKey[dict[str, float]]()
_REMARKS = pytest.StashKey[dict[str, str]]()


def pytest_addoption(parser):
    parser.addoption("--baseline", type=Path, help="ratios to hold these against")


def pytest_configure(config):
    config.addinivalue_line("markers", "quick: compared with the baseline in every run of CI")


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
        request.config.stash.setdefault(_REMARKS, {})[key] = remark

    return note


@pytest.fixture
def judge(request, keep):
    """Measures a ratio and notes it; with a baseline it is measured again where it is worse, and fails the second time.

    `measure` returns the ratio and a remark; with `slower` it is ours over the reference's time.
    """
    path = request.config.getoption("--baseline")
    known = {} if path is None else json.loads(path.read_text(encoding="utf-8"))["ratios"]

    def judged(key, measure, *, slower=False):
        for last in (False, True):
            value, remark = measure()
            before = known[key]["median"] if key in known else value
            worse = value / before if slower else before / value
            if worse <= _WORSE or last:
                break
        keep(key, value, remark)
        assert worse <= _WORSE, f"{key} is {value:.3g}, was {before:.3g}: {worse:.2g} times worse, twice in a row"

    return judged


@pytest.fixture
def compare(judge):
    """Times ours and a reference in turn and notes how many times as fast as the reference ours is."""

    def measure(key, ours, reference, rounds):
        judge(key, lambda: _ratio(ours, reference, rounds))

    return measure


def _ratio(ours, reference, rounds):
    ours(), reference()
    pairs = np.array([(_seconds(reference), _seconds(ours)) for _ in range(rounds)])
    low, high = np.quantile(pairs[:, 0] / pairs[:, 1], [0.25, 0.75])
    other, own = np.median(pairs, axis=0)
    times = f"ours {1e3 * own:.3g} ms, reference {1e3 * other:.3g} ms"
    return float(other / own), f"(quartiles {low:.3g} to {high:.3g}, {rounds} rounds; {times})"


def _seconds(task):
    begun = time.perf_counter()
    task()
    return time.perf_counter() - begun


def machine():
    """What figures were measured on."""
    names = [line.split(":")[1].strip() for line in _cpu_lines() if line.startswith("model name")]
    return {
        "date": datetime.now(UTC).date().isoformat(),
        "processor": names[0] if names else platform.processor(),
        "threads": len(names),
        "python": platform.python_version(),
        **{name: version(name) for name in ("numpy", "scipy", "mujoco-core")},
    }


def _cpu_lines():
    path = Path("/proc/cpuinfo")
    return path.read_text(encoding="utf-8").splitlines() if path.exists() else []


def pytest_sessionfinish(session):
    ratios = session.config.stash.get(_RATIOS, {})
    if ratios:
        _OUTPUT.parent.mkdir(parents=True, exist_ok=True)
        said = {**dict(sorted(ratios.items())), "machine": machine(), "remarks": session.config.stash[_REMARKS]}
        _OUTPUT.write_text(json.dumps(said, indent=2) + "\n", encoding="utf-8")


def pytest_terminal_summary(terminalreporter, config):
    remarks = config.stash.get(_REMARKS, {})
    if remarks:
        terminalreporter.section("ratios: time of the reference over ours")
        for key, value in sorted(config.stash[_RATIOS].items()):
            terminalreporter.write_line(f"{key} = {value:.3g}  {remarks[key]}".rstrip())
        terminalreporter.write_line("written to runs/bench/bench.json")
