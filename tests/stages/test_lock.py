"""Two commands in one run folder: one works, the other says who is at work."""

import os
import signal
import subprocess
import sys
import time

import pytest


def started(shop, *command):
    """Starts a command and waits until it works on the record."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen([sys.executable, "-m", "robid", *command], env=environment, cwd=shop.folder, **pipes)
    deadline = time.monotonic() + 300
    while not list(shop.runs.glob("estimation/record.h5.parts/*.part")):
        if process.poll() is not None or time.monotonic() > deadline:
            process.kill()
            process.wait()
            pytest.fail("the first command does not get to its first part")
        time.sleep(0.005)
    return process


@pytest.fixture
def slow(shop):
    shop.change("count: 2}", "count: 3}")
    shop.change("periods: 2", "periods: 100")
    return shop


def test_a_second_command_names_the_first_and_a_dead_one_blocks_nobody(slow):
    process = started(slow, "run", "small.yaml")
    try:
        stage = ("design-configs", "small.yaml", "--design", "best", "--force")
        for command in (("run", "small.yaml"), stage):
            answer = slow.robid(*command)
            assert answer.code == 3
            assert f"process {process.pid}, since " in answer.flat
            assert "robid run small.yaml" in answer.flat
        assert slow.robid("status", "small.yaml").code == 0
        assert process.poll() is None
    finally:
        process.send_signal(signal.SIGKILL)
        process.wait()
    assert (slow.runs / ".lock").exists()
    old = slow.runs / "estimation" / "record.h5.parts"
    assert list(old.glob("*.part"))
    slow.change("periods: 100", "periods: 2")
    slow.change("  estimation:", "  renamed:")
    slow.change("from: estimation", "from: renamed")
    answer = slow.robid("run", "small.yaml")
    assert answer.code in (0, 5), answer.err
    assert not old.exists()
    assert not (slow.runs / ".lock").exists()


def test_a_run_folder_that_may_not_be_written_is_told(done):
    (done.runs / ".lock").mkdir()
    done.refuse(3, "A004", ".lock")
