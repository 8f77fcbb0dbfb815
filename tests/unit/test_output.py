"""What commands write for programs, also when the program no longer reads."""

import os
import sys
from contextlib import contextmanager

import pytest

from robid.cli import run_command
from robid.commands.output import print_json


@contextmanager
def nobody_reads(monkeypatch):
    """Standard output is a pipe that its reader has closed, as after `| head -1`."""
    reads, writes = os.pipe()
    os.close(reads)
    with os.fdopen(writes, "w", encoding="utf-8") as stream, monkeypatch.context() as patched:
        patched.setattr(sys, "stdout", stream)
        yield


def test_a_closed_pipe_interrupts_and_what_follows_goes_nowhere(monkeypatch):
    with nobody_reads(monkeypatch):
        with pytest.raises(KeyboardInterrupt):
            print_json({"id": "r1"}, one_line=True)
        print_json({"id": "r2"}, one_line=True)


def test_a_command_that_nobody_reads_says_so_and_ends_as_one_that_is_interrupted(monkeypatch, capsys):
    with nobody_reads(monkeypatch):
        assert run_command(["schema", "--json"]) == 130
    assert "robid: interrupted; what is finished is kept" in capsys.readouterr().err
