"""The haptic device over many seeds."""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.pipeline.graph import Run
from robid.studies.janot2009.haptic.device import NOMINAL, Bench, Device, measured, simulate
from robid.studies.janot2009.section import study_of
from robid.studies.janot2009.seeded.chunks import Chunk, chunk_tasks, judge_chunk
from robid.studies.janot2009.seeded.identification import Machine, Recording
from robid.studies.settings.study import SeededCase
from robid.studies.tasks import Content, Task

FIRST_MOMENTS = ((1, 2),)


def haptic_tasks(run: Run) -> list[Task]:
    """Returns the tasks of the device; none where the study leaves it out."""
    case = study_of(run.loaded).haptic
    return [] if case is None else chunk_tasks(case, "haptic", {}, lambda chunk: chunk)


def identify_haptic(chunk: Chunk) -> Content:
    """Simulates and identifies some seeds of the device."""
    bench = bench_of(chunk.case)
    return judge_chunk(haptic_machine(bench), record(chunk.seeds, bench), chunk.case)


def bench_of(case: SeededCase) -> Bench:
    """Returns the device's loop and sensors as the settings say."""
    return Bench(duration_s=case.duration_s, quantum_rad=case.resolution_rad, torque_noise_nm=case.torque_noise_nm)


def haptic_machine(bench: Bench) -> Machine:
    """Returns the device as what is to be identified."""

    def simulate_loop(parameters: FloatArray) -> FloatArray:
        return simulate(parameters, bench)[0].T[..., None]

    return Machine(Device(), np.array(NOMINAL), FIRST_MOMENTS, simulate_loop, weighted=False)


def record(seeds: range, bench: Bench) -> Recording:
    """Simulates one device a seed: the zero of its encoder and its torque noise differ."""
    generators = [np.random.default_rng(seed) for seed in seeds]
    phase = np.array([generator.uniform(0, bench.quantum_rad) for generator in generators])
    position, torque = simulate(np.tile(NOMINAL, (len(seeds), 1)), bench, phase)
    noise = np.stack([generator.standard_normal(len(torque)) for generator in generators])
    seen = measured(position, bench, phase)
    return Recording(bench.sampling_period_s, seen.T[..., None], (torque.T + bench.torque_noise_nm * noise)[..., None])
