"""Damages files and reads them as users do, each case by its seed in a process that a crash or a hang ends."""

from __future__ import annotations

import contextlib
import faulthandler
import gzip
import io
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import savemat

import robid as robid_package
from any_log_text import Text
from log_files import WRITERS
from mutations import command_case, settings_case
from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import DESIGN, EXCITATION, FRF, RECORD, frf_from_artifact
from robid.artifacts.results import MODEL, VALIDATION
from robid.artifacts.store import check_artifact, inspect_artifact, kind_of, read_artifact, read_header
from robid.cli import run_command
from robid.errors import ArtifactError
from robid.logs.formats import load
from robid.logs.formats.load import Limits, Reader
from two_mass_log import bench_log

SECONDS = 120
"""What a case may take, on a machine that is busy."""
OUTSIDE, DEVIATIONS = 0.2, 3
"""Share of a response's elements that may lie beyond so many of its own standard deviations."""
_KINDS = {kind.name: kind for kind in (DESIGN, EXCITATION, FRF, MODEL, RECORD, VALIDATION)}
_HEAD = 3000
_COLUMNS = ("current", "motor", "load")


def _write_plain_mat(path: Path, columns: dict[str, Any]) -> tuple[Path, dict[str, str]]:
    savemat(path, columns)
    return path, {name: name for name in columns}


def _write_old_mat(path: Path, columns: dict[str, Any]) -> tuple[Path, dict[str, str]]:
    savemat(path, columns, format="4")
    return path, {name: name for name in columns}


def _write_other_csv(path: Path, columns: dict[str, Any]) -> tuple[Path, dict[str, str]]:
    text = Text(delimiter=";", decimal=",", preface="# made by a controller", newline="\r\n")
    return path, text.write(path, columns, {})


def _write_packed_csv(path: Path, columns: dict[str, Any]) -> tuple[Path, dict[str, str]]:
    _, names = WRITERS["csv"][0](path, columns)
    path.write_bytes(gzip.compress(path.read_bytes(), mtime=0))
    return path, names


LOGS = {
    **WRITERS,
    "mat plain": (_write_plain_mat, "log.mat"),
    "mat 4": (_write_old_mat, "log.mat"),
    "csv of semicolons": (_write_other_csv, "log.csv"),
    "csv packed": (_write_packed_csv, "log.csv.gz"),
}


class Wrong(Exception):  # noqa: N818
    """A case that came out as none may."""


def run_cases(case: str, folder: Path, seeds: range, batch: int = 50) -> dict[int, str]:
    """Runs a case for every seed; returns what became of each: `same`, `refused: ...`, or `WRONG: ...`."""
    outcomes: dict[int, str] = {}
    first = seeds.start
    while first < seeds.stop:
        last = min(first + batch, seeds.stop)
        asked = [sys.executable, "-m", "damage", case, str(folder), str(first), str(last)]
        done = subprocess.run(asked, capture_output=True, text=True, check=False, env=_environment())
        outcomes |= dict(map(json.loads, done.stdout.splitlines()))
        first = next((seed for seed in range(first, last) if seed not in outcomes), last)
        if first < last:
            end = " ".join(done.stderr.split())[-1500:]
            outcomes[first] = f"WRONG: ended its process with code {done.returncode}: {end}"
            first += 1
    return outcomes


def _environment() -> dict[str, str]:
    """Lets a child see robid and the modules of the tests."""
    paths = [str(Path(robid_package.__file__).parent.parent), str(Path(__file__).parent)]
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    return {**os.environ, **threads, "PYTHONPATH": os.pathsep.join(paths)}


