"""What a stage keeps in memory does not grow with the number of configurations."""

import subprocess
import sys

import pytest

import frf_campaign
from frf_campaign import random_record, write_campaign


@pytest.mark.slow
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="the memory is read from /proc")
def test_estimating_16_configurations_takes_the_memory_of_4(tmp_path):
    grown = []
    for n_conf in (4, 16):
        path = tmp_path / f"{n_conf}" / "record.h5"
        write_campaign(path, random_record(5000), n_conf)
        command = [sys.executable, frf_campaign.__file__, str(path), str(path.with_name("frf.h5")), "nominal"]
        grown.append(int(subprocess.run(command, check=True, capture_output=True, text=True).stdout))
    assert grown[0] > 50e6, "a configuration's samples alone take so much"
    assert grown[1] < 1.2 * grown[0]
