"""Writes the logs of a plan, and the campaign that reads them as an experiment file has it."""

from __future__ import annotations

import bz2
import gzip
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from scipy.io import savemat

from any_log import MESSAGES, Logs, Plan, numbers
from linear_loop import LINES, N_SAMPLE
from log_files import WRITERS


def excitation(plan: Plan, lines: list[int] | None = None, period_samples: int = N_SAMPLE) -> dict[str, Any]:
    """What is said of the excitation of a plan."""
    period_s = N_SAMPLE * plan.step_s
    low, high = ((line + side) / period_s for line, side in ((LINES[0], -0.25), (LINES[-1], 0.25)))
    stated = {
        "band": {"count": len(LINES), "spacing": "linear", "detection_share": 0},
        "list": {"lines": lines or LINES.tolist()},
        "found": {"lines": "found", "grid": "full"},
    }[plan.excitation]
    return {"period_s": period_samples * plan.step_s, "low_hz": low, "high_hz": high, "rms": 2, "seed": 3, **stated}


def write(logs: Logs, folder: Path) -> dict[str, Any]:
    """Writes the files of some logs; returns the campaign."""
    folder.mkdir()
    plan = logs.plan
    variables = _write_tables(logs, folder)
    if logs.missing:
        (folder / logs.missing).unlink()
    if logs.cut:
        path = folder / logs.cut
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    return {
        "configurations": {"list_deg": [[0, 0], [20, 30]][: plan.n_conf]},
        "excitation": excitation(plan, logs.lines, logs.period_samples),
        "realizations": plan.n_real,
        "periods": plan.periods,
        "source": {"acquire": _acquire(logs, variables)},
        "estimate": {"compensation": "none", "estimator": plan.estimator},
    }


def _acquire(logs: Logs, variables: dict[str, str]) -> dict[str, Any]:
    """The mapping: what was chosen, in the words of an experiment file."""
    plan = logs.plan
    acquire: dict[str, Any] = {"file": f"logs/{plan.file()}", "sampling_period_s": plan.step_s}
    if plan.says_format:
        acquire["format"] = plan.kind.partition(" ")[0]
    if plan.kind == "csv" and plan.text.dialect:
        acquire["dialect"] = plan.text.dialect
    for group, channels in logs.channels.items():
        listed = [{**one, "variable": variables.get(one["variable"], one["variable"])} for one in channels]
        if plan.split and group == "outputs":
            listed = [{**one, "file": f"logs/{plan.file('out_')}"} for one in listed]
        if listed:
            acquire[group] = listed
    if plan.time and plan.kind in MESSAGES:
        acquire["time"] = {"variable": variables["time"], "unit": "s"}
    elif plan.time:
        acquire["time"] = {"variable": variables["t"], "unit": "s" if plan.stamp else plan.time}
    if logs.drop_periods:
        acquire["drop_periods"] = logs.drop_periods
    if logs.take != "first":
        acquire["take"] = logs.take
    return acquire


def prefix_of(plan: Plan) -> str:
    """What the names of variables begin with, numbers to be put in."""
    mark = "/" if plan.kind == "hdf5" else "_"
    every = ("c{configuration}", "r{realization}", "e{experiment:02d}")
    kept = {"file": (), "variable": every[1:], "one": every}[plan.places]
    return "".join(one + mark for one in kept)


def _write_tables(logs: Logs, folder: Path) -> dict[str, str]:
    """Writes all files; returns what the mapping calls each column."""
    plan, prefix = logs.plan, prefix_of(logs.plan)
    variables: dict[str, str] = {}
    for part in ("", "out_") if plan.split else ("",):
        tables: dict[str, dict[str, np.ndarray]] = {}
        for index, columns in logs.columns.items():
            begin = prefix.format(**numbers(index))
            table = tables.setdefault(logs.file_name(index, part), {})
            for name, values in columns.items():
                if not plan.split or name.startswith("q") == bool(part):
                    table[begin + name] = values
        for file, table in tables.items():
            names = _write_file(plan, folder / file, table, logs.units)
        # All files have the same names; those of the last experiment stand for all.
        for name, variable in names.items():
            if name.startswith(begin):
                variables.setdefault(name.removeprefix(begin), variable.replace(begin, prefix) if begin else variable)
    return variables


NAMED = {"brackets": " [{}]", "parentheses": " ({})", "comma": ", {}", "underscore": "_{}"}
"""How a unit may stand behind a name."""


def _write_matrix(plan: Plan, path: Path, table: dict[str, np.ndarray]) -> dict[str, str]:
    """Writes all columns as one matrix; returns what each is called."""
    matrix = np.stack([np.asarray(values, float) for values in table.values()], axis=1)
    matrix = matrix.T if plan.matrix == "rows" else matrix
    if plan.kind == "mat":
        savemat(path, {"all": matrix}, do_compression=True)
    else:
        WRITERS[plan.kind][0](path, {})
        with h5py.File(path, "r+") as file:
            # MATLAB writes the axes in reverse.
            data = file.create_dataset("all", data=matrix.T if plan.kind == "mat 7.3" else matrix)
            data.attrs["MATLAB_class"] = np.bytes_("double")
    return {name: f"all({i},:)" if plan.matrix == "rows" else f"all(:,{i})" for i, name in enumerate(table, start=1)}


def _write_file(plan: Plan, path: Path, table: dict[str, np.ndarray], units: dict[str, str]) -> dict[str, str]:
    plain = path.with_suffix("") if plan.packed else path
    if plan.kind == "csv":
        own = {name: units.get(name.rpartition("_")[2], "-") for name in table}
        called = {name: f"{name}{NAMED[plan.named].format(unit)}" if plan.named else name for name, unit in own.items()}
        written = plan.text.write(
            plain,
            {called[name]: values for name, values in table.items()},
            {called[name]: unit.replace(" ", "") for name, unit in own.items()},
        )
        names = {name: written[called[name]] for name in table}
    elif plan.matrix:
        names = _write_matrix(plan, plain, table)
    else:
        _, names = WRITERS[plan.kind][0](plain, table)
    if plan.packed:
        path.write_bytes({"gz": gzip.compress, "bz2": bz2.compress}[plan.packed](plain.read_bytes()))
        plain.unlink()
    return names