def damage(whole: bytes, generator: np.random.Generator) -> tuple[str, bytes]:
    """Damages the bytes of a file; returns how and what is left."""
    how = str(generator.choice(["cut", "flip", "flip", "flip in its head", "flip in its end", "zeros", "empty"]))
    size, bits = len(whole), np.frombuffer(whole, np.uint8).copy()
    if how == "cut":
        return how, whole[: generator.integers(0, size)]
    if how == "empty" and generator.random() < 0.3:
        return how, b""
    if how == "zeros":
        begin = int(generator.integers(0, size))
        bits[begin : begin + int(generator.choice([1, 8, 100, 4096]))] = 0
        return how, bits.tobytes()
    low, high = {"flip in its head": (0, min(_HEAD, size)), "flip in its end": (max(size - _HEAD, 0), size)}.get(
        how, (0, size)
    )
    at = int(generator.integers(low, high))
    bits[at] ^= 1 << int(generator.integers(0, 8))
    return f"flip at {at}", bits.tobytes()


def edit(path: Path, generator: np.random.Generator) -> str:
    """Removes or changes a dataset or an attribute of an HDF5 file."""
    with h5py.File(path, "r+") as file:
        items: list[Any] = [file]
        file.visititems(lambda _, item: items.append(item))
        datasets = [item for item in items if isinstance(item, h5py.Dataset)]
        chosen = datasets[generator.integers(len(datasets))]
        how = str(generator.choice(["drop dataset", "change dataset", "drop attribute", "change attribute"]))
        if how == "drop dataset":
            del file[chosen.name]
        elif how == "change dataset" and chosen.size:
            flat = chosen[()].reshape(-1) if chosen.shape else np.array([chosen[()]])
            raw = flat.view(np.uint8)
            raw[generator.integers(raw.size)] ^= 1 << int(generator.integers(0, 8))
            chosen[...] = flat.reshape(chosen.shape)
        else:
            item = items[generator.integers(len(items))]
            # Not part of the content: what is said for readers, and how the file came about.
            names = [name for name in item.attrs if name not in ("description", "provenance")]
            if not names:
                return f"nothing in {item.name}"
            name = names[generator.integers(len(names))]
            if how == "drop attribute":
                del item.attrs[name]
            else:
                item.attrs[name] = str(generator.choice(["?", "", "2", "rad"]))
            return f"{how} {name} of {item.name}"
        return f"{how} {chosen.name}"


