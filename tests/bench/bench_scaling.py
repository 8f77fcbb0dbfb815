"""How time and memory of a stage grow with its size: slopes over 1, 2, 4, 8 and 16 times as much, on logarithms.

A slope of 1 is proportional; below, what is fixed still counts.
"""

import shutil
import time
import tracemalloc
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from default_campaign import CONFIGURATION, DELAY_S, ROBOT, default_experiment
from exact_systems import exact_frf
from fleet_floor import COMMAND, Floor
from frf_campaign import make_job, random_record, write_campaign
from robid.backends.map import make_map
from robid.cli import run_command
from robid.design.configurations.relaxed import relaxed_design
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.options import ElasticOptions
from robid.pipeline.estimate_frf import run
from robid.simulate.experiment import simulate
from smooth_designs import smooth_information

_TIMES = np.array([1, 2, 4, 8, 16])
_FREE = ("stiffness", "damping")


@pytest.fixture
def grow(keep):
    """Runs a task, made for a size, at growing sizes, and notes the slopes of time and of memory in Python."""

    def measure(key, make):
        seconds, peaks = [], []
        for size in _TIMES.tolist():
            task = make(size)
            task()
            seconds.append(min(_seconds(task) for _ in range(3)))
            tracemalloc.start()
            task()
            peaks.append(tracemalloc.get_traced_memory()[1])
            tracemalloc.stop()
        for name, values, factor, unit in (("time", seconds, 1e3, "ms"), ("memory", peaks, 1e-6, "MB")):
            slope = float(np.polyfit(np.log(_TIMES), np.log(values), 1)[0])
            told = " ".join(f"{factor * value:.3g}" for value in values)
            keep(f"scaling.{key}.{name}", slope, f"(over {told} {unit})")

    return measure


def _seconds(task):
    begun = time.perf_counter()
    task()
    return time.perf_counter() - begun


def test_responses_over_configurations(grow, tmp_path):
    record = random_record(500)

    def make(size):
        path = tmp_path / f"{size}" / "record.h5"
        write_campaign(path, record, size)
        return lambda: _estimate(path)

    grow("frf.configurations", make)


def test_responses_over_samples(grow, tmp_path):
    def make(size):
        path = tmp_path / f"{size}" / "record.h5"
        write_campaign(path, random_record(500 * size), 1)
        return lambda: _estimate(path)

    grow("frf.samples", make)


def _estimate(path):
    with make_map("serial", 1) as parallel_map:
        run(make_job(path, path.with_name("frf.h5"), "nominal", parallel_map))


def test_simulation_over_samples(grow):
    def make(size):
        experiment = default_experiment(0.25 * size, 1)
        experiment = replace(experiment, options=replace(experiment.options, transient_periods=0))
        return lambda: simulate(experiment, CONFIGURATION, 0)

    grow("simulate.samples", make)


def _normal(n_conf, n_line, free=_FREE, fixed=()):
    configurations = np.random.default_rng(2).uniform(ROBOT.lower, ROBOT.upper, (n_conf, len(ROBOT.joints)))
    frf = exact_frf(ROBOT, configurations, np.geomspace(2, 80, n_line), delay_s=DELAY_S, relative_noise=0.02)
    problem = set_up(ROBOT, frf, ElasticOptions(free=free, fixed=fixed), DELAY_S)[0]
    points = iter(range(1000))
    return lambda: problem.normal(np.full(len(problem.parameters.names), 1e-6 * next(points)))


def test_a_step_of_a_fit_over_configurations(grow):
    grow("fit.configurations", lambda size: _normal(2 * size, 60))


def test_a_step_of_a_fit_over_lines(grow):
    grow("fit.lines", lambda size: _normal(4, 20 * size))


def test_a_step_of_a_fit_over_parameters(grow):
    names = [f"{spring.name}.{kind}" for kind in _FREE for spring in ROBOT.springs]
    grow("fit.parameters", lambda size: _normal(4, 60, fixed=tuple(names[round(1.6 * size) :])))


def test_a_design_over_candidates(grow):
    def make(size):
        matrices = smooth_information(500 * size)
        return lambda: relaxed_design(matrices)

    grow("design.candidates", make)


def test_a_fleet_over_rows(grow, tmp_path, monkeypatch):
    def make(size):
        folder = tmp_path / f"{size}"
        folder.mkdir()
        monkeypatch.chdir(folder)
        floor = Floor(SimpleNamespace(folder=folder))
        floor.start({f"robot_{index}": 1.0 + 0.01 * index for index in range(size)})

        def task():
            shutil.rmtree(folder / "runs", ignore_errors=True)
            assert run_command([*COMMAND, "--json"]) == 0

        return task

    grow("reprocess.rows", make)
