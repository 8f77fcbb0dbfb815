"""How fast a command starts, against importing the libraries that none can do without."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

_ROOT = Path(__file__).parents[2]
_FLOOR = ("-c", "import numpy, h5py, pydantic, typer")
_ROUNDS = 15


pytestmark = pytest.mark.quick


@pytest.fixture
def seconds(tmp_path):
    """Runs Python in a process of its own and returns how long it takes; compiled files are kept, as for users."""
    kept = {key: value for key, value in os.environ.items() if key != "PYTHONDONTWRITEBYTECODE"}
    environment = {**kept, "PYTHONPYCACHEPREFIX": str(tmp_path / "compiled")}

    def measure(arguments):
        begun = time.perf_counter()
        command = [sys.executable, *arguments]
        subprocess.run(command, cwd=_ROOT, env=environment, check=True, stdout=subprocess.DEVNULL)
        return time.perf_counter() - begun

    return measure


@pytest.mark.parametrize(
    ("key", "arguments"),
    [("cli.help_vs_floor", ["--help"]), ("cli.status_vs_floor", ["status", "configs/kr300.yaml", "--run-dir"])],
)
def test_a_command_against_importing_its_libraries(judge, seconds, tmp_path, key, arguments):
    folder = [str(tmp_path / "run")] if arguments[-1] == "--run-dir" else []
    _in_turn(judge, seconds, key, ("-m", "robid", *arguments, *folder), _FLOOR)


def test_importing_it_against_importing_numpy(judge, seconds):
    _in_turn(judge, seconds, "cli.import_vs_numpy", ("-c", "import robid"), ("-c", "import numpy"))


def _in_turn(judge, seconds, key, ours, reference):
    for warm_up in (reference, ours):
        seconds(warm_up)

    def measure():
        pairs = np.array([(seconds(reference), seconds(ours)) for _ in range(_ROUNDS)])
        floor, own = np.median(pairs, axis=0)
        low, high = np.quantile(pairs[:, 1] / pairs[:, 0], [0.25, 0.75])
        spread = f"quartiles {low:.3g} to {high:.3g}, {_ROUNDS} rounds"
        told = f"{spread}; ours {1e3 * own:.3g} ms, floor {1e3 * floor:.3g} ms"
        return float(own / floor), f"(time over the floor's, below is faster: {told})"

    judge(key, measure, slower=True)
