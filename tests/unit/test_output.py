"""What commands write for programs, also when the program no longer reads."""

import io
import json
import os
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pytest

from robid.arrays import Meaning
from robid.cli import run_command
from robid.commands.output import Answer, ErrorAnswer, print_json, print_plain


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
            print_plain({"id": "r1"}, one_line=True)
        print_plain({"id": "r2"}, one_line=True)


def test_a_command_that_nobody_reads_says_so_and_ends_as_one_that_is_interrupted(monkeypatch, capsys):
    with nobody_reads(monkeypatch):
        assert run_command(["schema", "--json"]) == 130
    assert "robid: interrupted; what is finished is kept" in capsys.readouterr().err


@dataclass(frozen=True)
class Numbers(Answer, type="numbers", version="3.7"):
    numbers: Annotated[Any, Meaning("any")]
    by_name: Annotated[dict[str, float], Meaning("any")]


def test_what_is_not_finite_is_null_and_numpy_is_plain(capsys):
    values = (1.5, float("nan"), np.float64("inf"), np.array([[2.0, -np.inf]]), np.int64(3), np.bool_(True), None)
    print_json(Numbers(values, {"a": float("-inf"), "b": 0.1}))
    told = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    assert told == {
        "type": "numbers",
        "json_version": "3.7",
        "numbers": [1.5, None, None, [[2.0, None]], 3, True, None],
        "by_name": {"a": None, "b": 0.1},
    }
    assert list(told) == ["type", "json_version", "numbers", "by_name"]


def test_every_encoding_of_the_pipe_holds_an_answer(monkeypatch):
    told, error = io.BytesIO(), "±3 µm in gel\udce4ufig.csv"
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(told, encoding="ascii", write_through=True))
    print_json(ErrorAnswer(error, (), 2), one_line=True)
    assert json.loads(told.getvalue())["error"] == error
    assert told.getvalue().count(b"\n") == 1
