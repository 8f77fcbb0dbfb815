"""Whether what computes does: workers, and a small identification whose truth is known."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from robid.backends.map import make_map
from robid.commands.installation import Check
from robid.commands.shared import open_run
from robid.errors import RobidError
from robid.later import later
from robid.pipeline.chain import CHAIN
from robid.pipeline.graph import Result, Run, run_all
from robid.scaffold.examples import example_files
from robid.scaffold.folders import write_folder

with later(__name__):
    from robid.pipeline.report import gather

_TASKS = (1, 2)
_CLOSE = 0.02
_NAME = "doctor"


def backends() -> Iterator[Check]:
    """Computes the same on every backend that is installed, each with a worker of its own."""
    with TemporaryDirectory() as made:
        yield _backend("serial", Path(made))
        yield _backend("processes", Path(made))
        if find_spec("distributed") is not None:
            yield _backend("dask", Path(made))


def work(seed: int) -> tuple[int, float]:
    """Returns the process that it runs in, and a number that is the same in all."""
    matrix = np.random.default_rng(seed).standard_normal((50, 50))
    return os.getpid(), float(np.linalg.slogdet(matrix @ matrix.T)[1])


def _backend(backend: Literal["serial", "processes", "dask"], folder: Path) -> Check:
    name, expected = f"backend {backend}", [work(task)[1] for task in _TASKS]
    try:
        with make_map(backend, 1, folder=folder) as parallel_map:
            found = parallel_map(work, _TASKS)
    except (RobidError, OSError, RuntimeError) as error:
        remedy = getattr(error, "remedy", "") or "use another `--backend`, and report this"
        return Check(name, "failed", f"S562 does not compute: {getattr(error, 'what', error)}", remedy)
    if backend != "serial" and any(process == os.getpid() for process, _ in found):
        return Check(name, "failed", "S563 its work was done in the command's own process", "report this")
    if not np.allclose([value for _, value in found], expected, rtol=1e-9):
        return Check(name, "failed", "S564 a worker computes something else", "install robid anew, and report this")
    return Check(name, "ok", "computes" if backend == "serial" else "a worker started, and computes the same")


def identification() -> Check:
    """Simulates a drive whose spring is not that of its file, and looks whether the fit finds it."""
    with TemporaryDirectory() as made:
        folder = Path(made) / _NAME
        write_folder(folder, _small())
        run = open_run(folder / f"{_NAME}.yaml", Path(made) / "run", "serial", 1)
        try:
            results = run_all(run, lambda _: nullcontext(_Silent()), lambda _: None, ("fits/elastic/model.h5",))
        except RobidError as error:
            return Check("identification", "failed", error.what, error.remedy)
        return _judged(run, results)


class _Silent:
    """Progress that nobody looks at."""

    def expect(self, total: int, unit: str, done: int = 0) -> None:
        """Says nothing."""

    def advance(self) -> None:
        """Says nothing."""

    def warn(self, text: str) -> None:
        """Says nothing."""


def _small() -> dict[str, str]:
    """The drive of the examples in two configurations."""
    files = example_files("drive", _NAME)
    experiment = f"{_NAME}.yaml"
    return files | {experiment: re.sub(r"list_deg: \[\[.*?\]\]", "list_deg: [[0], [150]]", files[experiment], count=1)}


def _judged(run: Run, results: list[Result]) -> Check:
    gathered = gather(CHAIN, run.loaded, run.folder, [path for result in results for path in result.node.plan.outputs])
    rows = [row for row in gathered.fits[0].parameters if row.kind in ("stiffness", "damping")]
    errors = {row.kind: abs(row.estimate / row.truth - 1) for row in rows if row.truth}
    told = ", ".join(f"{kind} off the truth by {100 * error:.2g} %" for kind, error in errors.items())
    if not errors or max(errors.values()) > _CLOSE:
        what = f"S565 a simulated drive is not identified: {told or 'no parameter was found'}"
        return Check("identification", "failed", what, "install robid anew with the versions of constraints.txt")
    return Check("identification", "ok", f"a simulated drive: {told}")
