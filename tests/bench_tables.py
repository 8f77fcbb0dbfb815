"""The page of benchmarks, written from the record of `make bench`.

`.venv/bin/python tests/bench_tables.py` takes `runs/bench/bench.json`, keeps it as `data/bench.json` and writes the
page; a test compares the page with the record.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
PAGE, RECORD = ROOT / "docs/reference/benchmarks.md", ROOT / "data/bench.json"
# Key, or its beginning: what it is.
MEANINGS = {
    "cli.help_vs_floor": "the command line's help, its time over that of importing NumPy, h5py, pydantic and typer",
    "cli.status_vs_floor": "`robid status` of the default experiment, over the same",
    "cli.import_vs_numpy": "`import robid`, over `import numpy`",
    "design.a_300_ms": "A-optimal weights of 300 candidates, 26 parameters [ms]",
    "design.d_300_ms": "D-optimal weights of 300 candidates [ms]",
    "design.e_300_ms": "E-optimal weights of 300 candidates [ms]",
    "design.d_100000_s": "D-optimal weights of 100,000 candidates [s]",
    "design.prediction_vs_d": "configurations for prediction, over D-optimal ones of the same 300 candidates",
    "design.vs_cvxpy_3000": "D-optimal weights of 3,000 candidates, against cvxpy with Clarabel, to the same optimum",
    "external.response_vs_scipy": "a response of 2 x 3 elements, 12 poles, against scipy on finite differences",
    "external.response_vs_scipy_one_element": "the same of one element and 9 poles",
    "external.vs_lsim": "simulation of external models, against scipy's `lsim`",
    "face.parameters_vs_read": "opening a run in Python and reading its parameters, against reading the HDF5 file",
    "fit.cost_ms": "cost of a fit: 15 configurations, 60 lines, 6 x 6, 26 parameters [ms]",
    "fit.normal_ms": "the same with gradient and Gauss-Newton matrix [ms]",
    "fit.all_residuals_ms": "the same from all residuals one by one [ms]",
    "fit.finite_differences_error": "analytic Jacobian against two-point differences: worst column, relative",
    "fit.jacobian_vs_finite_differences": "analytic Jacobian, against two-point differences",
    "fit.normal_vs_cost": "gradient and Gauss-Newton matrix, against the cost alone",
    "fit.vs_bfgs": "a fit, against scipy's BFGS on finite differences, to the same minimum",
    "fit.vs_scipy_2point": "a fit, against scipy's `least_squares` on finite differences, to the same minimum",
    "fit.vs_mujoco_sysid": "springs from one record, against MuJoCo's toolbox on rollouts, to the same accuracy",
    "fit.robid_error": "springs of that record by robid, root mean square error, relative",
    "fit.mujoco_sysid_error": "the same by MuJoCo's toolbox at the end of its time",
    "frf.vs_read_fft": "responses with covariances and checks, against reading the record and its FFT alone",
    "frf.compensated_vs_read_fft": "the same with friction subtracted",
    "frf.memory_16_vs_4": "memory of 16 configurations over that of 4",
    "frf.record_mb_per_configuration": "record on disk of one configuration [MB]",
    "lpv.vs_cvxpy": "the cone program of an LPV fit, against cvxpy",
    "rigid.vs_pinocchio": "a rigid fit, against least squares on Pinocchio's regressor",
    "rigid.memory_4_vs_1": "memory of four times the samples over that of once",
    "simulate.vs_rollout": "closed loop in MuJoCo, against an open-loop `mujoco.rollout` of as many samples",
    "simulate.useful_vs_rollout": "the same by samples that are kept: what comes before the record counts as time",
    "scaling.": "slope over 1, 2, 4, 8, 16 times the size, on logarithms",
}
_HEAD = """# Benchmarks
How fast robid is, as `make bench` measures it: most figures are ratios of two tasks that are timed in turn in one run,
which hardly depend on the machine. Above 1 robid is faster than what it is compared with, unless a figure says
"over". `make bench-quick`, which CI runs, compares the quick ones with `tests/bench/baseline.json` and fails where one
is worse by a factor of 1.5, twice in a row.
"""


def page(record: dict[str, Any]) -> str:
    """Returns the page of a record."""
    machine = record["machine"]
    said = ", ".join(f"{name} {machine[name]}" for name in ("python", "numpy", "scipy", "mujoco-core"))
    processor = f"{machine['processor']}, {machine['threads']} threads, of which one is used"
    on = f"Measured on {machine['date']}: {processor}; {said}."
    lines = [_HEAD, on, "", "| figure | value | what | accuracy, spread, times |", "|---|---|---|---|"]
    for key, value in record.items():
        if isinstance(value, float):
            remark = record["remarks"][key].strip("()").replace("|", "\\|")
            lines.append(f"| `{key}` | {value:.3g} | {_meaning(key)} | {remark} |")
    return "\n".join(lines) + "\n"


def _meaning(key: str) -> str:
    return MEANINGS[max((begin for begin in MEANINGS if key.startswith(begin)), key=len)]


if __name__ == "__main__":
    found = json.loads((ROOT / "runs/bench/bench.json").read_text(encoding="utf-8"))
    RECORD.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    PAGE.write_text(page(found), encoding="utf-8")
