"""The attack by seeds: mutated settings and command lines, damaged artifacts, run folders, fleets and logs.

`make test-hard` runs it whole, the outcomes added up in `runs/hard/summary.json`; `ROBID_HARD_SCALE` makes it smaller.
A case runs again as `damage.run_cases(case, folder, range(seed, seed + 1))`.
"""

import shutil
import subprocess
import sys

import numpy as np
import pytest

pytest.importorskip("pyarrow")

import damage
from damaged_folders import STAGES, made_once
from hard_summary import SCALE, note
from mutations import mutated

CASES = {"settings": 8000, "command": 2000, "artifact": 1880, "chain": 60, "fleet": 60, "log": 2000, "response": 1000}
COMMANDS = 500
CHUNK = 500

pytestmark = pytest.mark.hard


def chunks(count):
    whole = max(1, round(SCALE * count))
    return [(first, min(first + CHUNK, whole)) for first in range(0, whole, CHUNK)]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    return made_once(tmp_path_factory.mktemp)


@pytest.mark.parametrize(("case", "first", "last"), [(case, *one) for case in CASES for one in chunks(CASES[case])])
def test_cases_by_seed(made, case, first, last):
    # Seeds apart from those of the tests that run always.
    outcomes = damage.run_cases(case, made(case), range(10_000 + first, 10_000 + last))
    assert len(outcomes) == last - first
    note(case, first, outcomes)


def test_commands_as_processes(tmp_path):
    """The same mutations as processes of their own, from start to end."""
    outcomes = {}
    for seed in range(max(1, round(SCALE * COMMANDS))):
        generator, work = np.random.default_rng([2, seed]), tmp_path / f"{seed}"
        work.mkdir()
        for name in ("small.yaml", "arm.yaml"):
            shutil.copy(STAGES / name, work)
        path = work / str(generator.choice(["small.yaml", "arm.yaml"]))
        text, how = mutated(path.read_text(encoding="utf-8"), generator)
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        command = [sys.executable, "-m", "robid", "status", "small.yaml"]
        done = subprocess.run(
            command, cwd=work, env=damage._environment(), capture_output=True, text=True, check=False, timeout=60
        )
        fine = done.returncode in (0, 2, 3, 4, 5) and "Traceback" not in done.stderr
        outcomes[seed] = (
            f"ended: {done.returncode}" if fine else f"WRONG: {how}: {done.returncode}: {done.stderr[-1500:]}"
        )
        shutil.rmtree(work)
    note("process", 0, outcomes)
