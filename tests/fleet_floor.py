"""A folder with a manifest and its logs, beside an experiment file that a row fills."""

import json
import shutil
from pathlib import Path

import pyarrow.parquet as pq
from scipy.io import savemat

from two_mass_log import STIFFNESS, bench_log

FACTORS = {"soft": 0.9, "mean": 1.0, "hard": 1.1}
MANIFEST = "floor/robots.csv"
COMMAND = ("reprocess", MANIFEST, "fleet.yaml", "--backend", "serial")
_STAGES = Path(__file__).parent / "stages"


class Floor:
    """A folder with a manifest and its logs, beside the experiment file."""

    def __init__(self, shop):
        self.shop, self.folder = shop, shop.folder
        self.rows, self.table = shop.folder / "runs/benches/rows", shop.folder / "runs/benches/results.parquet"

    def start(self, factors=FACTORS):
        (self.folder / "floor/logs").mkdir(parents=True)
        for name in ("fleet.yaml", "bench_robot.yaml"):
            shutil.copy(_STAGES / name, self.folder)
        for seed, (name, factor) in enumerate(factors.items()):
            self.write_log(name, factor, seed)
        self.write(factors)

    def write_log(self, name, factor=1.0, seed=0):
        savemat(self.folder / f"floor/logs/{name}.mat", bench_log(factor * STIFFNESS, seed))

    def write(self, names, head="id,log,step_s,hall", line="{0},logs/{0}.mat,1e-3,north"):
        text = "\n".join([head, *(line.format(name) for name in names)])
        (self.folder / MANIFEST).write_text(text + "\n", encoding="utf-8")

    def robid(self, *options):
        return self.shop.robid(*COMMAND, *options)

    def json(self, *options, code=0):
        answer = self.robid("--json", *options)
        assert answer.code == code, answer.err
        return answer.json

    def times(self):
        return {path: path.stat().st_mtime_ns for path in (self.folder / "runs").rglob("*")}

    def results(self):
        return pq.read_table(self.table).to_pylist()

    def ledger(self, name):
        return json.loads((self.rows / name / "row.json").read_text())
