"""Estimating a campaign's frequency responses from its record, against reading the record and taking its FFTs.

The case is 300 configurations x 24 experiments x 2 periods x 5000 samples x 6+6 channels with six configurations only:
one simulated with all imperfections, and copies with noise of their own, so that they compress as simulated ones do.
"""

import subprocess
import sys

import numpy as np
import pytest

import frf_campaign
from default_campaign import CAMPAIGN, CONFIGURATION, default_experiment
from frf_campaign import make_job, write_campaign
from robid.artifacts.kinds import RECORD, record_from_artifact
from robid.artifacts.store import read_artifact
from robid.backends.map import make_map
from robid.pipeline.estimate_frf import run
from robid.simulate.experiment import simulate

_N_CONF = 6


@pytest.fixture(scope="module")
def simulated():
    """One configuration: 24 experiments, 2 periods of 5000 samples, 6 torques and 6 angles."""
    record = simulate(default_experiment(CAMPAIGN.excitation.period_s, CAMPAIGN.periods), CONFIGURATION, 0)
    assert record.inputs.shape == record.outputs.shape == (1, 4, 6, 2, 5000, 6)
    return record


@pytest.fixture(scope="module")
def campaign(simulated, tmp_path_factory):
    path = tmp_path_factory.mktemp("campaign") / "record.h5"
    write_campaign(path, simulated, _N_CONF)
    return path


def read_and_transform(path):
    for row in range(_N_CONF):
        record = record_from_artifact(read_artifact(path, RECORD, row=row))
        np.fft.rfft(record.inputs, axis=4), np.fft.rfft(record.outputs, axis=4)


@pytest.mark.quick
@pytest.mark.parametrize(
    ("key", "compensation"), [("frf.vs_read_fft", "none"), ("frf.compensated_vs_read_fft", "nominal")]
)
def test_estimate_against_reading_and_transforming(compare, campaign, key, compensation):
    with make_map("serial", 1) as parallel_map:
        job = make_job(campaign, campaign.with_name("frf.h5"), compensation, parallel_map)
        compare(key, ours=lambda: run(job), reference=lambda: read_and_transform(campaign), rounds=7)


def test_memory_does_not_grow_with_the_configurations(keep, simulated, tmp_path):
    grown = {}
    for n_conf in (4, 16):
        path = tmp_path / f"{n_conf}" / "record.h5"
        write_campaign(path, simulated, n_conf)
        command = [sys.executable, frf_campaign.__file__, str(path), str(path.with_name("frf.h5")), "nominal"]
        grown[n_conf] = int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    remark = f"({grown[4] / 1e6:.0f} and {grown[16] / 1e6:.0f} MB above the libraries)"
    keep("frf.memory_16_vs_4", grown[16] / grown[4], remark)
    disk = (tmp_path / "16" / "record.h5").stat().st_size
    reference_once = (tmp_path / "4" / "record.h5").stat().st_size
    keep("frf.record_mb_per_configuration", (disk - reference_once) / 12e6)
