"""Writes `baseline.json`: each quick ratio's median and range over several runs, and what they were measured on.

Run it on the machine and beside the load that CI has, as in `python tests/bench/baseline.py 10`.
"""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

_ROOT = Path(__file__).parents[2]
_RATIOS = _ROOT / "runs/bench/bench.json"


def main(runs):
    found, machine = [], {}
    for run in range(runs):
        files = sorted(str(path) for path in Path(__file__).parent.glob("bench_*.py"))
        options = ["-q", "--override-ini", "python_files=bench_*.py", "-m", "quick"]
        subprocess.run([sys.executable, "-m", "pytest", *options, *files], cwd=_ROOT, check=True)
        said = json.loads(_RATIOS.read_text(encoding="utf-8"))
        machine = said["machine"]
        found.append({key: value for key, value in said.items() if isinstance(value, float)})
        sys.stderr.write(f"run {run + 1} of {runs}\n")
    ratios = {}
    for key in sorted(found[0]):
        values = np.array([one[key] for one in found])
        low, middle, high = (float(f"{value:.4g}") for value in (values.min(), np.median(values), values.max()))
        ratios[key] = {"median": middle, "low": low, "high": high}
    content = {"machine": machine, "runs": runs, "ratios": ratios}
    Path(__file__).with_name("baseline.json").write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