def robid(*arguments: str) -> tuple[int, str]:
    """Runs a command; it may refuse with one message, and with nothing else."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run_command(list(arguments))
    text = err.getvalue()
    if "Traceback" in text or "Warning: " in text or code not in (0, 2, 3, 4, 5):
        raise Wrong(f"{' '.join(arguments)} ended with {code}: {text[-1500:]}")
    if code in (2, 3, 4) and len(re.findall(r"^robid: ", text, re.MULTILINE)) != 1:
        raise Wrong(f"{' '.join(arguments)} ended with {code} and not one message: {text[-1500:]}")
    return code, text


# Artifacts


def artifact_case(folder: Path, work: Path, generator: np.random.Generator) -> str:
    """An artifact is read as it was, or refused by name."""
    files = sorted(path for path in folder.rglob("*.h5") if kind_of(path) in _KINDS)
    original = files[generator.integers(len(files))]
    kind, path = _KINDS[kind_of(original)], work / original.name
    how = _spoil(original, path, files, generator)
    whole = read_artifact(original, kind)
    outcomes = []
    for reader in (lambda: read_artifact(path, kind), lambda: check_artifact(path, kind), lambda: read_header(path)):
        try:
            found = reader()
        except ArtifactError as error:
            if str(path) not in error.where or not error.remedy:
                raise Wrong(f"{how}: refused without file or remedy: {error}") from error
            outcomes.append(f"refused: {error.what}")
            continue
        if isinstance(found, Artifact) and not _same(whole, found):
            raise Wrong(f"{how}: {original.name} was read, but as something else")
        outcomes.append("same")
    if len({outcome.partition(":")[0] for outcome in outcomes[:2]}) > 1:
        raise Wrong(f"{how}: reading says {outcomes[0]}, checking {outcomes[1]}")
    with contextlib.suppress(ArtifactError):
        inspect_artifact(path)
    return outcomes[0] if outcomes[0] != "same" or outcomes[2] == "same" else f"WRONG: {how}: {outcomes}"


def chain_case(folder: Path, work: Path, generator: np.random.Generator) -> str:
    """A chain goes on over a damaged run folder and ends with what was there before."""
    shutil.copytree(folder, work, dirs_exist_ok=True)
    files = sorted(path for path in (work / "runs").rglob("*") if path.is_file())
    path = files[generator.integers(len(files))]
    before = {one: read_header(one).content_sha256 for one in files if kind_of(one) in _KINDS}
    artifacts = [one for one in before if one != path]
    how = f"{path.relative_to(work)}, {_spoil(path, path, artifacts, generator)}"
    with contextlib.chdir(work):
        robid("status", "small.yaml")
        robid("inspect", str(path))
        code, text = _follow(path, work / "away", "run", "small.yaml")
    if code:
        raise Wrong(f"{how}: `run` ends with {code}: {text[-1500:]}")
    after = {one: read_header(one).content_sha256 for one in before}
    changed = [one.name for one in before if before[one] != after[one]]
    if changed:
        raise Wrong(f"{how}: other content in {changed}")
    return "same"


def fleet_case(folder: Path, work: Path, generator: np.random.Generator) -> str:
    """A reprocess goes on over a damaged run folder and ends with the table that was there before."""
    import pyarrow.parquet as pq

    shutil.copytree(folder, work, dirs_exist_ok=True)
    runs, changing = work / "runs/benches", {"seconds", "finished_utc"}
    files = sorted(path for path in runs.rglob("*") if path.is_file())
    path = files[generator.integers(len(files))]
    table, models = (
        pq.read_table(runs / "results.parquet"),
        {one: read_header(one).content_sha256 for one in runs.rglob("model.h5")},
    )
    how = f"{path.relative_to(work)}, {_spoil(path, path, [one for one in models if one != path], generator)}"
    with contextlib.chdir(work):
        command = ("reprocess", "floor/robots.csv", "fleet.yaml", "--backend", "serial")
        code, text = _follow(path, work / "away", *command)
    if code:
        raise Wrong(f"{how}: `reprocess` ends with {code}: {text[-1500:]}")
    found = pq.read_table(runs / "results.parquet")
    kept = [name for name in table.column_names if name not in changing]
    if found.select(kept).to_pylist() != table.select(kept).to_pylist():
        raise Wrong(f"{how}: another table")
    changed = [str(one) for one, digest in models.items() if read_header(one).content_sha256 != digest]
    if changed:
        raise Wrong(f"{how}: other content in {changed}")
    return "same"


def _follow(path: Path, away: Path, *command: str) -> tuple[int, str]:
    """Runs a command; a file that it refuses by name goes, as the remedy says, and it runs again."""
    code, text = robid(*command)
    if code == 3 and path.name in text and re.search("delete it|move.* away", text):
        path.rename(away)
        code, text = robid(*command)
    return code, text


def _spoil(original: Path, path: Path, others: list[Path], generator: np.random.Generator) -> str:
    """Puts a damaged copy of a file at a path."""
    chance = generator.random()
    others = [one for one in others if kind_of(one) and kind_of(one) != kind_of(original)]
    if path != original:
        shutil.copy(original, path)
    if chance < 0.25 and kind_of(original):
        return edit(path, generator)
    if chance < 0.3 and others:
        other = others[generator.integers(len(others))]
        path.write_bytes(other.read_bytes())
        return f"exchanged for {other.name}"
    how, left = damage(path.read_bytes(), generator)
    path.write_bytes(left)
    return how


def _same(one: Artifact, other: Artifact) -> bool:
    """Whether two artifacts have the same content."""
    return (
        one.kind == other.kind
        and repr(sorted(one.attributes.items())) == repr(sorted(other.attributes.items()))
        and one.datasets.keys() == other.datasets.keys()
        and all(
            (a.units, a.axes, a.values.dtype, a.values.shape) == (b.units, b.axes, b.values.dtype, b.values.shape)
            and a.values.tobytes() == b.values.tobytes()
            for a, b in ((one.datasets[name], other.datasets[name]) for name in one.datasets)
        )
    )


# Logs


def readable() -> list[str]:
    """The formats whose readers are installed."""
    needs = {
        "parquet": "pyarrow",
        "arrow": "pyarrow",
        "tdms": "nptdms",
        "mdf": "asammdf",
        "mcap": "mcap",
        "rosbag": "rosbags",
    }
    lacking = [kind for kind, module in needs.items() if find_spec(module) is None]
    lacking += ["mcap"] if "rosbag" in lacking else []
    return [kind for kind in LOGS if kind not in lacking]


def write_logs(folder: Path, kinds: list[str], experiment: str, robot: Path) -> None:
    """Writes the same log in several formats, each with an experiment that reads it and the run of the first."""
    log = {name: values[:, 0] for name, values in bench_log().items()}
    for kind in kinds:
        place = folder / kind.replace(" ", "_")
        place.mkdir(parents=True)
        path, names = LOGS[kind][0](place / LOGS[kind][1], log if kind not in ("mcap", "rosbag") else _three(log))
        unit = "s" if kind in ("mcap", "rosbag") else "ms"
        text = re.sub(r"format: mat\n\s*", "", experiment).replace("${row.log}", path.name)
        text = text.replace('"${row.step_s}"', "1.0e-3").replace("unit: ms", f"unit: {unit}")
        for name in (*_COLUMNS, "time"):
            text = text.replace(f"variable: {name},", f'variable: "{names[name]}",')
        (place / "logs.yaml").write_text(text)
        shutil.copy(robot, place)
        if kind != kinds[0]:
            shutil.copytree(folder / kinds[0].replace(" ", "_") / "runs", place / "runs")
            continue
        with contextlib.chdir(place):
            for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
                code, told = robid(stage, "logs.yaml")
                assert code == 0, told


def _three(log: dict[str, Any]) -> dict[str, Any]:
    return {name: log[name] for name in _COLUMNS}


def log_case(folder: Path, work: Path, generator: np.random.Generator) -> str:
    """A log is refused by name, or gives the response of the whole one within its own uncertainty."""
    kinds = sorted(path.name for path in folder.iterdir())
    kind = kinds[generator.integers(len(kinds))]
    shutil.copytree(folder / kind, work, dirs_exist_ok=True)
    (path,) = work.glob("log.*")
    return _read_damaged(kind, path, work, generator)


def _read_damaged(kind: str, path: Path, work: Path, generator: np.random.Generator) -> str:
    """Damages a file that the experiment beside it reads, and reads it as that does."""
    whole, (experiment,) = _response(work), work.glob("*s.yaml")
    how, left = damage(path.read_bytes(), generator)
    path.write_bytes(left)
    how = f"{kind}, {how}"
    with contextlib.chdir(work):
        robid("inspect", path.name)
        for stage in ("simulate-or-acquire", "estimate-frf"):
            code, text = robid(stage, experiment.name, "--force")
            if code in (2, 3, 4):
                if stage == "simulate-or-acquire" and path.name not in text:
                    raise Wrong(f"{how}: refused without the file's name: {text}")
                return f"refused: {' '.join(text.split())[:300]}"
            if code:
                raise Wrong(f"{how}: ends with {code}: {text[-1500:]}")
    share = _share_outside(whole, _response(work))
    if share > OUTSIDE:
        raise Wrong(f"{how}: {100 * share:.0f} % of the response beyond {DEVIATIONS} deviations: {text[-600:]}")
    return "same" if share == 0 else f"same: {100 * share:.0f} % outside"


RESPONSES = {"csv": "frf_c1.csv", "mat": "frf.mat", "json": "frf.json", "uff": "frf.uff"}


def write_responses(folder: Path) -> None:
    """Writes responses of a finished run in several formats, each with an experiment that reads them and its run."""
    for form, name in RESPONSES.items():
        if form == "uff" and find_spec("pyuff") is None:
            continue
        place = folder / "responses" / form
        place.mkdir(parents=True)
        with contextlib.chdir(folder):
            command = ("export", "small.yaml", "--campaign", "validation", "--what", "frf", "--format", form)
            assert robid(*command)[0] == 0
        shutil.copy(folder / "runs/small/validation/export" / name, place / name)
        with contextlib.chdir(place):
            assert robid("inspect", name, "--propose", "responses.yaml")[0] == 0
            assert robid("run", "responses.yaml")[0] == 0


def response_case(folder: Path, work: Path, generator: np.random.Generator) -> str:
    """A file of responses is refused by name, or gives those of the whole one within their own uncertainty."""
    kinds = sorted(path.name for path in (folder / "responses").iterdir())
    kind = kinds[generator.integers(len(kinds))]
    shutil.copytree(folder / "responses" / kind, work, dirs_exist_ok=True)
    path = work / RESPONSES[kind]
    return _read_damaged(kind, path, work, generator)


def _response(work: Path) -> Any:
    (path,) = (work / "runs").rglob("frf.h5")
    return frf_from_artifact(read_artifact(path, FRF))


def _share_outside(whole: Any, found: Any) -> float:
    """Share of the elements of a response that lie beyond its uncertainty; 1 where shapes differ."""
    if found.frequency_hz.size < whole.frequency_hz.size:
        # A table of text that was cut says nothing of what it lost; what is left must be as it was.
        left = np.abs(whole.frequency_hz[:, None] - found.frequency_hz).argmin(axis=0)
        whole = replace(whole, response=whole.response[:, left], frequency_hz=whole.frequency_hz[left])
    if found.response.shape != whole.response.shape or not np.isfinite(found.response).all():
        return 1.0
    covariance = found.noise_covariance if found.total_covariance is None else found.total_covariance
    output = np.einsum("cfoo->cfo", covariance).real[..., None]
    inputs = np.einsum("cfii->cfi", found.input_factor).real[..., None, :]
    deviation = np.sqrt(output * inputs * found.scale)
    return float(
        (np.abs(found.response - whole.response) > DEVIATIONS * deviation + 1e-9 * np.abs(whole.response)).mean()
    )


def ended_case(folder: Path, work: Path, generator: np.random.Generator) -> str:  # noqa: ARG001
    """Ends as no case may: the second by a crash, the third by a hang."""
    kind = _SEEDS.index(int(generator.integers(1 << 40)))
    if kind == 1:
        os.kill(os.getpid(), signal.SIGSEGV)
    if kind == 2:
        faulthandler.dump_traceback_later(0.2, exit=True)
        time.sleep(60)
    return "same"


_SEEDS = [int(np.random.default_rng(seed).integers(1 << 40)) for seed in range(3)]
CASES: dict[str, Callable[[Path, Path, np.random.Generator], str]] = {
    "artifact": artifact_case,
    "chain": chain_case,
    "fleet": fleet_case,
    "log": log_case,
    "response": response_case,
    "ended": ended_case,
    "settings": settings_case,
    "command": command_case,
}


def _outcomes(case: str, folder: Path, seeds: range) -> Iterator[tuple[int, str]]:
    for seed in seeds:
        faulthandler.dump_traceback_later(SECONDS, exit=True)
        with tempfile.TemporaryDirectory() as work:
            try:
                yield seed, CASES[case](folder, Path(work), np.random.default_rng(seed))
            except Wrong as error:
                yield seed, f"WRONG: {error}"
            except Exception as error:  # noqa: BLE001 whatever comes out is a defect
                place = error.__traceback__
                while place and place.tb_next:
                    place = place.tb_next
                at = f"{place.tb_frame.f_code.co_filename}:{place.tb_lineno}" if place else ""
                yield seed, f"WRONG: {type(error).__name__}: {error} at {at}"
        faulthandler.cancel_dump_traceback_later()


def main(case: str, folder: str, first: str, last: str) -> None:
    """Runs some seeds of a case; a line of JSON tells what became of each."""
    resource.setrlimit(resource.RLIMIT_AS, (8 << 30, 8 << 30))
    load.READER = Reader(Limits(seconds=30.0))
    for seed, outcome in _outcomes(case, Path(folder), range(int(first), int(last))):
        sys.__stdout__.write(json.dumps([seed, outcome]) + "\n")
        sys.__stdout__.flush()


if __name__ == "__main__":
    main(*sys.argv[1:])
