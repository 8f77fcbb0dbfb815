"""The estimate-frf stage on a record of any number of configurations, without an experiment file of its own."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from default_campaign import CAMPAIGN, LOADED
from robid.artifacts.artifact import Provenance
from robid.artifacts.kinds import RECORD, record_to_artifact
from robid.artifacts.parts import Parts
from robid.backends.map import make_map
from robid.pipeline.estimate_frf import run
from robid.pipeline.stage import Job
from robid.signals.quantities import motor_channels
from robid.signals.record import Record

_ENCODER_NOISE_RAD = 1e-5
_TORQUE_NOISE_NM = 0.05


class _NoProgress:
    def expect(self, total, unit, done=0):
        """Ignored."""

    def advance(self):
        """Ignored."""

    def warn(self, text):
        """Ignored."""


def write_campaign(path, first: Record, n_conf: int) -> None:
    """Writes a record of configurations that differ by their noise, one at a time."""
    generator = np.random.default_rng(1)
    parts = Parts(path, RECORD, "0" * 16)
    for index in range(n_conf):
        torque = first.inputs + _TORQUE_NOISE_NM * generator.standard_normal(first.inputs.shape)
        position = first.outputs + _ENCODER_NOISE_RAD * generator.standard_normal(first.outputs.shape)
        one = replace(first, inputs=torque, outputs=position)
        parts.write(index, record_to_artifact(one, Provenance("simulate-or-acquire")))
    parts.merge(n_conf, Provenance("simulate-or-acquire"))


def random_record(n_sample: int) -> Record:
    """White torque and angles of six motors: four blocks, two periods."""
    generator = np.random.default_rng(2)
    names = tuple(f"axis{index}" for index in range(1, 7))
    shape = (1, 4, 6, 2, n_sample, 6)
    return Record(
        sampling_period_s=1e-3,
        configurations=np.zeros((1, 6)),
        inputs=generator.standard_normal(shape),
        outputs=1e-2 * generator.standard_normal(shape),
        reference=generator.standard_normal((1, 4, 6, n_sample, 6)),
        reference_channels=motor_channels(names, "speed_reference"),
        excited_lines=np.arange(11, 131, 2),
        detection_lines=np.arange(0),
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(names, "angle"),
        output_offset=np.zeros((1, 6)),
    )


def make_job(record: Path, output: Path, compensation: str, parallel_map) -> Job:
    """The stage's job for the default experiment's estimation campaign."""
    estimate = replace(CAMPAIGN.estimate, compensation=compensation)
    campaigns = {"estimation": CAMPAIGN.model_copy(update={"estimate": estimate})}
    loaded = replace(LOADED, experiment=LOADED.experiment.model_copy(update={"campaigns": campaigns}))
    inputs = {"record": record}
    return Job(
        loaded, "estimate-frf", "estimation", {}, output, inputs, {}, output.parent, parallel_map, 1,
        _NoProgress(),
    )  # fmt: skip


def run_job(record: Path, output: Path, compensation: str) -> None:
    """Runs the stage in this process."""
    with make_map("serial", 1) as parallel_map:
        run(make_job(record, output, compensation, parallel_map))


def _memory_bytes(kind: str) -> int:
    """Memory of this process as Linux counts it: VmRSS now, VmHWM at its highest."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(1024 * int(line.split()[1]) for line in lines if line.startswith(f"{kind}:"))


if __name__ == "__main__":
    # Prints by how much the stage raises this process's memory, its libraries left out.
    importlib.import_module("robid.pipeline.estimate_frf")
    job_record, job_output, job_compensation = sys.argv[1:]
    before = _memory_bytes("VmRSS")
    run_job(Path(job_record), Path(job_output), job_compensation)
    print(_memory_bytes("VmHWM") - before)  # noqa: T201
