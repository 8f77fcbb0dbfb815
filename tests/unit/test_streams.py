"""What a command shows where the terminal, the disk or the names of files are hostile: a process of its own each."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from robid.errors import DataError
from robid.printable import printable

_ROOT = Path(__file__).parents[2]
_FULL = Path("/dev/full")
needs_full = pytest.mark.skipif(not _FULL.exists(), reason="no device that is always full")


@pytest.fixture
def ask():
    def run(*arguments, out=subprocess.PIPE, err=subprocess.PIPE, **environment):
        command = [sys.executable, "-m", "robid", *arguments]
        told = {**os.environ, **environment}
        return subprocess.run(command, stdout=out, stderr=err, cwd=_ROOT, env=told, check=False)

    return run


@pytest.mark.parametrize("encoding", ["ascii", "ascii:strict", "latin-1", "cp1252:strict"])
def test_every_encoding_shows_every_text(ask, encoding):
    told = ask("status", "é±…ψ.yaml", PYTHONIOENCODING=encoding)
    assert told.returncode == 2
    shown = told.stderr.decode(encoding.partition(":")[0])
    assert "S333" in shown
    assert "\\u03c8.yaml" in shown
    assert ("é±" if "ascii" not in encoding else "\\xe9+-...") in shown


def test_a_page_of_help_is_ascii_where_nothing_else_is_shown(ask):
    told = ask("explain", "grades", PYTHONIOENCODING="ascii:strict")
    assert told.returncode == 0
    assert told.stdout.isascii()


@needs_full
@pytest.mark.parametrize("unbuffered", ["", "1"])
@pytest.mark.parametrize("arguments", [("--help",), ("--version",), ("explain", "S380"), ("schema", "--robot")])
def test_a_result_that_a_full_disk_takes_nothing_of_is_one_error(ask, arguments, unbuffered):
    with _FULL.open("w") as full:
        told = ask(*arguments, out=full, PYTHONUNBUFFERED=unbuffered)
    lines = told.stderr.decode().splitlines()
    assert told.returncode == 3
    assert [line.startswith("robid: B013 ") for line in lines] == [True, False]


@needs_full
def test_a_message_that_cannot_be_shown_changes_no_exit_code(ask):
    with _FULL.open("w") as full:
        assert ask("explain", "S380", err=full).returncode == 0
        assert ask("explain", "S", err=full).returncode == 2
        assert ask("--help", out=full, err=full).returncode == 3


def test_a_result_that_nobody_reads_is_an_interrupt(ask):
    reads, writes = os.pipe()
    os.close(reads)
    with os.fdopen(writes, "w") as nobody:
        told = ask("--help", out=nobody)
    assert told.returncode == 130
    assert len(told.stderr.decode().splitlines()) == 1


@pytest.mark.parametrize("closed", [1, 2])
def test_a_command_runs_with_a_closed_stream(closed):
    command = f'exec "{sys.executable}" -m robid explain S380 {closed}>&-'
    told = subprocess.run(["sh", "-c", command], cwd=_ROOT, capture_output=True, check=False)
    assert (told.returncode, told.stderr) == (0, b"")


@pytest.mark.parametrize(
    "name", ["\x1b[31mred", "a\nrobid: B013 all is lost", "a\u202eb", "a\rb", "a\x9bb", "a\x00b", "a\u2028b", "\udcff"]
)
def test_what_steers_a_terminal_is_escaped_and_stays_on_its_line(name):
    shown = str(DataError("D001 is no number", where=name))
    assert shown.isprintable()
    assert shown == f"{name.encode('unicode_escape').decode()}: D001 is no number"


@pytest.mark.parametrize("arguments", [("status", "x\x1b[31m\nrobid: y"), ("x\x1b[31m\ny",), ("explain", "S\x1b[2J")])
def test_no_argument_steers_the_terminal(ask, arguments):
    told = ask(*arguments)
    lines = told.stderr.decode().splitlines()
    assert told.returncode == 2
    assert all(line.isprintable() for line in lines)
    assert len(lines) == 2


@pytest.mark.parametrize("text", ["±3 µm", "two\nlines\tand a tab", "10\u00a0Nm\u2009", "日本"])
def test_usual_text_stays_as_it_is(text):
    assert printable(text) == text
